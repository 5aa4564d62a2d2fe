"""The posterior of a fit as a tree that ArviZ opens, and as a table."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mesoslip.analysis.sampled_slips import FoundSlips
from mesoslip.array_types import Array, Dataset, DataTree
from mesoslip.configuration.units import cf_units
from mesoslip.inference import apparatus
from mesoslip.inference.checks import DETERMINED, UNDETERMINED, needed_groups, shrinkage, warnings
from mesoslip.inference.features import Feature
from mesoslip.inference.fit import FitResult, Prediction
from mesoslip.inference.prior import WANDER
from mesoslip.inference.sampler import r_hat
from mesoslip.output.provenance import program_attributes
from mesoslip.output.variables import SLIPS, Group, Meaning
from mesoslip.quantities import with_unit

# Numbers of each summary of a trace.
SUMMARIES = Group(
    observed=Meaning("1", "summary of the trace"),
    predicted_05=Meaning("1", "5 % quantile of the predictions"),
    predicted_50=Meaning("1", "median of the predictions"),
    predicted_95=Meaning("1", "95 % quantile of the predictions"),
    score=Meaning("1", "deviation of the trace, in spreads of the predictions"),
    drawn=Meaning("1", "summaries of predicted traces"),
    left_out=Meaning("1", "1 for summaries that are left out, as noise dominates them", np.int8),
    trace=Meaning("1", "number of the trace", np.int64),
    factor=Meaning("1", "factor of the quantity, in SI"),
)
PERCENTILES: tuple[float, ...] = (5.0, 25.0, 50.0, 75.0, 95.0)
VERDICTS = ("not determined", "narrowed", "determined")
SLIP_COLUMNS = ("start_time", "end_time", "force_before", "force_after")
# Meanings of columns of the table.
MEANINGS = {
    "declared": "value that the first trace declares, in SI",
    "width": "standard deviation of the logarithm, of a normal prior",
    "information": "fraction of the variance predicted by a group of summaries alone",
}
# Minimum significant digits of values in a table.
MIN_DIGITS = 3


@dataclass(frozen=True)
class Row:
    """A parameter in the table of a fit, in SI."""

    key: str
    unit: str
    percentiles: tuple[float, ...]
    """`PERCENTILES` of the posterior."""
    low: float
    high: float
    """End of the range, as ``low``."""
    shrinkage: float
    """Shrinkage from prior to posterior, 0 to 1."""
    verdict: str
    """One of `VERDICTS`."""
    most_informative: str
    """The group of summaries with the most information on it; "none" if it is not determined."""
    follows_from: str = ""
    """That group and others with nearly as much information; "none" if it is not determined."""

    @property
    def digits(self) -> int:
        """Significant digits that distinguish the ends of the 90 % interval."""
        return interval_digits(self.percentiles[0], self.percentiles[-1])


def interval_digits(low: float, high: float) -> int:
    """Significant digits that distinguish the ends of an interval."""
    size = max(abs(low), abs(high))
    if size == 0 or high <= low:
        return MIN_DIGITS
    return max(MIN_DIGITS, 2 + math.ceil(math.log10(size / (high - low))))


def build_tree(fitted: FitResult) -> DataTree:
    """A posterior as a tree.

    Groups ``posterior`` (dimensions chain, draw), ``prior``, ``observed_data``,
    ``posterior_predictive``, named as in ArviZ; ``observed_slips``, ``predicted_slips`` (slip);
    ``summaries`` (summary) of the trace and the predictions; ``parameters`` (parameter), the
    table. The names of groups of other traces end in ``_2``, ``_3``.
    """
    import xarray as xr

    plan, estimate = fitted.plan, fitted.estimate
    prior = plan.prior
    values = prior.values(estimate.chains)
    attributes_of = {
        one.key: {"units": cf_units(one.unit), "long_name": one.key} for one in prior.free
    }
    rng = np.random.default_rng([plan.seed, 2])
    from_prior = prior.values(rng.random((1, 1000, len(prior))))
    needs = needed_groups(prior, fitted.information)
    notes = warnings(prior, estimate.draws, fitted.agreement, r_hat(estimate.chains), needs)
    first = fitted.predictions[0].experiment
    names = [one.experiment.name for one in fitted.predictions]
    attributes: dict[str, Any] = {
        "title": plan.config.title or f"Fit of {', '.join(names)}",
        "seed": plan.seed,
        "complete": "true",
        "noise": first.noise.deviation,
        "setup_period": first.summarizer.period,
        "simulation_count": fitted.simulations,
        "local_simulation_count": len(estimate.parameters),
        "agreement_probability": fitted.agreement.probability,
        "disagreeing": "\n".join(fitted.agreement.disagreeing),
        "coverage_50": estimate.coverage[0],
        "coverage_90": estimate.coverage[1],
        "traces": "\n".join(names),
        "warnings": "\n".join(notes),
        "notes": "\n".join(_notes(fitted)),
    }
    if WANDER in prior.keys:
        attributes["wander_length"] = first.wander_length
    if plan.level_width:
        attributes["level_of"] = plan.level_of
    if plan.filter_time:
        attributes["filter_time"] = plan.filter_time
    groups = {
        "/": xr.Dataset(attrs=program_attributes(plan.config, "fit") | attributes),
        "/posterior": draws_group(values, attributes_of),
        "/prior": draws_group(from_prior, attributes_of),
        "/summaries": summaries_group(
            fitted.simulator.features,
            fitted.observed,
            fitted.predicted,
            fitted.agreement.scores,
            fitted.left_out,
        ),
        "/parameters": _parameters(fitted, needs),
    }
    for number, one in enumerate(fitted.predictions):
        groups |= trace_groups(one, number)
    return xr.DataTree.from_dict(groups)


def draws_group(values: Array, attributes: Mapping[str, Mapping[str, str]]) -> Dataset:
    """Draws in SI, of shape (chains, draws, parameters), as variables with attributes by name."""
    import xarray as xr

    return xr.Dataset(
        {
            name: (("chain", "draw"), values[..., index], one)
            for index, (name, one) in enumerate(attributes.items())
        },
        {"chain": np.arange(len(values)), "draw": np.arange(values.shape[1])},
    )


def suffix(number: int) -> str:
    """Suffix of the groups of a trace: none for the first one."""
    return f"_{number + 1}" if number else ""


def trace_groups(prediction: Prediction, number: int) -> dict[str, Dataset]:
    """Groups of a trace and its predictions, by its number."""
    import xarray as xr

    experiment = prediction.experiment
    start = experiment.sampling.start
    times = experiment.summarizer.time + start
    force = {"units": "N", "long_name": "force of the drive on the slider"}
    time = ("time", times, {"units": "s", "long_name": "time"})
    kept = ("time", times[:: prediction.stride], time[2])
    count = len(prediction.force)
    after = suffix(number)
    attributes = {"title": experiment.name, "noise": experiment.noise.deviation}
    return {
        f"/observed_data{after}": xr.Dataset(
            {"spring_force": (("time",), experiment.force, force)}, {"time": time}, attributes
        ),
        f"/posterior_predictive{after}": xr.Dataset(
            {"spring_force": (("chain", "draw", "time"), prediction.force[None], force)},
            {"chain": np.arange(1), "draw": np.arange(count), "time": kept},
        ),
        f"/observed_slips{after}": _slips([prediction.observed_slips], start),
        f"/predicted_slips{after}": _slips(prediction.slips, start),
    }


def _notes(fitted: FitResult) -> Iterator[str]:
    """Sentences on assumptions, corrections, and summaries that are left out."""
    yield from fitted.plan.assumed
    experiments = fitted.simulator.experiments
    names = [one.name for one in experiments]
    yield from apparatus.sentences(names, [one.apparatus for one in experiments])
    for prediction in fitted.predictions:
        one = prediction.experiment
        name = f"{one.name}: " if one.name else ""
        yield from (f"{name}{correction}" for correction in one.corrections)
        if one.needs_run_in:
            yield (
                f"{name}the trace begins under force: simulations run in before it "
                f"({with_unit(one.run_in, 's', 2)} for the known parameters), and its start is not "
                "used"
            )
        if one.sampling.block > 1:
            yield f"{name}means of {one.sampling.block} samples are used"
        if not one.sampling.is_even:
            yield f"{name}samples at unequal distances are interpolated, of simulations too"
    if fitted.simulator.coarse_count:
        yield (
            f"most simulations have {fitted.simulator.coarse_count} contacts; mean and scatter of "
            f"their summaries are corrected by simulations with {fitted.plan.config.contacts.count}"
        )
    features = [
        one
        for one, is_out in zip(fitted.simulator.features, fitted.left_out, strict=True)
        if is_out
    ]
    if features:
        named = [one.label or one.meaning for one in features]
        several = len(fitted.predictions) > 1
        if several:
            titles = [one.experiment.name for one in fitted.predictions]
            named = [
                f"{name} of {titles[one.trace]}" for name, one in zip(named, features, strict=True)
            ]
        yield f"left out, as noise dominates: {', '.join(dict.fromkeys(named))}"
    if needed := fitted.estimate.surrogate.simulations_for_products:
        yield (
            f"the likelihood is learnt from {len(fitted.estimate.parameters)} simulations near the "
            f"posterior, without products of parameters, for which it needs {needed}: intervals "
            "are wider than the traces allow (fit.simulations)"
        )
    if fitted.plan.level_width:
        what = {"contacts": "the forces of all contacts", "record": "the recorded force"}
        yield (
            f"each trace has a level, a factor on {what[fitted.plan.level_of]}: "
            + ", ".join(
                f"{one.instrument.level} of {one.name}" if one.name else one.instrument.level
                for one in experiments
            )
        )
    if keys := fitted.plan.config.contacts.place_keys:
        owner = "all traces are" if fitted.plan.shares_track else "each trace is"
        which = "the same track" if fitted.plan.shares_track else "a track of its own"
        yield f"{owner} taken to have {which} ({', '.join(keys)})"
    elif WANDER not in fitted.plan.prior.keys:
        yield "the strength is taken to be the same along the track (fit.wander = false)"


def _slips(found: Sequence[FoundSlips], start: float) -> Dataset:
    import xarray as xr

    owner = np.repeat(np.arange(len(found)), [len(one) for one in found])
    columns = {name: np.concatenate([getattr(one, name) for one in found]) for name in SLIP_COLUMNS}
    for name in ("start_time", "end_time"):
        columns[name] = columns[name] + start
    data = {name: SLIPS.variable(name, ("slip",), values) for name, values in columns.items()}
    data["trace"] = xr.Variable("slip", owner, {"units": "1", "long_name": "number of the trace"})
    return xr.Dataset(data)


def summaries_group(
    features: Sequence[Feature],
    observed: Array,
    predicted: Array,
    scores: Array,
    left_out: NDArray[np.bool_],
) -> Dataset:
    """The group `SUMMARIES` of traces and of their predictions, shape (traces, summaries)."""
    import xarray as xr

    low, middle, high = np.full((3, len(features)), np.nan)
    defined = np.isfinite(predicted).any(axis=0)
    low[defined], middle[defined], high[defined] = np.nanpercentile(
        predicted[:, defined], [5, 50, 95], axis=0
    )
    numbers: dict[str, Any] = {
        "observed": observed,
        "predicted_05": low,
        "predicted_50": middle,
        "predicted_95": high,
        "score": scores,
        "drawn": predicted,
        "left_out": left_out.astype(np.int8),
        "trace": [one.trace for one in features],
        "factor": [one.factor for one in features],
    }
    texts = {
        name: ("summary", [getattr(one, name) for one in features])
        for name in ("group", "meaning", "label")
    }
    return xr.Dataset(
        {
            **{
                name: SUMMARIES.variable(name, ("prediction", "summary")[-np.ndim(one) :], one)
                for name, one in numbers.items()
            },
            **texts,
        },
        {"summary": [one.name for one in features]},
    )


def _parameters(fitted: FitResult, needs: dict[str, tuple[str, ...]]) -> Dataset:
    import xarray as xr

    prior, draws = fitted.plan.prior, fitted.estimate.draws
    groups = list(fitted.information)
    declared = fitted.simulator.experiments[0].apparatus.declared
    percentiles = np.percentile(prior.values(draws), PERCENTILES, axis=0).T
    information = np.array([fitted.information[one] for one in groups]).T
    columns = {
        "units": [one.unit for one in prior.free],
        "follows_from": ["\n".join(needs[one.key]) for one in prior.free],
        "declared": [declared.get(one.key, math.nan) for one in prior.free],
        "width": [one.width for one in prior.free],
        "low": [one.low for one in prior.free],
        "high": [one.high for one in prior.free],
        "is_logarithmic": [int(one.is_logarithmic) for one in prior.free],
        "shrinkage": shrinkage(draws),
    }
    found = xr.Dataset(
        {"value": (("parameter", "percentile"), percentiles)}
        | {name: ("parameter", one) for name, one in columns.items()}
        | {"information": (("parameter", "feature_group"), information)},
        {"parameter": list(prior.keys), "percentile": list(PERCENTILES), "feature_group": groups},
    )
    for name, meaning in MEANINGS.items():
        found[name].attrs["long_name"] = meaning
    return found


def table(tree: DataTree) -> list[Row]:
    """The table of a fit, a row for each parameter."""
    data = tree["parameters"].to_dataset()
    rows = []
    for index, key in enumerate(data["parameter"].values.tolist()):
        one = data.isel(parameter=index)
        part = one["shrinkage"].item()
        is_known = part >= UNDETERMINED
        verdict = VERDICTS[int(is_known) + int(part >= DETERMINED)]
        best = int(np.argmax(one["information"].values))
        rows.append(
            Row(
                key,
                str(one["units"].item()),
                tuple(one["value"].values.tolist()),
                one["low"].item(),
                one["high"].item(),
                part,
                verdict,
                str(data["feature_group"].values[best]) if is_known else "none",
                ", ".join(str(one["follows_from"].item()).split("\n")) if is_known else "none",
            )
        )
    return rows
