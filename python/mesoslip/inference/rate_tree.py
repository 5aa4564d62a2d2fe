"""The posterior of rate-and-state laws of an output: as a file that ArviZ opens, and as a table."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mesoslip.analysis.experiment_stages import Experiment
from mesoslip.analysis.rate_and_state.law import LAWS
from mesoslip.analysis.rate_and_state.records import records_of
from mesoslip.analysis.rate_and_state.rows import assessment
from mesoslip.array_types import Dataset, DataTree
from mesoslip.configuration import arguments
from mesoslip.configuration.units import cf_units, from_cf_units
from mesoslip.errors import ConfigError, FileError
from mesoslip.execution.stop import StopRequest
from mesoslip.inference.checks import MAX_R_HAT, draw_warnings, shrinkage
from mesoslip.inference.posterior import PERCENTILES, draws_group, interval_digits, suffix
from mesoslip.inference.prior import Prior
from mesoslip.inference.rate_posterior import NOISE, RatePosterior, sample_laws
from mesoslip.inference.sampler import r_hat
from mesoslip.output.inputs import OutputLike, opened_run
from mesoslip.output.provenance import program_attributes
from mesoslip.output.table_files import PrintedTable, write_table
from mesoslip.output.variables import with_force_unit
from mesoslip.quantities import column, with_error, with_unit

# Names of parameters in tables, and their meanings.
NAMES = {
    "reference_force": ("F_0", "steady friction at V0"),
    "trend": ("trend", "trend of the friction with displacement"),
    "a": ("a", "parameter a of the direct effect"),
    "b": ("b", "parameter b of the evolution effect"),
    "slip_distance": ("D_c", "characteristic slip distance"),
    "b2": ("b2", "parameter b of a second state variable"),
    "slip_distance2": ("D_c2", "characteristic slip distance of the second state variable"),
    "a_minus_b": ("a - b", "rate dependence of steady sliding"),
    "stiffness": ("stiffness", "stiffness of the apparatus and the interface in series"),
    "noise": ("noise", "standard deviation of the noise of a sample"),
    "noise_share": ("correlated share", "share of the correlated noise in the variance"),
    "noise_time": ("correlation time", "correlation time of the noise"),
}
# Draws of the prior, and predicted records.
PRIOR_DRAWS, PREDICTIONS = 1000, 60
QUANTILES = tuple(f"percentile_{one:g}" for one in PERCENTILES)
NO_VELOCITY = "the drive is a force, without a velocity"


@dataclass(frozen=True)
class Origin:
    """What describes a posterior as an output: the configuration of its record."""

    title: str | None
    configuration: str
    base: None = None

    def to_toml(self) -> str:
        return self.configuration


@arguments.checked(
    laws=arguments.texts,
    samples=arguments.whole(100),
    seed=arguments.whole(0),
    free_stiffness=arguments.flag,
    progress=arguments.function,
)
def response_posterior(
    output: OutputLike,
    *,
    laws: Sequence[str] = (),
    samples: int = 4000,
    seed: int = 1,
    free_stiffness: bool = False,
    progress: Callable[[float], None] | None = None,
    stop: StopRequest | None = None,
) -> DataTree:
    """The posterior of rate-and-state parameters and of the noise of an output. See
    ``docs/response.md``.

    Parameters
    ----------
    output
        A measured trace, or the output of a run.
    laws
        Evolution laws: "ageing", "slip", "ageing, two states", "slip, two states". By default those
        of one state variable, and those of two whose parameters least squares determine, but for
        those that do not describe a record that others describe.
    samples
        Number of draws for each law.
    seed
        Seed of the draws: the same seed gives the same draws.
    free_stiffness
        Whether the stiffness is sampled too where it is known. An unknown one always is.
    progress
        Called repeatedly with the fraction of the work that is done, 0 to 1.
    stop
        A request to stop, after which `mesoslip.execution.stop.StoppedError` is raised.

    Returns
    -------
    xarray.DataTree
        Groups ``posterior`` (dimensions chain, draw), ``prior``, ``posterior_predictive``, as ArviZ
        has them, and ``parameters`` (parameter), the table, of the law that the record prefers or
        that is likeliest; those of other laws end in ``_2``, ``_3``; ``observed_data`` are the
        points of the record. Attributes of ``parameters`` are the law, the verdict whether it
        describes the record, and the assessment in words.

    Raises
    ------
    FileError
        If the output has no steps or holds to which a law can be fitted, or no noise.
    ConfigError
        If an argument is wrong.
    RunError
        If the motion cannot be integrated.

    Examples
    --------
    >>> import mesoslip
    >>> path, *_ = mesoslip.example("measured/basalt-step")  # writes the file and a description
    >>> trace = mesoslip.read_trace(path)
    >>> found = mesoslip.response_posterior(trace, laws=["slip"], samples=400)
    >>> found["posterior"]["slip_distance"].dims
    ('chain', 'draw')
    """
    laws = list(dict.fromkeys(laws))
    unknown = [one for one in laws if one not in LAWS]
    if unknown:
        choice = ", ".join(repr(one) for one in LAWS)
        raise ConfigError.of("law", f"must be one of {choice}", unknown[0])
    with opened_run(output) as (tree, name):
        experiment = Experiment(tree, name)
        records = (
            NO_VELOCITY
            if experiment.is_forced
            else records_of(experiment, free_stiffness=free_stiffness)
        )
        if isinstance(records, str):
            raise FileError(f"{name}: no rate-and-state law can be fitted: {records}")
        found = sample_laws(
            records[0], laws=laws, samples=samples, seed=seed, progress=progress, stop=stop
        )
        limitation = records[0].limitation
        return _build_tree(found, experiment, limitation, seed)


def _build_tree(
    found: Sequence[RatePosterior], experiment: Experiment, limitation: str, seed: int
) -> DataTree:
    """Posteriors of the laws of one record as a tree."""
    import xarray as xr

    source = experiment.tree.attrs
    force_name, unit = experiment.apparatus.force_name, experiment.apparatus.force_unit
    points = found[0].fit.law.points
    time = ("time", points.time + points.start, {"units": "s", "long_name": "time"})
    force = {"units": unit, "long_name": "mean force along the drive over the samples of a point"}
    rng = np.random.default_rng([seed, len(LAWS)])
    origin = Origin(source.get("title"), source.get("configuration", ""))
    attributes = program_attributes(origin, "rates") | {
        "seed": seed,
        "complete": "true",
        "laws": "\n".join(one.fit.law.name for one in found),
        "notes": "\n".join(_notes(found[0], limitation, unit)),
        "reference_velocity": points.reference_velocity,
        **({"origin": "measured"} if experiment.is_measured else {}),
    }
    groups = {
        "/": xr.Dataset(attrs=attributes),
        "/observed_data": xr.Dataset(
            {
                force_name: ("time", points.force, force),
                "drive_displacement": (
                    "time",
                    points.load_displacement,
                    {"units": "m", "long_name": "displacement of the load point"},
                ),
            },
            {"time": time},
            {"title": experiment.name},
        ),
    }
    for number, one in enumerate(found):
        after, prior, values = suffix(number), one.prior, one.values
        law = {"law": one.fit.law.name, "verdict": one.fit.verdict}
        attributes_of = {
            each.key: {
                "units": with_force_unit(cf_units(each.unit), unit),
                "long_name": NAMES[each.key][1],
            }
            for each in prior.free
        }
        from_prior = prior.values(rng.random((1, PRIOR_DRAWS, len(prior))))
        predicted = one.predicted(min(PREDICTIONS, len(one.draws)), rng)
        groups |= {
            f"/posterior{after}": draws_group(values, attributes_of).assign_attrs(law),
            f"/prior{after}": draws_group(from_prior, attributes_of).assign_attrs(law),
            f"/posterior_predictive{after}": xr.Dataset(
                {force_name: (("chain", "draw", "time"), predicted[None], force)},
                {"chain": [0], "draw": np.arange(len(predicted)), "time": time},
                law,
            ),
            f"/parameters{after}": _parameters(one, unit).assign_attrs(
                law
                | {
                    "assessment": assessment(one.fit, is_preferred=one.is_preferred),
                    "warnings": "\n".join(_warnings(one)),
                }
            ),
        }
    return xr.DataTree.from_dict(groups)


def _notes(one: RatePosterior, limitation: str, unit: str) -> list[str]:
    """Sentences on known quantities, and on the prior."""
    notes = [limitation] if limitation else []
    stiffness = one.fit.law.stiffness
    if math.isfinite(stiffness):
        known = with_unit(stiffness, from_cf_units(with_force_unit("N m-1", unit)))
        notes.append(f"the stiffness is known: {known}")
    if one.fit.law.states == 2:
        notes.append("the two state variables are in the order of the least squares")
    notes.append(
        "priors are independent: uniform, or uniform in the logarithm; residuals are normal, and "
        "their noise, white and correlated over time, is sampled too"
    )
    return notes


def _warnings(one: RatePosterior) -> list[str]:
    """Warnings about the draws of a law; a noise that is all white lies at the end of its range."""
    count = len(one.prior) - len(NOISE)
    law = Prior(one.prior.free[:count])
    found = list(draw_warnings(law, one.draws[:, :count], ""))
    worst = float(np.max(r_hat(one.chains)))
    if worst > MAX_R_HAT:
        found.append(f"the chains do not agree (R-hat {worst:.2f}): more samples are needed")
    for name, (symbol, _) in NAMES.items():
        found = [text.replace(f"{name} ", f"{symbol} ") for text in found]
    return found


def _parameters(one: RatePosterior, unit: str) -> Dataset:
    """The table of a law: its parameters, with a - b after those of the states, and the noise."""
    import xarray as xr

    fit, prior = one.fit, one.prior
    values = one.values.reshape(one.draws.shape)
    columns = dict(zip(prior.keys, values.T, strict=True))
    rate = columns["a"] - columns["b"] - columns.get("b2", 0.0)
    place = prior.keys.index("stiffness" if "stiffness" in prior.keys else NOISE[0])
    names = [*prior.keys[:place], "a_minus_b", *prior.keys[place:]]
    known = {each.key: each for each in prior.free}
    noise = dict(zip(NOISE, one.noise_by_squares, strict=True))
    shrunk = dict(zip(prior.keys, shrinkage(one.draws), strict=True))
    rhat = dict(zip(prior.keys, r_hat(one.chains), strict=True))

    def of_prior(attribute: str) -> list[float]:
        return [float(getattr(known.get(name), attribute, math.nan)) for name in names]

    percentiles = [np.percentile(columns.get(name, rate), PERCENTILES) for name in names]
    units = [known[name].unit if name in known else "N" for name in names]
    table = {
        "units": [with_force_unit(cf_units(one), unit) for one in units],
        "least_squares": [noise[name] if name in noise else fit.value(name) for name in names],
        "least_squares_error": [math.nan if name in noise else fit.error(name) for name in names],
        "low": of_prior("low"),
        "high": of_prior("high"),
        "is_logarithmic": [int(name in known and known[name].is_logarithmic) for name in names],
        "shrinkage": [shrunk.get(name, math.nan) for name in names],
        "r_hat": [rhat.get(name, math.nan) for name in names],
    }
    return xr.Dataset(
        {"value": (("parameter", "percentile"), percentiles)}
        | {name: ("parameter", one) for name, one in table.items()},
        {"parameter": names, "percentile": list(PERCENTILES)},
    )


def law_groups(tree: DataTree) -> list[Dataset]:
    """The groups ``parameters`` of a posterior, one for each law."""
    count = len(str(tree.attrs["laws"]).split("\n"))
    return [tree[f"parameters{suffix(number)}"].to_dataset() for number in range(count)]


def rows_of_posterior(tree: DataTree) -> list[dict[str, Any]]:
    """The table of a posterior in SI, a row for each parameter of each law."""
    rows = []
    for data in law_groups(tree):
        for index, name in enumerate(map(str, data["parameter"].values)):
            one = data.isel(parameter=index)
            is_sampled = math.isfinite(one["low"].item())
            form = ("uniform", "logarithmic")[int(one["is_logarithmic"].item())]
            rows.append(
                {
                    "law": data.attrs["law"],
                    "parameter": name,
                    "unit": str(one["units"].item()),
                    "least_squares": one["least_squares"].item(),
                    "least_squares_error": one["least_squares_error"].item(),
                    **dict(zip(QUANTILES, one["value"].values.tolist(), strict=True)),
                    "prior": form if is_sampled else "",
                    "prior_from": one["low"].item(),
                    "prior_to": one["high"].item(),
                    "r_hat": one["r_hat"].item(),
                    "verdict": data.attrs["verdict"],
                }
            )
    return rows


def rate_table(tree: DataTree) -> PrintedTable:
    """The table of a posterior; each line says whether its law describes the record."""
    head = ("law", "parameter", "least squares", "median", "90 % interval", "prior", "verdict")
    rows = tuple(_cells(row) for row in rows_of_posterior(tree))
    return PrintedTable("Rates and states by posterior", head, rows)


def _cells(row: dict[str, Any]) -> tuple[str, ...]:
    unit = from_cf_units(row["unit"])
    low, _, middle, _, high = (row[name] for name in QUANTILES)
    shown = column((low, middle, high), unit, interval_digits(low, high))
    size = shown.scale.size
    least = "-"
    if math.isfinite(row["least_squares"]):
        least = with_error(row["least_squares"] / size, row["least_squares_error"] / size)
    prior = "-"
    if row["prior"]:
        ends = (with_unit(row[name], unit, 2) for name in ("prior_from", "prior_to"))
        prior = f"{row['prior']}, {' to '.join(ends)}"
    return (
        row["law"],
        shown.head(NAMES[row["parameter"]][0]),
        least,
        shown.text(middle),
        f"{shown.text(low)} to {shown.text(high)}",
        prior,
        row["verdict"],
    )


def remarks(tree: DataTree) -> dict[str, list[str]]:
    """Assessments of the laws, warnings about their draws, and notes, a sentence each."""
    found: dict[str, list[str]] = {"assessments": [], "warnings": []}
    for data in law_groups(tree):
        name, comma, states = str(data.attrs["law"]).partition(",")
        law = f"{name} law{comma}{states}"
        found["assessments"].append(f"{law}: {data.attrs['assessment']}")
        texts = str(data.attrs["warnings"]).split("\n")
        found["warnings"] += [f"{law}: {one}" for one in texts if one]
    return found | {"notes": str(tree.attrs["notes"]).split("\n")}


def write_csv(tree: DataTree, path: Path) -> None:
    """Write the table of a posterior in SI; the unit of a value is in its row."""
    rows = rows_of_posterior(tree)
    blank = [{key: None if one != one else one for key, one in row.items()} for row in rows]
    units = {
        name: "1" if isinstance(value, str) or name == "r_hat" else "see unit"
        for name, value in rows[0].items()
    }
    write_table(blank, units, path)
