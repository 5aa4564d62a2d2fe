"""What those who measure friction read off a record: steady forces, velocity steps, and holds.

Forces are counted along the drive: positive is against its motion, whichever way that goes.
"""

from __future__ import annotations

import math
import os
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from mesoslip.analysis.experiment import Experiment, Peak, Stage
from mesoslip.analysis.slips import write_table
from mesoslip.analysis.steady_force import SteadyMean
from mesoslip.output.inputs import OutputLike, as_run, several
from mesoslip.output.variables import Group, Meaning

Array = NDArray[np.float64]

# Standard deviations by which a peak must stand out of the steady force before it is one.
OUTSTANDING = 4.0
# Part of the evolution that an overshoot is of at least.
LEAST_OVERSHOOT = 1e-3
# Relaxation displacements after which an evolution is over.
EVOLVED = 8.0
# Most points that a decay is fitted to.
MOST_POINTS = 2000
# Standard errors of an amplitude from which on a decay has a length.
LEAST_AMPLITUDE = 3.0

_OUTPUT = Meaning("1", "which of the outputs, from 0", np.int64)
_STAGE = Meaning("1", "number of the stage of the drive, from 0", np.int64)
_NOTE = Meaning("1", "what is missing, and why", np.str_)

STEADY = Group(
    output_index=_OUTPUT,
    stage_number=_STAGE,
    stage_start_time=Meaning("s", "start of the stage"),
    velocity=Meaning("m s-1", "velocity of the drive"),
    steady_force=Meaning("N", "mean force after the transient, against the drive"),
    steady_force_error=Meaning("N", "its standard error"),
    steady_force_half_width=Meaning("N", "half the width of its 95 % interval"),
    standard_deviation=Meaning("N", "standard deviation of the force about the mean"),
    transient_time=Meaning("s", "length of the transient"),
    sample_count=Meaning("1", "samples after it, of all realizations", np.int64),
    effective_sample_count=Meaning("1", "independent samples that would have this error"),
    slip_share=Meaning("1", "part of the slider's motion that happens in slips"),
    is_steady=Meaning("1", "whether the transient is over, and halves of the rest agree", np.int8),
    is_resolved=Meaning("1", "whether the stage is long enough for its error", np.int8),
    note=_NOTE,
)

STEPS = Group(
    output_index=_OUTPUT,
    stage_number=_STAGE,
    step_time=Meaning("s", "time of the step"),
    velocity_before=Meaning("m s-1", "velocity of the drive before"),
    velocity_after=Meaning("m s-1", "velocity of the drive after"),
    force_before=Meaning("N", "steady force before"),
    force_after=Meaning("N", "steady force after"),
    net_change=Meaning("N", "steady force after minus before, (a - b) ln(V/V0)"),
    net_change_error=Meaning("N", "its standard error"),
    peak_force=Meaning("N", "force from which the evolution starts"),
    peak_is_exact=Meaning("1", "whether it is known from the motion, not from samples", np.int8),
    direct_change=Meaning("N", "that force minus the steady one before, a ln(V/V0)"),
    direct_change_error=Meaning("N", "its standard error"),
    evolving_change=Meaning("N", "steady force after minus that force, -b ln(V/V0)"),
    evolving_change_error=Meaning("N", "its standard error"),
    direct_rate=Meaning("N", "direct change over ln(V/V0), a as it appears"),
    evolving_rate=Meaning("N", "minus evolving change over ln(V/V0), b as it appears"),
    net_rate=Meaning("N", "net change over ln(V/V0), a - b"),
    net_rate_error=Meaning("N", "its standard error"),
    relaxation_displacement=Meaning(
        "m", "length of the exponential decay over the slider's displacement"
    ),
    relaxation_displacement_error=Meaning("m", "its standard error"),
    integral_displacement=Meaning(
        "m", "area between force and steady force, over the evolving change"
    ),
    integral_displacement_error=Meaning("m", "its standard error"),
    overshoot=Meaning("N", "farthest that the force goes past the steady one after the peak"),
    note=_NOTE,
)

