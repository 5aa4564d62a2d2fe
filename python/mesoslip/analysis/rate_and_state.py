"""Rate-and-state parameters of an output: fitted, and told where they do not describe it."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mesoslip.analysis.experiment import Experiment, Stage
from mesoslip.analysis.spring_slider import LAWS, Loading, RateAndState, spring_slider
from mesoslip.errors import RunError
from mesoslip.output.variables import Group, Meaning
from mesoslip.quantities import percent

Array = NDArray[np.float64]

# Stages of a record at most; a measured history of the drive has thousands.
MOST_STAGES = 200
# Points of a stage that are compared: so many evenly in time, and so many in its logarithm.
EVEN_POINTS = 60
EARLY_POINTS = 60
# Relative tolerance of the motion while parameters are looked for.
TOLERANCE = 1e-8
# Step of a derivative by the logarithm of a parameter, well above that.
DERIVATIVE_STEP = 1e-4
# How far from the scales of the record parameters may lie.
FARTHEST = 1e4
# Starts of the search, over the scales of the record.
STARTS_OF_RATES = (0.02, 0.06, 0.2, 0.6)
STARTS_OF_LENGTHS = (0.03, 0.1, 0.3, 1.0, 3.0)
# Relative tolerance of the motion there.
START_TOLERANCE = 1e-5
# The best of them, which are followed to their ends, unless two of them agree.
BEST_STARTS = 4
AGREEMENT = 1e-3
# What stands for a motion that cannot be followed, in ranges of the record.
FAR_OFF = 10.0
# Noise that is taken to be there at least, over the range of the record.
LEAST_NOISE = 1e-5
# Least probability of the residuals of a law that describes a record. Small, as their noise is
# known only as well as the steady parts of the record tell it.
DESCRIBES = 0.001
# Of a record without noise: residuals over its variation that are small enough.
SMALL_MISFIT = 0.01

FIT = Group(
    output_index=Meaning("1", "which of the outputs, from 0", np.int64),
    law=Meaning("1", "law of the state variable", np.str_),
    reference_velocity=Meaning("m s-1", "V0"),
    reference_force=Meaning("N", "steady force at V0"),
    reference_force_error=Meaning("N", "its standard error"),
    a=Meaning("N", "strength of the direct effect, a"),
    a_error=Meaning("N", "its standard error"),
    b=Meaning("N", "strength of the evolving effect, b"),
    b_error=Meaning("N", "its standard error"),
    slip_distance=Meaning("m", "characteristic slip distance D_c"),
    slip_distance_error=Meaning("m", "its standard error"),
    stiffness=Meaning("N m-1", "stiffness of the spring, infinite for a prescribed slider"),
    stiffness_error=Meaning("N m-1", "its standard error, 0 if it is that of the run"),
    critical_stiffness=Meaning("N m-1", "stiffness of the spring below which sliding is unstable"),
    noise=Meaning("N", "standard deviation of the force in steady sliding, of the mean record"),
    residual=Meaning("N", "root mean square of the residuals"),
    relative_misfit=Meaning("1", "that over the standard deviation of the whole record"),
    chi_square=Meaning("1", "mean square of the residuals over their noise"),
    independent_points=Meaning("1", "independent points that are compared"),
    fit_p_value=Meaning("1", "probability of such a misfit by noise"),
    runs_p_value=Meaning("1", "probability of so few changes of the residuals' sign by chance"),
    information_criterion=Meaning(
        "1", "Akaike's criterion; the law with the lower one is likelier"
    ),
    is_described=Meaning("1", "whether the law describes the record", np.int8),
    note=Meaning("1", "what to make of it", np.str_),
)


@dataclass(frozen=True)
class Noise:
    """Noise of a record.

    Attributes
    ----------
    deviation
        Standard deviation of a sample, in the unit of the force.
    length
        Displacement over which it decays by e [m]; 0 if samples are independent of each other.
    """

    deviation: float
    length: float


@dataclass(frozen=True)
class Record:
    """A record of the force, as points that a law is compared with.

    Attributes
    ----------
    stages
        Stages of the load point, from steady sliding on.
    time, force
        Means of the samples of each point: time since the start of the first stage [s], and force.
    deviation
        Standard deviation of the force of each point.
    correlation
        Correlation of the points, shape (points, points).
    stiffness
        Of the spring, unit of force over metre.
    length_scale
        Displacement in the order of which D_c is looked for [m].
    has_noise
        Whether the record has noise that residuals can be compared with.
    start
        Time of the output at which the first stage starts [s].
    """

    stages: tuple[Loading, ...]
    time: Array
    force: Array
    deviation: Array
    correlation: Array
    stiffness: float
    length_scale: float
    has_noise: bool
    start: float = 0.0

    @property
    def reference_velocity(self) -> float:
        """V0 [m/s], that of the first stage."""
        return self.stages[0].start_velocity

    @property
    def force_scale(self) -> float:
        """Range of the force."""
        return max(float(np.ptp(self.force)), 1e-300)


@dataclass(frozen=True)
class Fit:
    """Parameters of a law that are likeliest for a record.

    Attributes
    ----------
    law
        The law with its parameters.
    stiffness
        Of the spring.
    covariance
        Of reference force, a, b, D_c and, where it was free, the stiffness.
    residual
        Record minus law at each point.
    chi_square
        Mean of the squares of the residuals over their deviation.
    independent_points
        Independent points that would tell as much.
    p_value, runs_p_value
        Probability of such residuals by noise alone; of so few changes of their sign by chance.
    at_bounds
        Names of the parameters that the record does not tell: they ran as far as they were let.
    """

    law: RateAndState
    stiffness: float
    covariance: Array
    residual: Array
    chi_square: float
    independent_points: float
    p_value: float
    runs_p_value: float
    at_bounds: tuple[str, ...]

    @property
    def misfit(self) -> float:
        """Root of the mean square of the residuals [N]."""
        return float(np.sqrt(np.mean(self.residual**2)))

    def relative_misfit(self, record: Record) -> float:
        """That over the standard deviation of the whole record; NaN if the force does not vary."""
        variation = float(record.force.std())
        return self.misfit / variation if variation > 0 else math.nan

    @property
    def errors(self) -> Array:
        """Standard errors of reference force, a, b, D_c, and the stiffness where it was free."""
        errors: Array = np.sqrt(np.diag(self.covariance))
        return errors

    @property
    def information_criterion(self) -> float:
        """Akaike's criterion, with as many points as are independent."""
        return self.independent_points * self.chi_square + 2 * len(self.covariance)


