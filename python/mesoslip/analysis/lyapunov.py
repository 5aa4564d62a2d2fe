"""The largest Lyapunov exponent of a run, from twins that start a small distance away.

A twin continues from the state of the run, with the same random numbers, after its drive was
displaced by a small distance. The distance of both grows as exp(λt) until it is as large as the
motion itself, or decays until rounding and steps hide it. Nothing is renormalized: the run is
compared with a new twin from each of several times on.

A displacement along the motion neither grows nor decays. So in each window of time the shift in
time is removed that minimizes the difference.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mesoslip.array_types import Array, DataTree
from mesoslip.configuration import arguments
from mesoslip.errors import ConfigError, Problem, RunError
from mesoslip.execution.executors import ExecutorLike, as_executor, completed
from mesoslip.execution.stop import Stop, StoppedError
from mesoslip.output.inputs import ConfigLike, as_config
from mesoslip.output.provenance import program_attributes
from mesoslip.output.variables import LYAPUNOV
from mesoslip.simulation.realization import Realization
from mesoslip.simulation.recorded_tables import TRACE_COLUMNS

if TYPE_CHECKING:
    from mesoslip.configuration.config import Config


# Kinds of sliders with inertia and a spring, whose drive can be displaced.
SLIDERS = ("rigid", "layered")
# Periods of the setup in a window in which distances are measured, and minimum number of samples.
WINDOW_PERIODS = 1
MIN_SAMPLES = 16
# Windows after which the distance has turned to the direction that grows most.
SETTLING_WINDOWS = 3
# Minimum number of windows of a twin: one step of growth.
MIN_WINDOWS = SETTLING_WINDOWS + 2
# Distance up to which growth is linear, over the amplitude of the motion.
MAX_DISTANCE = 0.1
# Part of the run before the first twin, and duration of a twin over that of the run.
TRANSIENT, TWIN_DURATION = 0.3, 0.3
# Displacement of a twin's drive over F_s/K. In the master equation it is well above the errors of
# steps and rounding; N contacts break one by one, and only distances above 1/N grow smoothly.
DISPLACEMENT = 1e-10
# Minimum distance that is fitted with N contacts, times N.
DISCRETE_DISTANCES = 10.0
# Units and meanings of the printed values.
SUMMARY = {
    name: (LYAPUNOV[name].units, LYAPUNOV[name].long_name)
    for name in ("lyapunov_exponent", "lyapunov_error", "min_distance", "max_distance")
}
# Minimum size of an exponent that is positive or negative, in standard errors.
SIGNIFICANCE = 3.0


class Fit(NamedTuple):
    """A mean rate of growth [1/s], NaN if nothing could be fitted, and its standard error."""

    exponent: float
    error: float


@dataclass(frozen=True)
class Orbit:
    """Samples of a motion at equal intervals, in units of F_s and of the slip velocity Ω_S F_s/K.

    ``position`` is spring force and velocity of the slider, shape (samples, 2), ``rate`` their
    derivatives [1/s].
    """

    time: Array
    position: Array
    rate: Array

    @classmethod
    def of_trace(cls, trace: Array, config: Config) -> Orbit:
        """The motion of a trace with the columns of a run."""
        index = [TRACE_COLUMNS.index(one) for one in ("time", "spring_force", "velocity")]
        time, force, velocity = trace[:, index].T
        static, spring = config.contacts.static_force, config.spring_stiffness
        unit = static / spring * math.pi / config.slider.quiet_time
        position = np.stack([force / static, velocity / unit], axis=1)
        return cls(time, position, np.gradient(position, time, axis=0))

    def after(self, time: float) -> Orbit:
        """The motion from a time [s] on."""
        late = self.time >= time
        return Orbit(self.time[late], self.position[late], self.rate[late])

    @property
    def amplitude(self) -> float:
        """Root mean square distance from the mean."""
        return float(np.sqrt(np.mean(np.sum((self.position - self.position.mean(0)) ** 2, axis=1))))


def transverse_distances(one: Orbit, other: Orbit, window: int) -> tuple[Array, Array]:
    """Middles [s] of windows of samples, and the distance of two motions in them.

    This is the root mean square distance at the shift in time for which it is minimal. The other
    motion has some of the times of the first.
    """
    interval = float(np.median(np.diff(one.time)))
    first = round((other.time[0] - one.time[0]) / interval)
    count = min(len(other.time), len(one.time) - first)
    difference = other.position[:count] - one.position[first : first + count]
    rate = one.rate[first : first + count]
    windows = count // window
    shape = (windows, 2 * window)
    difference = difference[: windows * window].reshape(shape)
    rate = rate[: windows * window].reshape(shape)
    squares = np.sum(rate**2, axis=1)
    # None where nothing moves.
    shift = np.sum(difference * rate, axis=1) / np.where(squares > 0, squares, np.inf)
    transverse = difference - shift[:, np.newaxis] * rate
    times = one.time[first : first + windows * window].reshape(windows, window).mean(axis=1)
    return times, np.sqrt(np.sum(transverse**2, axis=1) / window)


def growth(times: Array, distances: Array, low: float, high: float) -> tuple[float, float]:
    """Growth of the logarithm of a distance from one bound to the other, and its duration [s].

    Both ends are first passages: the first distance in the range, and the first one beyond it,
    which is included. Without that last step, of the size of the growth in a slip, the rate would
    be too small, the more so the narrower the range. Both results are 0 if the distance is never in
    the range, or only at the end.
    """
    late = slice(SETTLING_WINDOWS, None)
    time, distance = times[late], distances[late]
    begin = _first((distance >= low) & (distance > 0))
    time, distance = time[begin:], distance[begin:]
    beyond = (distance >= high) | (distance < low) | (distance == 0)
    end = min(_first(beyond), len(distance) - 1)
    if end < 1 or distance[end] == 0:
        return 0.0, 0.0
    return math.log(distance[end] / distance[0]), float(time[end] - time[0])


def _first(condition: NDArray[np.bool_]) -> int:
    """Index of the first true element; the number of elements without one."""
    return int(np.argmax(condition)) if condition.any() else len(condition)


def pooled(grown: Array, lengths: Array, starts: Array) -> Fit:
    """Growth of twins over the durations [s] of the growth, for starts [s] in ascending order.

    The error is that of a ratio, from the scatter of the twins. Twins that follow the same part of
    a run are not independent: they count as one in the time that they share.
    """
    known = lengths > 0
    grown, lengths, starts = grown[known], lengths[known], starts[known]
    total = lengths.sum()
    if lengths.size < 2:
        return Fit(float(grown.sum() / total) if total > 0 else math.nan, math.nan)
    mean = float(grown.sum() / total)
    scatter = np.sum((grown - mean * lengths) ** 2) * lengths.size / (lengths.size - 1)
    before = np.maximum.accumulate(np.concatenate([[-math.inf], (starts + lengths)[:-1]]))
    covered = np.sum(np.maximum(starts + lengths - np.maximum(starts, before), 0.0))
    return Fit(mean, math.sqrt(scatter * total / covered) / float(total))


@arguments.checked(
    realization=arguments.whole(0),
    twins=arguments.whole(0),
    duration=arguments.number(0, is_open=True),
    displacement=arguments.number(),
    progress=arguments.function,
)
def lyapunov(
    config: ConfigLike,
    *,
    realization: int = 0,
    twins: int = 8,
    duration: float | None = None,
    displacement: float = DISPLACEMENT,
    executor: ExecutorLike = None,
    progress: Callable[[float], None] | None = None,
) -> DataTree:
    """The largest Lyapunov exponent of the motion that a configuration settles to.

    Parameters
    ----------
    config
        A configuration whose slider has inertia and a spring; one realization is computed.
    realization
        Number of the realization.
    twins
        Number of twins, at least 2; they start at equal intervals after 30 % of the run.
    duration
        Duration of each twin [s]; by default 30 % of that of the run.
    displacement
        Displacement of a twin's drive over F_s/K.
    executor
        Where twins are computed: threads.
    progress
        Called repeatedly with the finished fraction of the work, 0 to 1.

    Returns
    -------
    xarray.DataTree
        Dimensions ``twin`` and ``window``; ``distance`` over ``growth_time``, ``twin_exponent``,
        ``lyapunov_exponent`` with ``lyapunov_error`` [1/s], the peaks of the spring force before
        slips, and the range of distances that was fitted.

    Raises
    ------
    ConfigError
        If the slider has no inertia or no spring, or there are fewer than two twins.
    RunError
        If the run fails, or is too short.

    Examples
    --------
    >>> import mesoslip
    >>> path, *_ = mesoslip.example("klein")  # writes klein.toml
    >>> config = mesoslip.Config.load(path, ["run.engine=me", "run.resolution=1"])
    >>> config = config.replace("run.duration=2 s", "drive.velocity=2 um/s")
    >>> found = mesoslip.lyapunov(config, twins=4)
    >>> found["distance"].dims
    ('twin', 'window')
    """
    import xarray as xr

    checked = as_config(config)
    _check(checked, twins, displacement)
    end = checked.duration
    span = min(duration or TWIN_DURATION * end, (1 - TRANSIENT) * end)
    starts = np.linspace(TRANSIENT * end, end - span, twins)
    period = 2 * checked.slider.quiet_time
    window = max(MIN_SAMPLES, round(WINDOW_PERIODS * period / checked.output_interval))
    distance = displacement * checked.contacts.static_force / checked.spring_stiffness
    with Realization(checked, realization, estimates_errors=False) as run:
        others = []
        for start in starts:
            run.advance_to(float(start))
            if run.finished:
                raise RunError(
                    f"the run ends after {run.time:.3g} s ({run.ending}), before its last twin "
                    f"starts at {starts[-1]:.3g} s: a longer run is needed"
                )
            others.append((run.twin(distance), run.time))
            if progress is not None:
                progress(0.5 * run.time / end)
        run.advance_to(end)
        reference = Orbit.of_trace(run.trace, checked)
        peaks = run.records("slips")
    _advance_all(others, span, executor, progress)
    windows = min(len(other.trace) for other, _ in others) // window
    if windows < MIN_WINDOWS:
        raise RunError(
            f"{windows} windows of {window * checked.output_interval:.3g} s are too few: a longer "
            "run.duration is needed"
        )
    results = []
    for other, start in others:
        times, distances = transverse_distances(
            reference, Orbit.of_trace(other.trace, checked), window
        )
        results.append((times - start, distances))
    windows = min(len(times) for times, _ in results)
    times = np.stack([one[0][:windows] for one in results])
    distances = np.stack([one[1][:windows] for one in results])
    is_discrete = checked.contact_kind.is_discrete
    low = DISCRETE_DISTANCES / checked.contacts.count if is_discrete else 0.0
    high = MAX_DISTANCE * reference.after(float(starts[0])).amplitude
    found = [growth(*one, low, high) for one in zip(times, distances, strict=True)]
    grown, lengths = (np.array(one) for one in zip(*found, strict=True))
    fit = pooled(grown, lengths, starts)
    rates = np.divide(grown, lengths, out=np.full(twins, math.nan), where=lengths > 0)
    settled = peaks["start_time"] >= starts[0]
    data = {
        "distance": (("twin", "window"), distances),
        "growth_time": (("twin", "window"), times),
        "start": (("twin",), np.array([start for _, start in others])),
        "twin_exponent": (("twin",), rates),
        "lyapunov_exponent": ((), fit.exponent),
        "lyapunov_error": ((), fit.error),
        "min_distance": ((), low),
        "max_distance": ((), high),
        "peak_force": (("slip",), peaks["force_before"][settled]),
        "waiting_time": (("slip",), np.diff(peaks["start_time"], prepend=np.nan)[settled]),
    }
    return xr.DataTree(
        xr.Dataset(
            {name: LYAPUNOV.variable(name, *value) for name, value in data.items()},
            attrs=program_attributes(checked, "lyapunov"),
        )
    )


def summary(tree: DataTree) -> str:
    """Meaning of the sign of the largest exponent."""
    exponent, error = (float(tree[name]) for name in ("lyapunov_exponent", "lyapunov_error"))
    if not math.isfinite(error):
        return "too few distances in the range: a longer run or a smaller displacement is needed"
    if exponent > SIGNIFICANCE * error:
        return "chaos: small distances grow"
    if exponent < -SIGNIFICANCE * error:
        return "regular: small distances decay"
    return "no growth beyond the error: the exponent is zero, or more twins are needed"


def _check(config: Config, twins: int, displacement: float) -> None:
    """Refuse sliders without inertia or spring, and arguments out of range."""
    problems = []
    if config.slider.kind not in SLIDERS:
        problems.append(
            Problem(
                "",
                "slider.kind",
                "the Lyapunov exponent needs a slider with inertia and a spring: "
                + " or ".join(SLIDERS),
                config.slider.kind,
            )
        )
    if twins < 2:
        problems.append(Problem("", "twins", "must be at least 2, for an error", twins))
    if not 0 < displacement < MAX_DISTANCE:
        text = f"must be between 0 and {MAX_DISTANCE}"
        problems.append(Problem("", "displacement", text, displacement))
    if problems:
        raise ConfigError(problems)


def _advance_all(
    twins: list[tuple[Realization, float]],
    span: float,
    executor: ExecutorLike,
    progress: Callable[[float], None] | None,
) -> None:
    """Advance twins by a time [s]."""
    stop = Stop()
    with stop.on_interrupt():
        work = completed(
            as_executor(executor), lambda one, _: _advance(*one, span, stop), twins, stop
        )
        for done, (_, future) in enumerate(work, start=1):
            future.result()
            if progress is not None:
                progress(0.5 + 0.5 * done / len(twins))
    if stop.is_set():
        raise StoppedError("interrupted")


def _advance(twin: Realization, start: float, span: float, stop: Stop) -> None:
    while not stop.is_set() and not twin.finished and twin.time < start + span:
        twin.advance_to(min(start + span, twin.time + span / 16))
    twin.close()