HOLDS = Group(
    output_index=_OUTPUT,
    stage_number=_STAGE,
    hold_start_time=Meaning("s", "start of the hold"),
    hold_time=Meaning("s", "how long the drive stands"),
    velocity_before=Meaning("m s-1", "velocity of the drive before"),
    velocity_after=Meaning("m s-1", "velocity of the drive after"),
    force_before=Meaning("N", "steady force before"),
    force_before_error=Meaning("N", "its standard error"),
    start_force=Meaning("N", "force at the start of the hold"),
    end_force=Meaning("N", "force at the end of the hold"),
    relaxation=Meaning("N", "fall of the force during the hold"),
    relaxation_error=Meaning("N", "its standard error"),
    drop=Meaning("N", "steady force before minus force at the end of the hold"),
    drop_error=Meaning("N", "its standard error"),
    peak_force=Meaning("N", "greatest force of the restart"),
    peak_is_exact=Meaning("1", "whether it is known from the motion, not from samples", np.int8),
    healing=Meaning("N", "peak minus steady force before"),
    healing_error=Meaning("N", "its standard error"),
    slip_to_peak=Meaning("m", "displacement of the slider from the end of the hold to the peak"),
    load_to_peak=Meaning("m", "displacement of the load point from there to the peak"),
    note=_NOTE,
)

# Of the line through the rows of a group, its scalars.
STEADY_LINE = Group(
    rate_dependence=Meaning("N", "change of the steady force with ln V, a - b"),
    rate_dependence_error=Meaning("N", "its standard error"),
    rate_dependence_chi_square=Meaning("1", "weighted squares of the distances from the line"),
    rate_dependence_freedom=Meaning("1", "velocities less two", np.int64),
)
HEALING_LINE = Group(
    healing_per_decade=Meaning("N", "growth of the peak for each tenfold hold time, beta"),
    healing_per_decade_error=Meaning("N", "its standard error"),
    healing_per_decade_chi_square=Meaning("1", "weighted squares of the distances from the line"),
    healing_per_decade_freedom=Meaning("1", "holds less two", np.int64),
)


@dataclass(frozen=True)
class Line:
    """A straight line by weighted least squares.

    Attributes
    ----------
    slope, slope_error, level
        Slope, its standard error, and value at 0. The error is multiplied by √(χ²/degrees of
        freedom) if that is more than 1; of two points it is that of their errors alone.
    chi_square, degrees_of_freedom
        χ² with the errors of the points; NaN where they have none.
    """

    slope: float
    slope_error: float
    level: float
    chi_square: float
    degrees_of_freedom: int


def line(x: Array, y: Array, error: Array) -> Line | None:
    """A line through points with errors; None if they have less than two places.

    Points without a positive error are weighted alike, and the scatter about the line is their
    error.
    """
    good = np.isfinite(x) & np.isfinite(y)
    x, y, error = x[good], y[good], error[good]
    if np.unique(x).size < 2:
        return None
    has_errors = bool(np.all(np.isfinite(error)) and np.all(error > 0))
    weight = 1 / error**2 if has_errors else np.ones_like(x)
    middle = np.average(x, weights=weight)
    spread = float(np.sum(weight * (x - middle) ** 2))
    slope = float(np.sum(weight * (x - middle) * y) / spread)
    level = float(np.average(y, weights=weight) - slope * middle)
    square = float(np.sum(weight * (y - level - slope * x) ** 2))
    freedom = x.size - 2
    scatter = square / freedom if freedom > 0 else math.nan
    if has_errors:
        factor = max(scatter, 1.0) if freedom > 0 else 1.0
        return Line(slope, math.sqrt(factor / spread), level, square, freedom)
    return Line(slope, math.sqrt(scatter / spread), level, math.nan, freedom)