def make_record(
    stages: Sequence[Loading],
    time: Array,
    force: Array,
    way: Array,
    noise: Noise,
    stiffness: float,
    length_scale: float,
) -> Record:
    """Average the samples of a record to points: dense after each change of the drive, then sparse.

    Parameters
    ----------
    stages
        Stages of the load point; the first slides steadily.
    time, force, way
        Samples: time since the start of the first stage [s], force, displacement of the slider [m].
    noise
        Noise of the samples.
    stiffness
        Of the spring.
    length_scale
        Displacement in the order of which D_c is looked for [m].

    Notes
    -----
    The noise of a slider over contacts goes on as it moves: the correlation of two points is that
    of an Ornstein-Uhlenbeck process of the displacement, averaged over their samples.
    """
    edges = _edges(stages, time)
    first, after = edges[:-1], edges[1:]
    counts = (after - first).astype(float)
    means = [np.add.reduceat(one, first) / counts for one in (time, force)]
    is_used = np.isfinite(means[1])
    if math.isinf(stiffness):
        # A law with ln V has no force where a slider that follows the load point stands.
        is_used &= ~_holds(stages, means[0])
    first, after, counts = first[is_used], after[is_used], counts[is_used]
    scale = max(float(np.ptp(means[1][is_used])), 1e-300)
    if noise.length == 0:
        deviation = noise.deviation / np.sqrt(counts)
        correlation = np.eye(counts.size)
    else:
        # Noise does not come back where the slider swings back.
        way = np.maximum.accumulate(way)
        covariance = _averaged(way[first], way[after - 1], noise.length)
        deviation = np.sqrt(np.diag(covariance))
        correlation = covariance / np.outer(deviation, deviation)
        deviation = deviation * noise.deviation
    has_noise = noise.deviation > LEAST_NOISE * scale
    if not has_noise:
        deviation, correlation = np.full(counts.size, LEAST_NOISE * scale), np.eye(counts.size)
    return Record(
        tuple(stages),
        means[0][is_used],
        means[1][is_used],
        np.maximum(deviation, LEAST_NOISE * scale),
        correlation,
        stiffness,
        length_scale,
        has_noise,
    )


def _edges(stages: Sequence[Loading], time: Array) -> NDArray[np.int64]:
    """Samples at which points start, and the end of the last one."""
    edges = [0]
    begin = 0.0
    for number, stage in enumerate(stages):
        end = begin + stage.duration
        first = int(np.searchsorted(time, begin, "right")) if number else 0
        after = int(np.searchsorted(time, end, "right"))
        if number == len(stages) - 1:
            after = time.size
        count = after - first
        if count > 0:
            places = np.linspace(0, count, EVEN_POINTS + 1)
            if number:
                places = np.append(places, np.geomspace(1, count, EARLY_POINTS) - 1)
            edges += list(first + np.unique(places.astype(int)))
        begin = end
    return np.unique(np.array([*edges, time.size], dtype=np.int64))


