"""Numbers to draw: of a run, and of its theory."""

from __future__ import annotations

import math
from collections import OrderedDict
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mesoslip.analysis.regime.outputs import judge
from mesoslip.analysis.regime.result import IRREGULAR, STICK_SLIP, TRANSIENT
from mesoslip.analysis.slips import catalogue_of
from mesoslip.array_types import Array, DataTree
from mesoslip.configuration.config import Config
from mesoslip.errors import FileError, MesoslipError
from mesoslip.output.access import config_of, group_of
from mesoslip.output.inputs import OutputLike, as_run
from mesoslip.output.samples import times_of
from mesoslip.output.tree import build_tree
from mesoslip.plots.close_up import largest_slip, slip_window
from mesoslip.plots.extent import Extent, line
from mesoslip.plots.snapshots import is_on_lattice
from mesoslip.plots.trace_variables import NAMES, UNITS, force_of, label_of
from mesoslip.quantities import UNKNOWN, Scale, number, scale_for, with_unit
from mesoslip.simulation.run_realizations import Results
from mesoslip.theory.contacts import contact_theory
from mesoslip.theory.force_curve import ForceCurve
from mesoslip.theory.steady_sliding import steady_sliding

# Parts of a line, in each of which the extremes are drawn.
PARTS = 500
# Minimum part of the time axis that a running simulation fills.
MIN_PART = 0.2
# Number of points of the force curve that are drawn, its length in mean breaking stretches, and its
# precision: enough for a picture, and quick.
CURVE_POINTS = 800
CURVE_LENGTH = 6.0
CURVE_TOLERANCE = 1e-6
# Force of a measured trace, and means over slips that are compared with it, with their units.
MEASURED_FORCE = "spring_force"
COMPARED = {"force_drop": "N", "duration": "s", "waiting_time": "s"}
# Relative change up to which a velocity is constant.
CONSTANT = 1e-9
# Maximum work for the stability of steady sliding.
MAX_WORK = 10_000
# Maximum number of configurations whose theory is kept.
MAX_THEORIES = 50
# Maximum size of the picture of a lattice, in contacts along a side.
MAX_SITES = 300


@dataclass(frozen=True)
class Axis:
    """What a picture shows along an axis, and in which unit."""

    quantity: str
    unit: Scale

    @property
    def label(self) -> str:
        """The label, such as "time (s)"."""
        return self.unit.label(self.quantity)


@dataclass(frozen=True)
class Line:
    """A line in a picture, in the units of its axes."""

    x: Array
    y: Array
    along: Axis
    up: Axis

    @property
    def x_label(self) -> str:
        """The label of the horizontal axis."""
        return self.along.label

    @property
    def y_label(self) -> str:
        """The label of the vertical axis."""
        return self.up.label

    def on(self, along: Axis, up: Axis) -> Line:
        """The line in the units of other axes."""
        x = self.x * (self.along.unit.size / along.unit.size)
        y = self.y * (self.up.unit.size / up.unit.size)
        return Line(x, y, along, up)

    @property
    def description(self) -> str:
        """The line in words."""
        if self.is_empty:
            return "nothing to draw"
        known = self.y[np.isfinite(self.y)]
        low, high, first, last = (
            f"{number(float(one))} {axis.unit.name}".rstrip()
            for one, axis in (
                (known.min(initial=math.inf), self.up),
                (known.max(initial=-math.inf), self.up),
                (self.x[0], self.along),
                (self.x[-1], self.along),
            )
        )
        return f"{self.up.quantity} from {low} to {high}, {self.along.quantity} {first} to {last}"

    @property
    def is_empty(self) -> bool:
        """Whether there is nothing to draw."""
        return len(self.x) == 0


NO_AXIS = Axis("", Scale("", 1.0))
NOTHING = Line(np.empty(0), np.empty(0), NO_AXIS, NO_AXIS)


class Measured:
    """A measured trace of forces that is drawn beside runs, with statistics of its slips."""

    def __init__(self, output: OutputLike) -> None:
        self.tree = as_run(output)
        if MEASURED_FORCE not in self.tree.data_vars:
            raise FileError(
                "the trace has friction coefficients, and the model forces: give the "
                "normal_force in the table [trace] of mesoslip trace"
            )
        self.means = catalogue_of(self.tree).statistics


@dataclass(frozen=True)
class Lattice:
    """Snapshots of a lattice: times [s], the same in the unit of the time axis, force over
    threshold of each contact, NaN if it is detached, shape (snapshots, rows, columns), and breaks
    in avalanches since the snapshot before."""

    times: Array
    positions: Array
    loads: NDArray[np.float32]
    avalanches: NDArray[np.int64]