def steady_rows(experiment: Experiment, number: int) -> list[dict[str, Any]]:
    """The steady force of each stage at one velocity."""
    rows = []
    for stage in experiment.stages:
        if not stage.is_steady:
            continue
        row = _row(STEADY, number, stage)
        row |= {"stage_start_time": stage.start, "velocity": stage.velocity}
        row["slip_share"] = experiment.slip_share(stage)
        mean = experiment.mean_of(stage)
        if mean is None:
            row["note"] = "too few samples in the stage; a shorter output.interval has more"
        else:
            first = experiment.samples(stage).start
            begin = experiment.time[min(first + mean.start, experiment.time.size - 1)]
            row |= {
                "steady_force": mean.mean,
                "steady_force_error": mean.error,
                "steady_force_half_width": mean.half_width,
                "standard_deviation": mean.standard_deviation,
                "transient_time": max(0.0, float(begin) - stage.start) if mean.start else 0.0,
                "sample_count": mean.count,
                "effective_sample_count": mean.effective_count,
                "is_steady": int(mean.is_steady),
                "is_resolved": int(mean.is_resolved),
            }
            row["note"] = _doubt(experiment, stage, mean)
        rows.append(row)
    return rows


def _doubt(experiment: Experiment, stage: Stage, mean: SteadyMean) -> str:
    """What must be said beside a steady force."""
    doubts = []
    if experiment.sticks_and_slips(stage):
        doubts.append("sticks and slips: the mean of its cycles")
    if not mean.is_steady:
        doubts.append("not steady yet: the force still drifts")
    if not mean.is_resolved:
        doubts.append("short: the error is too small")
    return "; ".join(doubts)


def _row(group: Group, number: int, stage: Stage) -> dict[str, Any]:
    """A row of a group, of which nothing is known yet."""
    row: dict[str, Any] = {
        name: "" if meaning.dtype is np.str_ else 0 if meaning.dtype is not np.float64 else math.nan
        for name, meaning in group.items()
    }
    return row | {"output_index": number, "stage_number": stage.number}


def step_rows(experiment: Experiment, number: int) -> list[dict[str, Any]]:
    """Each step from one velocity to another."""
    rows = []
    for before, after in zip(experiment.stages, experiment.stages[1:], strict=False):
        if not (before.is_steady and after.is_steady) or before.velocity == after.velocity:
            continue
        row = _row(STEPS, number, after) | {
            "step_time": after.start,
            "velocity_before": before.velocity,
            "velocity_after": after.velocity,
        }
        row["note"] = _fill_step(experiment, before, after, row)
        rows.append(row)
    return rows


def _fill_step(experiment: Experiment, before: Stage, after: Stage, row: dict[str, Any]) -> str:
    """What is found of a step; returns what is not, and why."""
    if before.direction != after.direction:
        return "the drive turns round"
    first, second = experiment.mean_of(before), experiment.mean_of(after)
    if first is None or second is None:
        return "too few samples before or after"
    logarithm = math.log(after.velocity / before.velocity)
    net_error = math.hypot(first.error, second.error)
    row |= {
        "force_before": first.mean,
        "force_after": second.mean,
        "net_change": second.mean - first.mean,
        "net_change_error": net_error,
        "net_rate": (second.mean - first.mean) / logarithm,
        "net_rate_error": net_error / abs(logarithm),
    }
    for stage in (before, after):
        if experiment.sticks_and_slips(stage):
            return f"sticks and slips at {abs(stage.velocity):.3g} m/s"
    doubts = [] if first.is_steady and second.is_steady else ["not steady before or after"]
    start = _evolution_start(experiment, after, first, second, logarithm > 0)
    if start is None:
        doubts.append("no peak stands out of the noise")
        return "; ".join(doubts)
    peak, peak_error = float(start.force.mean()), _error_of_mean(start.force, second)
    direct, evolving = peak - first.mean, second.mean - peak
    row |= {
        "peak_force": peak,
        "peak_is_exact": int(start.is_exact),
        "direct_change": direct,
        "direct_change_error": math.hypot(peak_error, first.error),
        "evolving_change": evolving,
        "evolving_change_error": math.hypot(peak_error, second.error),
        "direct_rate": direct / logarithm,
        "evolving_rate": -evolving / logarithm,
    }
    doubts += _fill_relaxation(experiment, after, second, start, row)
    return "; ".join(doubts)