def _holds(stages: Sequence[Loading], time: Array) -> NDArray[np.bool_]:
    """Which times lie in holds."""
    ends = np.cumsum([one.duration for one in stages])
    place = np.minimum(np.searchsorted(ends, time, "left"), len(stages) - 1)
    stands = np.array([max(one.start_velocity, one.end_velocity) == 0 for one in stages])
    held: NDArray[np.bool_] = stands[place]
    return held


def _averaged(start: Array, end: Array, length: float) -> Array:
    """Covariance of means of an Ornstein-Uhlenbeck process of variance 1 over intervals."""
    size = np.maximum(np.abs(end - start) / length, 1e-9)
    damped = -np.expm1(-size) / size
    low, high = np.minimum(start, end) / length, np.maximum(start, end) / length
    gap = np.maximum(low[:, None], low[None, :]) - np.minimum(high[:, None], high[None, :])
    covariance: Array = np.outer(damped, damped) * np.exp(-np.maximum(gap, 0.0))
    small = size < 1e-3
    whole = np.where(small, 1 - size / 3, 2 * (size + np.expm1(-size)) / size**2)
    np.fill_diagonal(covariance, whole)
    return covariance


def fit(record: Record, law: str, *, free_stiffness: bool = False) -> Fit:
    """Fit a law to a record by least squares in the logarithms of a, b, D_c (and the stiffness).

    Levenberg and Marquardt's way within bounds (`scipy.optimize.least_squares`), from the best of
    many starts. The covariance is that of correlated residuals, (JᵀJ)⁻¹ Jᵀ C J (JᵀJ)⁻¹ with the
    correlation C of the noise; it is multiplied by χ² where the law does not describe the record.

    Raises
    ------
    RunError
        If the law describes no motion along this record.
    """
    from scipy.optimize import least_squares

    scale, length = record.force_scale, record.length_scale
    free = free_stiffness and math.isfinite(record.stiffness)
    level = float(record.force[: max(1, record.force.size // 20)].mean())

    far_off = FAR_OFF * scale / record.deviation

    def model(at: Array) -> tuple[RateAndState, float]:
        stiffness = record.stiffness * math.exp(at[4]) if free else record.stiffness
        a, b = scale * math.exp(at[1]), scale * math.exp(at[2])
        slip = length * math.exp(at[3])
        return RateAndState(
            level + scale * at[0], record.reference_velocity, a, b, slip, law
        ), stiffness

    def residuals(at: Array, tolerance: float = TOLERANCE) -> Array:
        parameters, stiffness = model(at)
        try:
            motion = spring_slider(
                parameters, record.stages, record.time, stiffness, tolerance=tolerance
            )
        except RunError:
            return far_off
        left: Array = (record.force - motion.force) / record.deviation
        return left if np.all(np.abs(left) <= far_off) else far_off

    bound = np.full(5 if free else 4, math.log(FARTHEST))
    bound[0] = 100.0
    if free:
        bound[4] = math.log(100.0)

    def jacobian(at: Array) -> Array:
        """Differences well above the motion's tolerance; the reference force adds to the law."""
        middle = residuals(at)
        columns = [-scale / record.deviation]
        for place in range(1, at.size):
            column = np.zeros_like(middle)
            # On one side there may be no motion that can be followed.
            for step in (DERIVATIVE_STEP, -DERIVATIVE_STEP):
                moved = at.copy()
                moved[place] += step
                beside = residuals(moved)
                if not np.array_equal(beside, far_off):
                    column = (beside - middle) / step
                    break
            columns.append(column)
        return np.stack(columns, axis=1)

    best = None
    for start in _starts(residuals, far_off, bound.size, record):
        found = least_squares(
            residuals, start, jacobian, bounds=(-bound, bound), x_scale="jac", max_nfev=60
        )
        agrees = best is not None and abs(found.cost - best.cost) <= AGREEMENT * best.cost
        if best is None or found.cost < best.cost:
            best = found
        if agrees:
            break
    if best is None or np.array_equal(best.fun, far_off):
        raise RunError("the law has no motion along this record that can be followed")
    return _judged(record, best, *model(best.x), free, bound)


def _starts(
    residuals: Callable[[Array, float], Array], far_off: Array, size: int, record: Record
) -> Iterator[Array]:
    """Where to start from: the best of a net of rates and lengths, each with its best level."""
    tried = []
    for a in STARTS_OF_RATES:
        for b in STARTS_OF_RATES:
            for length in STARTS_OF_LENGTHS:
                at = np.zeros(size)
                at[1:4] = np.log([a, b, length])
                left = residuals(at, START_TOLERANCE)
                if np.array_equal(left, far_off):
                    continue
                # The reference force adds to the law.
                weight = 1 / record.deviation
                level = float(np.sum(weight * left) / np.sum(weight**2))
                at[0] = level / record.force_scale
                tried.append((float(np.sum((left - level * weight) ** 2)), at))
    tried.sort(key=lambda one: one[0])
    yield from (at for _, at in tried[:BEST_STARTS])


def _judged(
    record: Record, found: Any, law: RateAndState, stiffness: float, free: bool, bound: Array
) -> Fit:
    """What the search found, with errors and what its residuals say."""
    from scipy.stats import chi2

    # From logarithms to the parameters themselves.
    factor = np.array([record.force_scale, law.a, law.b, law.slip_distance] + [stiffness] * free)
    inverse = np.linalg.pinv(found.jac.T @ found.jac)
    covariance = inverse @ (found.jac.T @ record.correlation @ found.jac) @ inverse
    count = found.fun.size
    independent = count**2 / float(np.sum(record.correlation**2))
    square = float(np.mean(found.fun**2))
    freedom = max(independent - factor.size, 1.0)
    p_value = float(chi2.sf(square * independent, freedom)) if record.has_noise else math.nan
    if not record.has_noise or p_value < DESCRIBES:
        covariance = covariance * square * independent / freedom
    names = ("reference force", "a", "b", "D_c", "stiffness")
    at_bounds = tuple(
        name
        for name, value, limit in zip(names, found.x, bound, strict=False)
        if abs(value) > 0.98 * limit
    )
    return Fit(
        law,
        stiffness,
        covariance * np.outer(factor, factor),
        found.fun * record.deviation,
        square,
        independent,
        p_value,
        _runs(found.fun, independent),
        at_bounds,
    )


def _runs(residuals: Array, independent: float) -> float:
    """Probability of so few changes of sign by chance (Wald and Wolfowitz), of independent
    residuals."""
    from scipy.special import ndtr

    step = max(1, math.ceil(residuals.size / independent))
    above = residuals[::step] > 0
    ups, downs = int(above.sum()), int((~above).sum())
    count = ups + downs
    if min(ups, downs) == 0:
        return 0.0 if count > 5 else math.nan
    runs = 1 + int(np.sum(above[1:] != above[:-1]))
    expected = 1 + 2 * ups * downs / count
    variance = (expected - 1) * (expected - 2) / max(count - 1, 1)
    return float(ndtr((runs - expected) / math.sqrt(variance))) if variance > 0 else math.nan


def fit_rows(
    experiment: Experiment, number: int, *, free_stiffness: bool = False
) -> list[dict[str, Any]]:
    """Rate-and-state parameters of an output by each law, or a row that says why there are none."""
    record = record_of(experiment)
    if isinstance(record, str):
        return [_empty(number, "", record)]
    rows = []
    for law in LAWS:
        try:
            rows.append(_fit_row(number, record, fit(record, law, free_stiffness=free_stiffness)))
        except RunError as error:
            rows.append(_empty(number, law, str(error)))
    return rows


def _empty(number: int, law: str, note: str) -> dict[str, Any]:
    """A row without parameters."""
    row = {name: math.nan if one.dtype is np.float64 else 0 for name, one in FIT.items()}
    return row | {"output_index": number, "law": law, "note": note}


def _fit_row(number: int, record: Record, found: Fit) -> dict[str, Any]:
    errors = found.errors
    relative = found.relative_misfit(record)
    described = (
        found.p_value >= DESCRIBES and not found.runs_p_value < DESCRIBES
        if record.has_noise
        else relative < SMALL_MISFIT
    ) and not found.at_bounds
    return {
        "output_index": number,
        "law": found.law.law,
        "reference_velocity": found.law.reference_velocity,
        "reference_force": found.law.reference_force,
        "reference_force_error": errors[0],
        "a": found.law.a,
        "a_error": errors[1],
        "b": found.law.b,
        "b_error": errors[2],
        "slip_distance": found.law.slip_distance,
        "slip_distance_error": errors[3],
        "stiffness": found.stiffness,
        "stiffness_error": errors[4] if errors.size > 4 else 0.0,
        "critical_stiffness": found.law.critical_stiffness,
        "noise": float(np.sqrt(np.mean(record.deviation**2))) if record.has_noise else 0.0,
        "residual": found.misfit,
        "relative_misfit": relative,
        "chi_square": found.chi_square if record.has_noise else math.nan,
        "independent_points": found.independent_points,
        "fit_p_value": found.p_value,
        "runs_p_value": found.runs_p_value,
        "information_criterion": found.information_criterion if record.has_noise else math.nan,
        "is_described": int(described),
        "note": _verdict(record, found, relative, described),
    }


def _verdict(record: Record, found: Fit, relative: float, described: bool) -> str:
    """In words: whether the law describes the record, and if not, how one sees it."""
    if described:
        what = "within the noise" if record.has_noise else f"to {percent(relative)}"
        return f"describes the record {what}"
    reasons = []
    if found.at_bounds:
        reasons.append(f"the record does not tell {' and '.join(found.at_bounds)}")
    if record.has_noise and found.p_value < DESCRIBES:
        reasons.append(f"residuals are {math.sqrt(found.chi_square):.2g} times the noise")
    if found.runs_p_value < DESCRIBES:
        reasons.append("residuals have structure")
    reasons.append(f"it misses {percent(relative)} of the variation")
    return "does not describe the record: " + ", ".join(reasons)


def record_of(experiment: Experiment) -> Record | str:
    """The record of an output from its first steady sliding on, or why a law cannot be fitted."""
    stages = experiment.stages
    sliding = [place for place, one in enumerate(stages[:-1]) if one.is_steady]
    if not sliding:
        return "no step and no hold after sliding at one velocity: nothing tells a, b and D_c"
    # Where a law without inertia has a meaning is asked of all that slides.
    for one in stages[sliding[0] :]:
        if experiment.sticks_and_slips(one):
            return (
                f"sticks and slips at {abs(one.velocity):.3g} m/s: the law without inertia "
                "describes no slips"
            )
    means = {place: experiment.mean_of(stages[place]) for place in sliding}
    steady = [place for place, one in means.items() if one is not None and one.is_steady]
    if not steady:
        return "not steady, or too few samples, before any change of the drive: a law starts there"
    reference, mean = stages[steady[0]], means[steady[0]]
    assert mean is not None
    used = stages[steady[0] :]
    if not all(one.is_uniform for one in used):
        return "the velocity of the drive has no simple course"
    if len(used) > MOST_STAGES:
        return f"more than {MOST_STAGES} stages of the drive"
    if any(sign != reference.direction for one in used for sign in _signs(one)):
        return "the drive turns round, which a law with the logarithm of velocity has no word for"
    if math.isinf(experiment.stiffness) and not any(
        one.is_steady and one.velocity != reference.velocity for one in used
    ):
        return "a prescribed slider without a step from one velocity to another tells no a"
    begin = experiment.samples(reference).start + mean.start
    end = experiment.samples(used[-1]).stop
    start = float(experiment.time[begin])
    sign = reference.direction
    loadings = [Loading(reference.end - start, *(2 * [abs(reference.velocity)]))]
    loadings += [
        Loading(one.duration, abs(one.start_velocity), abs(one.end_velocity)) for one in used[1:]
    ]
    record = make_record(
        loadings,
        experiment.time[begin:end] - start,
        sign * experiment.force[:, begin:end].mean(axis=0),
        sign * experiment.displacement[:, begin:end].mean(axis=0),
        noise_of(experiment, used),
        experiment.stiffness,
        experiment.config.contacts.break_stretch,
    )
    return replace(record, start=start)


def _signs(stage: Stage) -> Iterator[float]:
    """Directions in which a stage goes."""
    for velocity in (stage.start_velocity, stage.end_velocity):
        if velocity != 0:
            yield math.copysign(1.0, velocity)


def noise_of(experiment: Experiment, stages: Sequence[Stage]) -> Noise:
    """Noise of the mean record of all realizations, from the steady parts of its stages.

    Infinitely many contacts have none.
    """
    if not experiment.config.contact_kind.is_discrete:
        return Noise(0.0, 0.0)
    interval = float(np.median(np.diff(experiment.time)))
    squares, lengths = [], []
    for stage in stages:
        mean = experiment.mean_of(stage)
        if mean is None:
            continue
        squares.append(mean.standard_deviation**2)
        # Samples of the first order's autoregression with as many samples to an independent one.
        if mean.correlation > 2:
            repeat = (mean.correlation - 1) / (mean.correlation + 1)
            lengths.append(abs(stage.velocity) * interval / -math.log(repeat))
        else:
            lengths.append(0.0)
    deviation = math.sqrt(float(np.mean(squares)) / experiment.force.shape[0])
    return Noise(deviation, float(np.median(lengths)))
