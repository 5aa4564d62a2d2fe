"""Predictions of traces that were not in a fit, and comparison of fits by their predictions."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mesoslip.array_types import Array, DataTree
from mesoslip.configuration import arguments
from mesoslip.configuration.config import Config
from mesoslip.configuration.keys import key_kind
from mesoslip.errors import FileError, shown
from mesoslip.execution.executors import ExecutorLike
from mesoslip.execution.stop import StopRequest
from mesoslip.inference.apparatus import of_predicted, predicted_sentences
from mesoslip.inference.checks import compare
from mesoslip.inference.fit import predict_traces, usable_summaries
from mesoslip.inference.fit_plan import LEVELS, MIN_PREDICTIONS, Plan
from mesoslip.inference.posterior import summaries_group, trace_groups
from mesoslip.inference.prior import LEVEL, WANDER, FreeParameter, Prior, level_parameter
from mesoslip.inference.simulations import Simulations, Simulator
from mesoslip.inference.traced_experiment import prepare
from mesoslip.output.inputs import OutputLike, as_run, open_output, trace_name

# Number of predicted traces.
PREDICTIONS = 60
# Maximum number of directions in which predictions are compared, and predictions for each.
MAX_DIRECTIONS = 10
PREDICTIONS_PER_DIRECTION = 12
# Degrees of freedom of the predictive distribution, and weight of the diagonal of its covariance.
FREEDOM = 5.0
RIDGE = 0.05
# Maximum deviation of a summary, in spreads of all predictions.
MAX_DEVIATION = 30.0
# Resamplings of the predictions for the error of a score.
RESAMPLINGS = 200


@arguments.checked(
    after=arguments.number(),
    predictions=arguments.whole(MIN_PREDICTIONS),
    progress=arguments.function,
)
def predict(
    posterior: OutputLike,
    output: OutputLike,
    *,
    after: float = 0.0,
    predictions: int = PREDICTIONS,
    executor: ExecutorLike = None,
    progress: Callable[[float], None] | None = None,
    stop: StopRequest | None = None,
) -> DataTree:
    """Predict a trace by the posterior of other traces of the same interface.

    Parameters
    ----------
    posterior
        Result of `fit`, or its file.
    output
        Output with the trace. Its drive and spring are those that it was recorded with, as far as
        they are known, or those of the fit. A free one is in the ratio of what this trace and the
        fitted one declare; if the fitted one declares nothing, it is what this trace declares.
    after
        Time from which the trace is used [s].
    predictions
        Number of predicted traces, at least 50. The probability is at least the inverse of one
        more.
    executor, progress, stop
        See `fit`.

    Returns
    -------
    xarray.DataTree
        The posterior, with the groups of the predicted trace instead of those of the fitted traces.
        Attribute ``agreement_probability`` is the fraction of predictions that deviate from the
        others at least as much as the trace.

    Raises
    ------
    FileError, ConfigError
        If a file is no posterior, or the trace cannot be predicted.

    Examples
    --------
    >>> import mesoslip
    >>> predicted = mesoslip.predict("out/a.posterior.nc", "out/b.nc")  # doctest: +SKIP
    """
    import xarray as xr

    fitted = as_posterior(posterior)
    trace = as_run(output)
    prior = prior_of(fitted)
    config = Config.from_toml(fitted.attrs["configuration"])
    seed = int(fitted.attrs["seed"])
    rng = np.random.default_rng([seed, 4])
    draws = fitted["posterior"].to_dataset()
    values = np.stack([draws[key].values.ravel() for key in prior.keys], axis=-1)
    points = np.clip(prior.unit(values[rng.choice(len(values), predictions, replace=False)]), 0, 1)
    prior, points = _with_own_level(prior, points, rng)
    plan = Plan(
        config,
        prior,
        after=after,
        seed=seed,
        level_of=str(fitted.attrs.get("level_of", LEVELS[0])),
        filter_time=float(fitted.attrs.get("filter_time", 0.0)),
    )
    plan = replace(plan, has_several=True)
    experiment = prepare(trace, plan, trace_name(output, trace))
    if WANDER in prior.keys:
        experiment = replace(experiment, wander_length=float(fitted.attrs["wander_length"]))
    own = of_predicted(experiment.apparatus.declared, _declared_in(fitted), prior.keys)
    experiment = replace(experiment, apparatus=own)
    simulator = Simulator((experiment,), prior, seed)
    observed, left_out = usable_summaries(simulator)
    simulations = Simulations(
        simulator, expected=predictions, executor=executor, progress=progress, stop=stop
    )
    predicted, traces = predict_traces(simulations, points)
    used = np.where(left_out, np.nan, predicted)
    agreement = compare(simulator.features, None, used, np.where(left_out, np.nan, observed))
    kept = {f"/{name}": fitted[name].to_dataset() for name in ("posterior", "prior", "parameters")}
    attributes = fitted.attrs | {
        "title": f"Prediction of {experiment.name}",
        "noise": experiment.noise.deviation,
        "setup_period": experiment.summarizer.period,
        "agreement_probability": agreement.probability,
        "disagreeing": "\n".join(agreement.disagreeing),
        "traces": experiment.name,
        "predicted": "true",
        "notes": "\n".join(
            ["prediction of a trace that was not in the fit", *predicted_sentences(own)]
        ),
        "warnings": "In the model " + "; ".join(agreement.sentences)
        if agreement.is_rejected
        else "",
    }
    return xr.DataTree.from_dict(
        {
            "/": xr.Dataset(attrs=attributes),
            **kept,
            "/summaries": summaries_group(
                simulator.features, observed, predicted, agreement.scores, left_out
            ),
            **trace_groups(traces[0], 0),
        }
    )


def as_posterior(posterior: OutputLike) -> DataTree:
    """A result of `fit`, open or from its file."""
    import xarray as xr

    tree = posterior if isinstance(posterior, xr.DataTree) else open_output(posterior)
    if "summaries" not in tree.children:
        raise FileError(f"{shown(posterior)}: is not the result of a fit")
    return tree


def prior_of(posterior: DataTree) -> Prior:
    """The free parameters of a fit."""
    data = posterior["parameters"].to_dataset()
    found = []
    for index, key in enumerate(data["parameter"].values.tolist()):
        one = data.isel(parameter=index)
        kind = key_kind(key)
        found.append(
            FreeParameter(
                key,
                one["low"].item(),
                one["high"].item(),
                bool(one["is_logarithmic"].item()),
                str(one["units"].item()),
                kind is not None and kind.is_whole,
                one["width"].item() if "width" in data else 0.0,
            )
        )
    return Prior(tuple(found))


def _with_own_level(prior: Prior, points: Array, rng: np.random.Generator) -> tuple[Prior, Array]:
    """The prior and points on its unit cube, with a level from its prior instead of those of the
    fitted traces: the level of another trace is unknown."""
    is_level = np.array([one.key.startswith(LEVEL) for one in prior.free])
    if not is_level.any():
        return prior, points
    width = next(one.width for one in prior.free if one.key.startswith(LEVEL))
    free = [one for one in prior.free if not one.key.startswith(LEVEL)]
    own = rng.random((len(points), 1))
    return (
        Prior((level_parameter(width, f"{LEVEL}.1"), *free)),
        np.concatenate([own, points[:, ~is_level]], axis=1),
    )


def _declared_in(posterior: DataTree) -> dict[str, float]:
    """The values of free keys that the first trace of a fit declares."""
    data = posterior["parameters"].to_dataset()
    if "declared" not in data:
        return {}
    pairs = zip(data["parameter"].values.tolist(), data["declared"].values.tolist(), strict=True)
    return {key: value for key, value in pairs if math.isfinite(value)}


@dataclass(frozen=True)
class Score:
    """Predictive score of a fit."""

    log_density: float
    """Logarithm of the predictive density of the summaries of the traces, up to a constant that the
    compared fits have in common."""
    difference: float
    """The score of the best fit minus this one."""
    error: float
    """Standard error of the difference, by the number of predictions."""


@arguments.checked(
    posteriors=arguments.instance((list, tuple), "a list of results of fit or predict")
)
def compare_fits(posteriors: Sequence[OutputLike]) -> list[Score]:
    """Compare fits of the same traces by how probable their predictions make the traces.

    The score is the logarithm of the predictive density of the summaries, in the directions in
    which the predictions of all fits vary most, with t distributions of the means and covariances
    of the predictions of each fit. Of results of `predict` it is that of traces that were not
    fitted: a fit with more parameters gains nothing by them unless its predictions improve
    (Vehtari, Gelman & Gabry 2017, Stat. Comput. 27, 1413).

    Parameters
    ----------
    posteriors
        Results of `fit` or `predict` of the same traces, or their files.

    Returns
    -------
    list of Score
        One for each.

    Raises
    ------
    FileError
        If there are fewer than two, or they are of different traces.

    Examples
    --------
    >>> import mesoslip
    >>> scores = mesoslip.compare_fits(["out/a.nc", "out/b.nc"])  # doctest: +SKIP
    """
    trees = [as_posterior(one) for one in posteriors]
    if len(trees) < 2:
        raise FileError("a comparison needs two fits or more")
    groups = [tree["summaries"].to_dataset() for tree in trees]
    first = groups[0]
    for one in groups[1:]:
        is_same = one.sizes["summary"] == first.sizes["summary"] and np.allclose(
            one["observed"].values, first["observed"].values, rtol=1e-6, equal_nan=True
        )
        if not is_same:
            raise FileError("the fits are of different traces, or of different parts of them")
    observed = first["observed"].values
    used = np.isfinite(observed)
    for one in groups:
        used &= np.isfinite(one["drawn"].values).mean(axis=0) > 0.5
        used &= one["left_out"].values == 0
    if not used.any():
        raise FileError("the predictions have no summaries of the traces in common")
    drawn = [_filled(one["drawn"].values[:, used]) for one in groups]
    observed = observed[used]
    drawn, observed = _standardized(drawn, observed)
    directions = _directions(drawn, observed)
    drawn = [one @ directions.T for one in drawn]
    target = directions @ observed
    rng = np.random.default_rng(1)
    scores = np.array([_log_density(one, target) for one in drawn])
    resampled = np.array(
        [
            [_log_density(one[rng.integers(len(one), size=len(one))], target) for one in drawn]
            for _ in range(RESAMPLINGS)
        ]
    )
    best = int(np.argmax(scores))
    errors = np.std(resampled[:, [best]] - resampled, axis=0)
    return [
        Score(float(score), float(scores[best] - score), float(error))
        for score, error in zip(scores, errors, strict=True)
    ]


def _filled(drawn: Array) -> Array:
    """Predictions with the median in place of summaries that are not defined."""
    return np.where(np.isfinite(drawn), drawn, np.nanmedian(drawn, axis=0))


def _standardized(drawn: Sequence[Array], observed: Array) -> tuple[list[Array], Array]:
    """Summaries in spreads of all predictions."""
    pooled = np.concatenate(drawn)
    centre = np.median(pooled, axis=0)
    low, high = np.percentile(pooled, [16, 84], axis=0)
    spread = np.maximum((high - low) / 2, 1e-9 * (1 + np.abs(centre)))
    found = [
        np.clip((one - centre) / spread, -MAX_DEVIATION, MAX_DEVIATION)
        for one in (*drawn, observed)
    ]
    return found[:-1], found[-1]


def _directions(drawn: Sequence[Array], observed: Array) -> Array:
    """The directions in which all predictions vary most, shape (directions, summaries)."""
    count = min(len(one) for one in drawn)
    size = max(1, min(MAX_DIRECTIONS, count // PREDICTIONS_PER_DIRECTION, len(observed)))
    return np.asarray(np.linalg.svd(np.concatenate(drawn), full_matrices=False)[2][:size])


def _log_density(points: Array, target: Array) -> float:
    """Logarithm of the density of a t distribution with the moments of points at a target."""
    size = len(target)
    covariance = np.cov(points.T).reshape(size, size)
    covariance += RIDGE * np.diag(np.diag(covariance)) + 1e-9 * np.eye(size)
    away = target - points.mean(axis=0)
    distance = float(away @ np.linalg.solve(covariance, away)) * FREEDOM / (FREEDOM - 2)
    log_size = float(np.linalg.slogdet(covariance)[1])
    return -0.5 * (FREEDOM + size) * math.log1p(distance / FREEDOM) - 0.5 * log_size