def _error_of_mean(values: Array, mean: SteadyMean) -> float:
    """Standard error of a mean over realizations, or of one: by the noise of the force."""
    return _scatter(values) if values.size > 1 else mean.standard_deviation


def _scatter(values: Array) -> float:
    """Standard error of a mean over realizations; NaN for one alone."""
    return float(values.std(ddof=1) / math.sqrt(values.size)) if values.size > 1 else math.nan


def _evolution_start(
    experiment: Experiment,
    after: Stage,
    first: SteadyMean,
    second: SteadyMean,
    upward: bool,
) -> Peak | None:
    """The force from which the evolution after a step starts; None if it is not told from noise.

    That is the peak beyond both steady forces. A slider that is not on a spring has the direct
    change at once, so there it may lie between them too.
    """
    peak = experiment.peak(after, upward)
    if peak is None:
        return None
    side = 1.0 if upward else -1.0
    noise = max(first.standard_deviation, second.standard_deviation)
    beyond = side * peak.force.mean() - max(side * first.mean, side * second.mean)
    if beyond > OUTSTANDING * noise:
        return peak
    if not math.isinf(experiment.stiffness):
        return None
    place = experiment.samples(after).start
    force = after.direction * experiment.force[:, place]
    if abs(force.mean() - second.mean) <= OUTSTANDING * noise / math.sqrt(force.size):
        return None
    rows = force.shape[0]
    return Peak(
        force, np.full(rows, experiment.time[place]), experiment.displacement[:, place], False
    )


def _fill_relaxation(
    experiment: Experiment, after: Stage, steady: SteadyMean, start: Peak, row: dict[str, Any]
) -> list[str]:
    """How far the slider goes while the force evolves; returns what is doubtful."""
    inside = experiment.samples(after)
    begin = int(np.searchsorted(experiment.time[inside], start.time.mean(), "left"))
    force = after.direction * experiment.force[:, inside].mean(axis=0)[begin:]
    way = experiment.displacement[:, inside].mean(axis=0)[begin:]
    way = after.direction * (way - start.displacement.mean())
    realizations = experiment.force.shape[0]
    noise = steady.standard_deviation / math.sqrt(realizations)
    amplitude = float(start.force.mean()) - steady.mean
    if force.size < 5 or abs(amplitude) < LEAST_AMPLITUDE * noise:
        return ["no evolution stands out of the noise"]
    past = -math.copysign(1.0, amplitude) * (force - steady.mean)
    if past.max() > max(OUTSTANDING * noise, LEAST_OVERSHOOT * abs(amplitude)):
        row["overshoot"] = -math.copysign(1.0, amplitude) * float(past.max())
    fit = decay(way, force, steady.correlation, noise)
    if fit is None:
        return ["no exponential decay fits the evolution"]
    length, error = fit
    row |= {"relaxation_displacement": length, "relaxation_displacement_error": error}
    last = int(np.searchsorted(way, EVOLVED * length))
    if last > 2 and way[last - 1] > 0.5 * EVOLVED * length:
        reach = float(way[last - 1] - way[0])
        step = reach / (last - 1)
        area = float(np.trapezoid(force[:last] - steady.mean, way[:last]))
        # White noise of this many samples to an independent one, and the error of the steady force.
        spread = noise * math.sqrt(steady.correlation * step * reach)
        row["integral_displacement"] = area / amplitude
        row["integral_displacement_error"] = math.hypot(
            math.hypot(spread, reach * steady.error) / abs(amplitude),
            area / amplitude**2 * _error_of_mean(start.force, steady),
        )
    if math.isfinite(row["overshoot"]):
        return ["goes past the steady force: not one exponential"]
    return []