@dataclass(frozen=True)
class Interface:
    """An interface in space and time, in the units of its axes: the force on the contacts of each
    block over their strength, shape (blocks, times), at equal intervals of time up to the last, and
    time and position at which half the contacts of a block have broken."""

    stress: NDArray[np.float32]
    duration: float
    length: float
    ruptures: Line


@dataclass(frozen=True)
class Motion:
    """A run, as far as it is done: lines over time, those of its largest slip, and results."""

    force: Line
    velocity: Line
    detached: Line
    load: Line
    loop: Line
    """The force against the displacement of the slider, if the drive goes back and forth."""
    slip_force: Line
    slip_contact_force: Line
    measured: Line
    """The force of a measured trace on the axes of `force`."""
    end: float
    """End of the time axis, in its unit: that of the run, or earlier if little of it is done."""
    regime: str
    """The verdict on the motion; empty as long as there is none."""
    is_judged: bool
    """Whether the verdict is that of the whole run, which is long enough for one."""
    numbers: tuple[tuple[str, str], ...]
    """Names and values of further results."""
    lattice: Lattice | None
    interface: Interface | None
    part_done: float
    progress: str
    """The part that is done in words, with the time that the rest takes."""


@dataclass(frozen=True)
class Theory:
    """The force curve of the master equation, and predictions from it."""

    curve: Line
    spring: Line
    """The line of slope -K through the critical point."""
    critical: tuple[float, float] | None
    """X_c, where the slider becomes unstable, and its force, in the units of the curve."""
    summary: str
    """The verdict in words, or the reason why there is no curve."""
    numbers: tuple[tuple[str, str], ...]
    """Names and values of further results."""


def motion(results: Results, measured: Measured | None = None) -> Motion:
    """The pictures of a run, as far as it is done, with a measured trace beside it, if any."""
    config, (realization,) = results.config, results.realizations
    tree = build_tree(results)
    extent = Extent(0, parts=PARTS)
    times = times_of(tree)
    reached = float(times[-1]) if len(times) else 0.0
    end = max(config.expected_duration, reached)
    if 0 < reached < MIN_PART * end:
        end = reached / MIN_PART
    along = scale_for(end, "s")
    velocity, detached, load = (
        _line(tree, name, extent, extent.window(tree) if len(times) else (0.0, 0.0), along)
        for name in ("velocity", "detached_contacts", "normal_force")
    )
    if len(velocity.y) and np.ptp(velocity.y) <= CONSTANT * np.max(np.abs(velocity.y)):
        # Such as that of a slider that moves with the drive.
        velocity = NOTHING
    if not detached.y.any():
        # Without a delay.
        detached = NOTHING
    force, beside = _forces(tree, measured, extent, end, along)
    close, close_contact = _close_up(tree)
    numbers = [
        *_extremes(force),
        ("breaks", f"{realization.breaks:.0f}"),
        ("slips", str(tree["slips"].sizes["slip"])),
        ("computing time", with_unit(realization.kernel_seconds, "s", 3)),
    ]
    if results.complete:
        numbers.append(("energy balance", f"to {abs(realization.energy_residual):.0e}"))
    if config.has_avalanches:
        numbers.insert(1, ("avalanches", str(realization.avalanche_count)))
    if measured is not None:
        numbers += _comparison(tree, measured)
    return Motion(
        force,
        velocity,
        detached,
        load,
        _loop(tree, extent, force),
        close,
        close_contact,
        beside,
        end / along.size,
        *_verdict(results, tree),
        tuple(numbers),
        _lattice(tree, along),
        _interface(tree, along, reached),
        1.0 if results.complete else realization.part_done,
        _progress(results),
    )


def _loop(tree: DataTree, extent: Extent, force: Line) -> Line:
    directions = {one for part in config_of(tree).drive_parts for one in part.directions}
    if len(directions) < 2 or force.is_empty:
        return NOTHING
    x, y = line(tree, ("displacement", force_of(tree)), extent, extent.window(tree))
    across = scale_for(_largest(x), "m")
    return Line(x / across.size, y / force.up.unit.size, Axis("displacement", across), force.up)


def _verdict(results: Results, tree: DataTree) -> tuple[str, bool]:
    """The regime in words, and whether it is final. The beginning of a run shows slips, but not
    that there are none."""
    config, (all_found, motion) = results.config, judge(tree)
    found = all_found[0]
    if motion is not None:
        complete = results.complete
        return (f"in its last stage the slider {motion}" if complete else ""), complete
    if math.isinf(config.spring_stiffness):
        # Whatever the number of cycles, a longer run would show no regime.
        text = found.summary.partition(": ")[2].partition(";")[0]
        complete = results.complete
        return (f"the slider moves with the drive: {text}" if complete else ""), complete
    if results.complete:
        return found.summary, found.regime != TRANSIENT
    return (f"so far {found.summary}" if found.regime in {STICK_SLIP, IRREGULAR} else ""), False


