"""The posterior of a fit as a tree that ArviZ opens, and as a table."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from mesoslip.analysis.sampled_slips import FoundSlips
from mesoslip.configuration.units import cf_units
from mesoslip.inference.checks import DETERMINED, UNDETERMINED, shrinkage, warnings
from mesoslip.inference.fit import FitResult
from mesoslip.inference.sampler import r_hat
from mesoslip.output import variables
from mesoslip.output.provenance import program_attributes

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]

PERCENTILES = (5.0, 25.0, 50.0, 75.0, 95.0)
VERDICTS = ("not determined", "narrowed", "determined")
SLIP_COLUMNS = ("start_time", "end_time", "force_before", "force_after")
# Minimum significant digits of values in a table.
MIN_DIGITS = 3


@dataclass(frozen=True)
class Row:
    """A parameter in the table of a fit, in SI.

    Attributes
    ----------
    key, unit
        Dotted key and SI unit.
    percentiles
        `PERCENTILES` of the posterior.
    low, high
        Ends of the range.
    shrinkage
        Shrinkage from prior to posterior, 0 to 1.
    verdict
        One of `VERDICTS`.
    most_informative
        The group of summaries with the most information on it; "none" if it is not determined.
    """

    key: str
    unit: str
    percentiles: tuple[float, ...]
    low: float
    high: float
    shrinkage: float
    verdict: str
    most_informative: str

    @property
    def digits(self) -> int:
        """Significant digits that distinguish the ends of the 90 % interval."""
        low, high = self.percentiles[0], self.percentiles[-1]
        size = max(abs(low), abs(high))
        if size == 0 or high <= low:
            return MIN_DIGITS
        return max(MIN_DIGITS, 2 + math.ceil(math.log10(size / (high - low))))


def build_tree(fitted: FitResult) -> xr.DataTree:
    """A posterior as a tree.

    Groups ``posterior`` (dimensions chain, draw), ``prior``, ``observed_data``,
    ``posterior_predictive``, named as in ArviZ; ``observed_slips``, ``predicted_slips`` (slip);
    ``summaries`` (summary) of the trace and the predictions; ``parameters`` (parameter), the
    table.
    """
    import xarray as xr

    plan, estimate = fitted.plan, fitted.estimate
    prior = plan.prior
    values = prior.values(estimate.chains)
    chains = {"chain": np.arange(len(values)), "draw": np.arange(values.shape[1])}

    def group(draws: Array, coordinates: dict[str, NDArray[np.int_]]) -> xr.Dataset:
        return xr.Dataset(
            {
                one.key: (
                    ("chain", "draw"),
                    draws[..., index],
                    {"units": cf_units(one.unit), "long_name": one.key},
                )
                for index, one in enumerate(prior.free)
            },
            coordinates,
        )

    rng = np.random.default_rng([plan.seed, 2])
    from_prior = prior.values(rng.random((1, 1000, len(prior))))
    kept = fitted.time[:: fitted.stride] + plan.after
    force = {"units": "N", "long_name": "force of the drive on the slider"}
    time = ("time", fitted.time + plan.after, {"units": "s", "long_name": "time"})
    predictions = len(fitted.predicted_force)
    notes = list(warnings(prior, estimate.draws, fitted.agreement, r_hat(estimate.chains)))
    attributes: dict[str, Any] = {
        "seed": plan.seed,
        "complete": "true",
        "comment": "",
        "noise": fitted.simulator.noise,
        "setup_period": fitted.simulator.summarizer.period,
        "simulation_count": fitted.simulations,
        "local_simulation_count": len(estimate.parameters),
        "agreement_probability": fitted.agreement.probability,
        "coverage_50": estimate.coverage[0],
        "coverage_90": estimate.coverage[1],
        "warnings": "\n".join(notes),
    }
    return xr.DataTree.from_dict(
        {
            "/": xr.Dataset(attrs=program_attributes(plan.config, "fit") | attributes),
            "/posterior": group(values, chains),
            "/prior": group(from_prior, {"chain": np.arange(1), "draw": np.arange(1000)}),
            "/observed_data": xr.Dataset(
                {"spring_force": (("time",), fitted.force, force)}, {"time": time}
            ),
            "/posterior_predictive": xr.Dataset(
                {"spring_force": (("chain", "draw", "time"), fitted.predicted_force[None], force)},
                {
                    "chain": np.arange(1),
                    "draw": np.arange(predictions),
                    "time": ("time", kept, time[2]),
                },
            ),
            "/observed_slips": _slips([fitted.observed_slips], plan.after),
            "/predicted_slips": _slips(fitted.predicted_slips, plan.after),
            "/summaries": _summaries(fitted),
            "/parameters": _parameters(fitted),
        }
    )


def _slips(found: Sequence[FoundSlips], start: float) -> xr.Dataset:
    import xarray as xr

    owner = np.repeat(np.arange(len(found)), [len(one) for one in found])
    columns = {name: np.concatenate([getattr(one, name) for one in found]) for name in SLIP_COLUMNS}
    for name in ("start_time", "end_time"):
        columns[name] = columns[name] + start
    data = {
        name: variables.SLIPS.variable(name, ("slip",), values) for name, values in columns.items()
    }
    data["trace"] = xr.Variable("slip", owner, {"units": "1", "long_name": "number of the trace"})
    return xr.Dataset(data)


def _summaries(fitted: FitResult) -> xr.Dataset:
    import xarray as xr

    features = fitted.simulator.summarizer.features
    low, middle, high = np.full((3, len(features)), np.nan)
    defined = np.isfinite(fitted.predicted).any(axis=0)
    low[defined], middle[defined], high[defined] = np.nanpercentile(
        fitted.predicted[:, defined], [5, 50, 95], axis=0
    )
    one = {"units": "1"}
    return xr.Dataset(
        {
            "observed": ("summary", fitted.observed, one | {"long_name": "summary of the trace"}),
            "predicted_05": (
                "summary",
                low,
                one | {"long_name": "5 % quantile of the predictions"},
            ),
            "predicted_50": ("summary", middle, one | {"long_name": "median of the predictions"}),
            "predicted_95": (
                "summary",
                high,
                one | {"long_name": "95 % quantile of the predictions"},
            ),
            "score": (
                "summary",
                fitted.agreement.scores,
                one | {"long_name": "deviation of the trace, in spreads of the predictions"},
            ),
            "group": ("summary", [feature.group for feature in features]),
            "meaning": ("summary", [feature.meaning for feature in features]),
        },
        {"summary": [feature.name for feature in features]},
    )


def _parameters(fitted: FitResult) -> xr.Dataset:
    import xarray as xr

    prior, draws = fitted.plan.prior, fitted.estimate.draws
    groups = list(fitted.information)
    percentiles = np.percentile(prior.values(draws), PERCENTILES, axis=0).T
    return xr.Dataset(
        {
            "value": (("parameter", "percentile"), percentiles),
            "units": ("parameter", [one.unit for one in prior.free]),
            "low": ("parameter", [one.low for one in prior.free]),
            "high": ("parameter", [one.high for one in prior.free]),
            "is_logarithmic": ("parameter", [int(one.is_logarithmic) for one in prior.free]),
            "shrinkage": ("parameter", shrinkage(draws)),
            "information": (
                ("parameter", "feature_group"),
                np.array([fitted.information[one] for one in groups]).T,
                {"long_name": "fraction of the variance predicted by a group of summaries alone"},
            ),
        },
        {
            "parameter": list(prior.keys),
            "percentile": list(PERCENTILES),
            "feature_group": groups,
        },
    )


def table(tree: xr.DataTree) -> list[Row]:
    """The table of a fit, a row for each parameter."""
    data = tree["parameters"].to_dataset()
    rows = []
    for index, key in enumerate(data["parameter"].values.tolist()):
        one = data.isel(parameter=index)
        part = one["shrinkage"].item()
        verdict = VERDICTS[int(part >= UNDETERMINED) + int(part >= DETERMINED)]
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
                str(data["feature_group"].values[best]) if part >= UNDETERMINED else "none",
            )
        )
    return rows