def decay(way: Array, force: Array, correlation: float, noise: float) -> tuple[float, float] | None:
    """Length of an exponential decay of a force over a displacement, and its standard error.

    Parameters
    ----------
    way, force
        Displacement [m], ascending, and force [N], each of shape (samples,).
    correlation
        Samples to an independent one.
    noise
        Standard deviation of the force about the decay.

    Returns
    -------
    tuple or None
        None if there is no such decay: its length is not told by the samples.
    """
    from scipy.optimize import OptimizeWarning, curve_fit

    reach = float(way[-1] - way[0])
    if reach <= 0:
        return None
    chosen = np.unique(np.linspace(0, way.size - 1, MOST_POINTS).astype(int))
    # The evolution is at the start, where samples are few on a scale that is even.
    early = np.unique(np.geomspace(1, way.size, MOST_POINTS).astype(int) - 1)
    chosen = np.union1d(chosen, early)
    x, y = (way[chosen] - way[0]) / reach, force[chosen]
    size = max(float(np.ptp(y)), 1e-300)
    y = (y - y[-1]) / size

    def law(x: Array, level: float, amplitude: float, logarithm: float) -> Array:
        decayed: Array = level + amplitude * np.exp(-x / np.exp(logarithm))
        return decayed

    best = None
    for length in (0.01, 0.05, 0.3):
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore", OptimizeWarning)
            try:
                found, covariance = curve_fit(law, x, y, (0.0, y[0], math.log(length)), maxfev=500)
            except RuntimeError:
                continue
        left = float(np.sum((y - law(x, *found)) ** 2))
        if np.all(np.isfinite(covariance)) and (best is None or left < best[0]):
            best = (left, found, covariance)
    if best is None:
        return None
    left, found, covariance = best
    # Neighbours among the samples chosen are as correlated as their distance lets them.
    spacing = way.size / chosen.size
    factor = max(1.0, correlation / spacing)
    floor = (noise / size) ** 2 * chosen.size / max(left, 1e-300)
    error = math.sqrt(covariance[2, 2] * factor * max(1.0, floor))
    length = math.exp(found[2]) * reach
    if not math.isfinite(length) or error > 1 or length > reach:
        return None
    return length, length * error


def hold_rows(experiment: Experiment, number: int) -> list[dict[str, Any]]:
    """Each hold, with the restart after it."""
    rows = []
    stages = experiment.stages
    for place, hold in enumerate(stages):
        if not hold.is_hold:
            continue
        row = _row(HOLDS, number, hold) | {
            "hold_start_time": hold.start,
            "hold_time": hold.duration,
        }
        before = stages[place - 1] if place else None
        after = stages[place + 1] if place + 1 < len(stages) else None
        row["note"] = _fill_hold(experiment, before, hold, after, row)
        rows.append(row)
    return rows


def _fill_hold(
    experiment: Experiment,
    before: Stage | None,
    hold: Stage,
    after: Stage | None,
    row: dict[str, Any],
) -> str:
    """What is found of a hold; returns what is not, and why."""
    doubts = []
    sign = next((one.direction for one in (before, after) if one and one.direction), 1.0)
    start, end = (sign * experiment.force_at(hold, which) for which in ("start", "end"))
    mean = None
    if before is None or not before.is_steady:
        doubts.append("no stage at one velocity before")
    else:
        row["velocity_before"] = before.velocity
        mean = experiment.mean_of(before)
        if mean is None:
            doubts.append("too few samples before")
        elif experiment.sticks_and_slips(before):
            doubts.append("sticks and slips before: no steady force to compare with")
            mean = None
    relaxed = start - end
    row |= {
        "start_force": float(start.mean()),
        "end_force": float(end.mean()),
        "relaxation": float(relaxed.mean()),
        "relaxation_error": _scatter(relaxed),
    }
    if mean is not None:
        row |= {
            "force_before": mean.mean,
            "force_before_error": mean.error,
            "drop": mean.mean - float(end.mean()),
            "drop_error": math.hypot(mean.error, _error_of_mean(end, mean)),
        }
        if not mean.is_steady:
            doubts.append("not steady before")
    if after is None:
        return "; ".join([*doubts, "nothing after the hold"])
    row["velocity_after"] = after.velocity
    if after.direction == 0 or after.direction != sign:
        return "; ".join([*doubts, "the drive does not go on the same way"])
    peak = experiment.peak(after)
    if peak is None:
        return "; ".join([*doubts, "no sample after the hold"])
    travelled = sign * (peak.displacement - experiment.displacement_at_start(after))
    if after.is_steady:
        row["load_to_peak"] = float(abs(after.velocity) * (peak.time - after.start).mean())
    row |= {
        "peak_force": float(peak.force.mean()),
        "peak_is_exact": int(peak.is_exact),
        "slip_to_peak": float(travelled.mean()),
    }
    if mean is not None:
        row["healing"] = float(peak.force.mean()) - mean.mean
        row["healing_error"] = math.hypot(mean.error, _error_of_mean(peak.force, mean))
    return "; ".join(doubts)