def _extremes(drawn: Line) -> list[tuple[str, str]]:
    """Minimum and maximum of a line."""
    if drawn.is_empty:
        return []
    low, high = (number(float(one)) for one in (drawn.y.min(), drawn.y.max()))
    return [("force", f"{low} to {high} {drawn.up.unit.name}".rstrip())]


def _forces(
    tree: DataTree, measured: Measured | None, extent: Extent, end: float, along: Scale
) -> tuple[Line, Line]:
    """The spring force of a run, and that of a measured trace, in one unit."""
    name = force_of(tree)
    found = [(tree, name, extent.window(tree))] if tree.sizes.get("time") else []
    if measured is not None:
        times = times_of(measured.tree)
        window = float(times[0]), max(float(times[0]), min(end, float(times[-1])))
        found.append((measured.tree, MEASURED_FORCE, window))
    drawn = [line(one, ("time", which), extent, window) for one, which, window in found]
    scale = scale_for(max((_largest(values) for _, values in drawn), default=0.0), "N")
    lines = [
        Line(
            times / along.size,
            values / scale.size,
            Axis("time", along),
            Axis(label_of(tree, force_of(tree)), scale),
        )
        for times, values in drawn
    ]
    beside = lines.pop() if measured is not None else NOTHING
    return (lines[0] if lines else NOTHING), beside


def _comparison(tree: DataTree, measured: Measured) -> list[tuple[str, str]]:
    """Means over the slips of a run, and of a measured trace."""
    means = catalogue_of(tree).statistics
    found = []
    for name, unit in COMPARED.items():
        both = (one[name]["mean"] if name in one else None for one in (means, measured.means))
        run, trace = (UNKNOWN if one is None else with_unit(one, unit, 3) for one in both)
        found.append((f"mean {name.replace('_', ' ')}", f"{run} (measured {trace})"))
    return found


def _progress(results: Results) -> str:
    """The part of a run that is done, and the remaining time."""
    if results.complete:
        return "done"
    part = results.realizations[0].part_done
    if part <= 0:
        return "0 % of the run"
    left = results.wall_seconds * (1 - part) / part
    if left < 1:
        return f"{100 * part:.2g} % of the run"
    unit = scale_for(left, "s")
    return f"{100 * part:.2g} % of the run, about {left / unit.size:.2g} {unit.name} to go"


def _line(
    tree: DataTree,
    name: str,
    extent: Extent,
    window: tuple[float, float],
    along: Scale,
) -> Line:
    """A variable against time."""
    if "time" not in tree.coords or tree.sizes["time"] == 0 or name not in tree.data_vars:
        return NOTHING
    times, values = line(tree, ("time", name), extent, window)
    scale = scale_for(_largest(values), UNITS[name])
    return Line(
        times / along.size, values / scale.size, Axis("time", along), Axis(NAMES[name], scale)
    )


def _close_up(tree: DataTree) -> tuple[Line, Line]:
    """Spring force and contact force of the largest slip, if there is a slip."""
    slip = largest_slip(tree)
    if slip is None:
        return NOTHING, NOTHING
    low, high = slip_window(slip)
    times = times_of(tree)
    window = max(low, float(times[0])), min(high, float(times[-1]))
    if not window[0] < window[1]:
        return NOTHING, NOTHING
    along = scale_for(window[1] - window[0], "s")
    extent = Extent(0, *window, parts=PARTS)
    lines = [
        line(tree, ("time", name), extent, window) for name in (force_of(tree), "contact_force")
    ]
    # Two lines on one axis are in one unit.
    scale = scale_for(max(_largest(values) for _, values in lines), "N")
    axes = Axis(f"time after {with_unit(window[0], 's', 5)}", along), Axis("force", scale)
    spring, contact = (
        Line((times - window[0]) / along.size, values / scale.size, *axes)
        for times, values in lines
    )
    return spring, contact


def _largest(values: Array) -> float:
    """Maximum absolute value of those that are finite."""
    return float(np.max(np.abs(values[np.isfinite(values)]), initial=0.0))


def _lattice(tree: DataTree, along: Scale) -> Lattice | None:
    if "snapshots" not in tree.children:
        return None
    data = group_of(tree, "snapshots")
    if data.sizes["snapshot"] == 0 or not is_on_lattice(data):
        return None
    times = data["snapshot_time"].values
    step = max(1, math.ceil(max(data.sizes["row"], data.sizes["column"]) / MAX_SITES))
    loads = data["load"].values[:, ::step, ::step].astype(np.float32)
    catalogue = group_of(tree, "avalanches")
    position = np.searchsorted(times, catalogue["start_time"].values)
    largest = np.zeros(len(times) + 1, dtype=np.int64)
    np.maximum.at(largest, position, catalogue["size"].values.astype(np.int64))
    return Lattice(times, times / along.size, loads, largest[:-1])