def _line_of(group: Group, found: Line | None) -> dict[str, xr.Variable]:
    """The scalars of a line, NaN if there is none."""
    values = (
        (math.nan, math.nan, math.nan, 0)
        if found is None
        else (found.slope, found.slope_error, found.chi_square, found.degrees_of_freedom)
    )
    return {
        name: group.variable(name, (), np.asarray(value, dtype=group[name].dtype))
        for name, value in zip(group, values, strict=True)
    }


def _dataset(group: Group, dimension: str, rows: Sequence[Mapping[str, Any]]) -> xr.Dataset:
    """Rows as a dataset, a variable for each column."""
    return xr.Dataset(
        {
            name: group.variable(
                name, (dimension,), np.array([row[name] for row in rows], dtype=meaning.dtype)
            )
            for name, meaning in group.items()
        }
    )


def steady_line(data: xr.Dataset) -> Line | None:
    """The line of the steady force over ln V, of what is steady; None if there are no two
    velocities."""
    good = data["is_steady"].values == 1
    velocity = np.abs(data["velocity"].values[good])
    return line(
        np.log(velocity),
        data["steady_force"].values[good],
        data["steady_force_error"].values[good],
    )


def healing_line(data: xr.Dataset) -> Line | None:
    """The line of the healing over the decimal logarithm of the hold time."""
    return line(
        np.log10(data["hold_time"].values), data["healing"].values, data["healing_error"].values
    )


def _with_ratios(data: xr.Dataset, group: Group, scale: float, suffix: str, of: str) -> xr.Dataset:
    """A dataset with its forces over a force as well."""
    ratios = {
        f"{name}_{suffix}": xr.Variable(
            data[name].dims,
            data[name].values / scale,
            {"units": "1", "long_name": f"{data[name].attrs['long_name']}, over the {of}"},
        )
        for name in map(str, data.data_vars)
        if group[name].units == "N"
    }
    return data.assign(ratios)


def response(
    output: OutputLike | Sequence[OutputLike],
    *,
    normal_force: float | None = None,
    fit: bool = True,
    free_stiffness: bool = False,
) -> xr.DataTree:
    """Friction measured on an output or several: steady forces, velocity steps, holds, parameters
    of rate and state. See ``docs/response.md``.

    Parameters
    ----------
    output
        Output of a run, or several of them.
    normal_force
        Normal force [N]: forces are also given over it, as coefficients of friction. Without it
        they are given over the static force.
    fit
        Whether rate-and-state parameters are fitted, which takes some seconds.
    free_stiffness
        Whether the stiffness of the spring is a parameter of that fit, instead of that of the run.

    Returns
    -------
    xarray.DataTree
        Groups ``steady``: the mean force of each stage at one velocity, with its error; ``steps``:
        direct and evolving change and relaxation displacement of each velocity step; ``holds``:
        relaxation, restart peak and healing of each hold; ``rate_and_state``: a, b, D_c of each
        law, and whether it describes the output. Variables have units and long names.

    Raises
    ------
    FileError
        If an output cannot be read, is not of a run, or is driven by a force.
    """
    experiments = [
        Experiment(
            as_run(one),
            os.fspath(one) if isinstance(one, str | os.PathLike) else f"output {number}",
        )
        for number, one in enumerate(several(output))
    ]
    return response_of(
        experiments, normal_force=normal_force, with_fit=fit, free_stiffness=free_stiffness
    )


def response_of(
    experiments: Sequence[Experiment],
    *,
    normal_force: float | None = None,
    with_fit: bool = True,
    free_stiffness: bool = False,
) -> xr.DataTree:
    """Steady forces, velocity steps, holds, and rate-and-state parameters of outputs.

    Parameters
    ----------
    experiments
        The outputs.
    normal_force
        If it is given [N], forces are told over it too, with the suffix ``_coefficient``; else over
        the static force, with the suffix ``_ratio``.
    with_fit
        Whether rate-and-state parameters are fitted.
    free_stiffness
        Whether the stiffness is fitted along with them, and not that of the run.

    Returns
    -------
    xarray.DataTree
        Groups ``steady`` (dimension ``velocity_stage``), ``steps`` (``step``), ``holds``
        (``hold``), and ``rate_and_state`` (``fit``, one for each output and law).

    Raises
    ------
    FileError
        If none of the outputs has a stage at one velocity, or a hold.
    """
    from mesoslip.analysis import rate_and_state

    numbered = list(enumerate(experiments))
    rows = {
        "steady": [row for number, one in numbered for row in steady_rows(one, number)],
        "steps": [row for number, one in numbered for row in step_rows(one, number)],
        "holds": [row for number, one in numbered for row in hold_rows(one, number)],
    }
    fits = [
        row
        for number, one in numbered
        if with_fit
        for row in rate_and_state.fit_rows(one, number, free_stiffness=free_stiffness)
    ]
    steady = _dataset(STEADY, "velocity_stage", rows["steady"])
    holds = _dataset(HOLDS, "hold", rows["holds"])
    parts = {
        "steady": (
            steady.assign(_line_of(STEADY_LINE, steady_line(steady))),
            Group(STEADY, **STEADY_LINE),
        ),
        "steps": (_dataset(STEPS, "step", rows["steps"]), STEPS),
        "holds": (
            holds.assign(_line_of(HEALING_LINE, healing_line(holds))),
            Group(HOLDS, **HEALING_LINE),
        ),
        "rate_and_state": (_dataset(rate_and_state.FIT, "fit", fits), rate_and_state.FIT),
    }
    static = {one.static_force for one in experiments}
    groups = {}
    for name, (data, group) in parts.items():
        if normal_force is not None:
            data = _with_ratios(data, group, normal_force, "coefficient", "normal force")
        elif len(static) == 1:
            data = _with_ratios(data, group, static.copy().pop(), "ratio", "static force")
        groups["/" + name] = data
    tree = xr.DataTree.from_dict(groups)
    tree.attrs["outputs"] = [one.name for one in experiments]
    if normal_force is not None:
        tree.attrs["normal_force"] = normal_force
    elif len(static) == 1:
        tree.attrs["static_force"] = static.pop()
    return tree


def rows_of(tree: xr.DataTree, name: str) -> list[dict[str, Any]]:
    """The rows of a group of a response, a dictionary for each, without its scalars."""
    data = tree.children[name].to_dataset()
    columns = {str(one): data[one].values.tolist() for one in data.data_vars if data[one].ndim}
    return [
        dict(zip(columns, values, strict=True)) for values in zip(*columns.values(), strict=True)
    ]


def scalars_of(tree: xr.DataTree, name: str) -> dict[str, Any]:
    """What a group of a response has once."""
    data = tree.children[name].to_dataset()
    return {str(one): data[one].item() for one in data.data_vars if not data[one].ndim}


def write_csv(tree: xr.DataTree, path: Path) -> None:
    """Write a response as one table: a row for each stage, with what is known of it.

    A stage at one velocity has the columns of ``steady``, and those of ``steps`` if it starts with
    a step; a hold has those of ``holds``. The notes of steps have a column of their own.

    Raises
    ------
    FileError
        If it cannot be written.
    """
    units: dict[str, str] = {}
    table: dict[tuple[int, int], dict[str, Any]] = {}
    for name in ("steady", "holds", "steps"):
        data = tree.children[name].to_dataset()
        for row in rows_of(tree, name):
            here = table.setdefault((row["output_index"], row["stage_number"]), {})
            for column, value in row.items():
                key = f"step_{column}" if name == "steps" and column == "note" else column
                here[key] = None if value != value else value
                units[key] = data[column].attrs["units"]
    write_table([table[key] for key in sorted(table)], units, path)