def _interface(tree: DataTree, along: Scale, reached: float) -> Interface | None:
    if "blocks" not in tree.children or not reached:
        return None
    config = config_of(tree)
    blocks, spacing = config.slider.block_count, config.slider.block_spacing
    across = scale_for(blocks * spacing, "m")
    wanted = np.linspace(0.0, reached, min(PARTS, tree.sizes["time"]))
    chosen = np.unique(np.searchsorted(times_of(tree), wanted).clip(max=tree.sizes["time"] - 1))
    forces = group_of(tree, "blocks")["block_contact_force"].isel(realization=0, time=chosen).values
    data = group_of(tree, "ruptures")
    places = (data["block_number"].values - 0.5) * spacing
    ruptures = Line(
        data["rupture_time"].values / along.size,
        places / across.size,
        Axis("time", along),
        Axis("position", across),
    )
    stress = (forces / config.block_strengths).T.astype(np.float32)
    return Interface(stress, reached / along.size, blocks * spacing / across.size, ruptures)


class Theories:
    """The theory of recent configurations, which is not computed again when a knob returns, or
    when theory does not depend on it."""

    def __init__(self) -> None:
        self._known: OrderedDict[str, Theory] = OrderedDict()

    def known(self, config: Config) -> Theory | None:
        """The theory of a configuration, if it was computed before."""
        return self._known.get(_depends_on(config))

    def compute(self, config: Config) -> Iterator[Theory]:
        """The theory of a configuration: first the curve alone, which is fast."""
        shown = curve_alone(config)
        yield shown
        shown = with_steady_sliding(config, shown)
        self._known[_depends_on(config)] = shown
        while len(self._known) > MAX_THEORIES:
            self._known.popitem(last=False)
        yield shown


def _depends_on(config: Config) -> str:
    """The part of a configuration that theory depends on, as text."""
    return config.model_dump_json(exclude={"title": True, "run": True, "output": True})


def curve_alone(config: Config) -> Theory:
    """The force curve and its instability, without steady sliding."""
    try:
        curve = ForceCurve(_quick(config))
        drawn, spring, critical, numbers, verdict = _curve(config, curve)
    except MesoslipError as error:
        return Theory(NOTHING, NOTHING, None, str(error), ())
    caveat = contact_theory(config).caveat
    return Theory(drawn, spring, critical, "; ".join(filter(None, (caveat, verdict))), numbers)


def with_steady_sliding(config: Config, curve: Theory) -> Theory:
    sliding = steady_sliding(config, MAX_WORK)
    if sliding is None:
        return curve
    summaries = [curve.summary, *([] if sliding.summary is None else [sliding.summary])]
    numbers = (*curve.numbers, ("steady force", with_unit(sliding.force, "N", 4)))
    return replace(curve, summary="; ".join(summaries), numbers=numbers)


def _quick(config: Config) -> Config:
    length = config.curve.length or CURVE_LENGTH * config.contacts.break_stretch
    tolerance = max(config.curve.tolerance, CURVE_TOLERANCE)
    return config.replace({"curve.length": length, "curve.tolerance": tolerance})


def _curve(
    config: Config, curve: ForceCurve
) -> tuple[Line, Line, tuple[float, float] | None, tuple[tuple[str, str], ...], str]:
    samples = curve.samples
    end = float(samples[-1])
    critical = curve.critical_points[:1]
    marked = [curve.peak[0], *(one.displacement for one in critical)]
    x = np.unique(np.clip([*np.linspace(0, end, CURVE_POINTS), *marked], samples[0], end))
    force = curve.force(x)
    across, along = scale_for(end, "m"), scale_for(float(np.nanmax(np.abs(force))), "N")
    axes = Axis("displacement", across), Axis("force", along)
    drawn = Line(x / across.size, force / along.size, *axes)
    numbers = [("K*", with_unit(curve.K_star[0], "N/m", 4))]
    stiffness = config.spring_stiffness
    spring, point = NOTHING, None
    if math.isfinite(stiffness) and stiffness > 0:
        numbers.append(("K", with_unit(stiffness, "N/m", 4)))
    if critical:
        (first,) = critical
        numbers.append(("X_c", with_unit(first.displacement, "m", 4)))
        point = first.displacement / across.size, first.force / along.size
        ends = np.array([0.0, end])
        height = first.force - stiffness * (ends - first.displacement)
        spring = Line(ends / across.size, height / along.size, *axes)
    return drawn, spring, point, tuple(numbers), curve.verdict
