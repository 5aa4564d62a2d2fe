"""An output as a friction experiment: its trace, stage by stage of the drive."""

from __future__ import annotations

import copy
import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mesoslip.analysis.apparatus import apparatus_of
from mesoslip.analysis.steady_force import SteadyMean, steady_mean
from mesoslip.analysis.stick_phases import relieved_loading
from mesoslip.analysis.strokes.segments import output_pieces
from mesoslip.array_types import Array, Dataset
from mesoslip.configuration.drive import DrivePart
from mesoslip.errors import FileError
from mesoslip.output.access import group_of, is_measured
from mesoslip.output.arrays import Arrays, Tree

# Displacement of the slider after a change of the drive within which a peak is attributed to the
# change, in mean breaking stretches: all contacts break once or twice in it.
PEAK_STRETCHES = 3.0
# Minimum share of the slider's displacement in slips for a stage of stick-slip.
STICK_SLIP_SHARE = 0.1
# Maximum force in any unit: squares of larger ones overflow.
MAX_FORCE = 1e100
# Relative tolerance of times: sums of intervals have rounding errors.
TIME_TOLERANCE = 1e-9
# Recorded variables of an extreme: its force, time and displacement.
EXTREME = ("force", "force_time", "force_displacement")


@dataclass(frozen=True)
class Stage:
    """A stage of the drive, with times [s] and velocities [m/s], or rates of its force [N/s]."""

    number: int
    start: float
    end: float
    start_velocity: float
    end_velocity: float
    is_uniform: bool
    """Whether the velocity is constant or changes linearly; not so in a history from a file."""
    exact: Mapping[str, Array]
    """Variables of the output's group ``stages``, exact values of the motion, each of shape
    (realizations,); empty without this group."""
    is_force: bool = False
    """Whether the drive prescribes a force."""

    @property
    def duration(self) -> float:
        """Duration [s]."""
        return self.end - self.start

    @property
    def is_hold(self) -> bool:
        """Whether the drive is at rest."""
        return self._is_at_rest and not self.is_force

    @property
    def is_constant_force(self) -> bool:
        """Whether the force on the slider is constant."""
        return self._is_at_rest and self.is_force

    @property
    def _is_at_rest(self) -> bool:
        return self.is_uniform and self.start_velocity == 0 and self.end_velocity == 0

    @property
    def is_steady(self) -> bool:
        """Whether the drive moves at constant velocity."""
        is_constant = self.is_uniform and self.start_velocity == self.end_velocity != 0
        return is_constant and not self.is_force

    @property
    def velocity(self) -> float:
        """Mean velocity [m/s]."""
        return 0.5 * (self.start_velocity + self.end_velocity)

    @property
    def direction(self) -> float:
        """Sign of the velocity, 0 for a hold."""
        return float(np.sign(self.velocity))


@dataclass(frozen=True)
class Peak:
    """An extreme of the force [N] and the displacement of the slider [m] there, each of shape
    (realizations,)."""

    force: Array
    time: Array
    displacement: Array
    is_exact: bool
    """Whether the extreme is that of the motion itself, not of the samples."""


def _is_uniform(parts: Sequence[DrivePart]) -> bool:
    """Whether a stage has a single part, or parts of one constant velocity."""
    return len(parts) < 2 or len({one[1:3] for one in parts} | {parts[0][1:2] * 2}) == 1


class Experiment:
    """An output of a run or a measured trace, analysed like the record of an experiment.

    It has the samples and the stages that all realizations reached. ``force`` (in the unit of the
    apparatus), ``contact_force`` and ``displacement`` of the slider [m] have the shape
    (realizations, samples), ``time`` [s] and the displacement ``drive`` of the load point [m] the
    shape (samples,). If the drive prescribes a force (``is_forced``), that is the force, and the
    contact force differs from it.
    """

    def __init__(self, tree: Tree, name: str = "the output") -> None:
        self.apparatus = apparatus_of(tree, name)
        self.config = self.apparatus.config
        self.is_forced = self.config is not None and self.config.drive.is_force
        if self.is_forced and self.config is not None and self.config.slider.jumps:
            raise FileError(
                f"{name}: is driven by a force without inertia (drive.force_rate); its response is "
                "known for sliders with a mass"
            )
        self.name = name
        self.tree = tree
        root = tree.to_dataset()
        force = root[self.apparatus.force_name].values
        whole = np.isfinite(force).all(axis=0)
        count = int(np.argmin(whole)) if not whole.all() else whole.size
        if count == 0:
            raise FileError(f"{name}: has no sample common to all realizations")
        largest = float(np.max(np.abs(force[:, :count])))
        if largest > MAX_FORCE:
            raise FileError(f"{name}: a damaged output: its force reaches {largest:.3g}")
        self.time: Array = root["time"].values[:count]
        self.force: Array = force[:, :count]
        self.drive: Array = self._drive(root)[:count]
        self.displacement: Array = self._displacement(root, count)
        self.normal_force: Array | None = (
            root["normal_force"].values[:, :count] if "normal_force" in root else None
        )
        self.contact_force: Array = (
            root["contact_force"].values[:, :count] if self.is_forced else self.force
        )
        self.stages = self._stages()

    def _drive(self, root: Dataset | Arrays) -> Array:
        """Displacement of the load point [m], as recorded or by the velocity of the drive."""
        if "drive_displacement" in root:
            drive: Array = root["drive_displacement"].values[0]
            if np.isfinite(drive).any():
                return drive
        if not math.isfinite(self.apparatus.velocity):
            raise FileError(
                f"{self.name}: neither the load point nor its velocity is known; read the trace "
                "again with a column of the load point, or with --velocity '42 um/s'"
            )
        time = root["time"].values
        elapsed: Array = time - time[0]
        return self.apparatus.velocity * elapsed

    def _displacement(self, root: Dataset | Arrays, count: int) -> Array:
        """Displacement of the slider [m]: recorded, or that of the load point less the stretch of
        the spring, 0 if its stiffness is unknown."""
        if "displacement" in root:
            displacement: Array = root["displacement"].values[:, :count]
            if np.isfinite(displacement).any():
                return displacement
        stretch = self.force / self.stiffness if math.isfinite(self.stiffness) else 0.0
        return self.drive - stretch + np.zeros_like(self.force)

    @property
    def static_force(self) -> float:
        """F_s of the configuration, in the unit of the force; NaN without one."""
        return math.nan if self.config is None else self.config.contacts.static_force

    def without_trend(self, trend: float) -> Experiment:
        """The experiment without a linear trend of the force over the displacement of the slider,
        in the unit of the force per metre."""
        changed = copy.copy(self)
        changed.__dict__.pop("steady_means", None)
        moved = self.displacement - self.displacement[:, :1]
        changed.force = self.force - trend * moved
        return changed

    def with_stiffness(self, stiffness: float) -> Experiment:
        """The experiment with another stiffness, in the unit of the force per metre."""
        changed = copy.copy(self)
        changed.apparatus = dataclasses.replace(self.apparatus, stiffness=stiffness)
        return changed

    @cached_property
    def has_strokes(self) -> bool:
        """Whether it is a trace in strokes that its stages do not follow."""
        if not self.is_measured:
            return False
        pieces = output_pieces(self.tree)[0]
        return pieces is not None and len(self.stages) < len(pieces) / 2

    @property
    def is_measured(self) -> bool:
        """Whether it is a measured trace, not a run."""
        return is_measured(self.tree)

    @property
    def stiffness(self) -> float:
        """K, unit of the force per metre; infinite for a prescribed slider, NaN if unknown."""
        return self.apparatus.stiffness

    @property
    def peak_window(self) -> float:
        """Displacement of the slider after a change of the drive within which its peak lies [m];
        infinite without a configuration."""
        if self.config is None:
            return math.inf
        return PEAK_STRETCHES * self.config.contacts.break_stretch

    def _stages(self) -> tuple[Stage, ...]:
        last = float(self.time[-1])
        if "stages" in self.tree.children:
            found = self._recorded_stages()
        elif self.config is not None:
            found = self._configured_stages(last)
        else:
            velocity = self.apparatus.velocity
            found = [Stage(0, float(self.time[0]), last, velocity, velocity, True, {})]
        return tuple(one for one in found if one.start < last and one.duration > 0)

    def _configured_stages(self, last: float) -> list[Stage]:
        """Stages of the configuration, without exact values."""
        found, start = [], 0.0
        for number, parts in self._parts().items():
            end = start + math.fsum(one.duration for one in parts)
            speeds = (parts[0].start_velocity, parts[-1].end_velocity)
            found.append(
                Stage(
                    number, start, min(end, last), *speeds, _is_uniform(parts), {}, self.is_forced
                )
            )
            start = end
        return found

    def _parts(self) -> dict[int, list[DrivePart]]:
        """Parts of the drive by stage number."""
        parts: dict[int, list[DrivePart]] = {}
        for one in self.config.drive_parts if self.config is not None else ():
            parts.setdefault(one.stage, []).append(one)
        return parts

    def _recorded_stages(self) -> list[Stage]:
        """Recorded stages that all realizations reached."""
        data = group_of(self.tree, "stages")
        rows = {name: data[name].values for name in map(str, data.data_vars)}
        owner, numbers = rows["realization_index"], rows["stage_number"]
        realizations = self.force.shape[0]
        parts = self._parts()
        found = []
        for number in np.unique(numbers):
            mine = np.flatnonzero(numbers == number)
            mine = mine[np.argsort(owner[mine], kind="stable")]
            if not np.array_equal(owner[mine], np.arange(realizations)):
                continue
            # Times are the same in all realizations, unless slips end the run.
            start = float(rows["stage_start_time"][mine].max())
            end = float(rows["stage_end_time"][mine].min())
            first, last = (
                float(rows[f"drive_{which}_velocity"][mine[0]]) for which in ("start", "end")
            )
            exact = {name: values[mine] for name, values in rows.items()}
            is_uniform = _is_uniform(parts.get(int(number), []))
            found.append(
                Stage(int(number), start, end, first, last, is_uniform, exact, self.is_forced)
            )
        return found

    def samples(self, stage: Stage) -> slice:
        """Samples of a stage: after its start, up to its end; the first stage has its start too."""
        slack = TIME_TOLERANCE * max(abs(stage.end), 1e-300)
        first = int(np.searchsorted(self.time, stage.start + slack, "right"))
        if stage.number == 0:
            first = int(np.searchsorted(self.time, stage.start - slack, "left"))
        return slice(first, int(np.searchsorted(self.time, stage.end + slack, "right")))

    def start_sample(self, stage: Stage) -> int:
        """The last sample up to the start of a stage."""
        slack = TIME_TOLERANCE * max(abs(stage.end), 1e-300)
        return max(0, int(np.searchsorted(self.time, stage.start + slack, "right")) - 1)

    @cached_property
    def steady_means(self) -> dict[int, SteadyMean | None]:
        """Steady means of the spring force along the drive, by number of the stages at constant
        velocity; None for too few samples."""
        return {
            one.number: steady_mean(one.direction * self.force[:, self.samples(one)])
            for one in self.stages
            if one.is_steady
        }

    def mean_of(self, stage: Stage) -> SteadyMean | None:
        """The steady mean of a stage; None without one."""
        return self.steady_means.get(stage.number)

    def slip_share(self, stage: Stage) -> float:
        """Share of slips in the loading by the drive in the steady part of a stage.

        From the start of each slip to that of the next, the force falls by the slip without its
        rebound, and the drive loads it by K v t: their ratio is 1 for perfect stick-slip. It is 0
        without slips, and NaN if the slider does not rest between two of them.
        """
        data, owners = self._slips_of(stage)
        if not owners.size:
            return 0.0
        fallen = loaded = 0.0
        for owner in np.unique(owners):
            columns = (
                data[name][owners == owner] for name in ("start_time", "end_time", "force_before")
            )
            fall, time = relieved_loading(self.time, self.force[owner], *columns)
            fallen += stage.direction * fall
            loaded += self.stiffness * abs(stage.velocity) * time
        return fallen / loaded if loaded > 0 else math.nan

    def is_stick_slip(self, stage: Stage) -> bool:
        """Whether the motion in a stage is stick-slip: slips relieve the spring of a tenth of its
        loading at least, with their rebounds."""
        data, owners = self._slips_of(stage)
        if not owners.size:
            return False
        first = self._steady_start(stage)
        loaded = self.stiffness * abs(stage.velocity) * (stage.end - first) * self.force.shape[0]
        fallen = float(np.abs(data["force_drop"]).sum())
        return bool(fallen > STICK_SLIP_SHARE * loaded)

    def _slips_of(self, stage: Stage) -> tuple[dict[str, Array], Array]:
        """Columns of the slips in the steady part of a stage at constant velocity, and the
        realization of each; none under a spring of unknown or infinite stiffness."""
        if (
            not stage.is_steady
            or not math.isfinite(self.stiffness)
            or "slips" not in self.tree.children
        ):
            return {}, np.empty(0)
        slips = group_of(self.tree, "slips")
        times = slips["start_time"].values
        inside = (times >= self._steady_start(stage)) & (times < stage.end)
        names = ("start_time", "end_time", "force_before", "force_drop")
        columns = {name: slips[name].values[inside] for name in names}
        return columns, slips["realization_index"].values[inside]

    def _steady_start(self, stage: Stage) -> float:
        """Start of the steady part of a stage [s]; its end if that has no sample."""
        mean = self.mean_of(stage)
        first = self.samples(stage).start + (0 if mean is None else mean.start)
        return float(self.time[first]) if first < self.time.size else stage.end

    def force_at(self, stage: Stage, which: str) -> Array:
        """Spring force at the start or end of a stage [N], shape (realizations,)."""
        if f"{which}_force" in stage.exact:
            return stage.exact[f"{which}_force"]
        sample = self.start_sample(stage) if which == "start" else self.samples(stage).stop - 1
        return self.force[:, sample]

    def displacement_at_start(self, stage: Stage) -> Array:
        """Displacement of the slider at the start of a stage [m], shape (realizations,)."""
        if "start_displacement" in stage.exact:
            return stage.exact["start_displacement"]
        return self.displacement[:, self.start_sample(stage)]

    def peak(self, stage: Stage, upward: bool = True) -> Peak | None:
        """The maximum force along the drive soon after the start of a stage, or the minimum.

        In stick-slip: the force at the start of the first slip. Otherwise the extreme while the
        slider moves by three mean breaking stretches: the recorded one, or else that of the
        samples. Forces are positive against the motion of the drive. None without samples.
        """
        sign = stage.direction
        if upward and self.is_stick_slip(stage):
            found = self._before_first_slip(stage)
            if found is not None:
                return found
        start = self.displacement_at_start(stage)
        # The recorded extremes count along the axis, whatever the direction of the drive.
        which = "max" if (sign > 0) == upward else "min"
        if all(f"{which}_{name}" in stage.exact for name in EXTREME):
            force, time, displacement = (stage.exact[f"{which}_{name}"] for name in EXTREME)
            if np.all(np.abs(displacement - start) <= self.peak_window):
                return Peak(sign * force, time, displacement, True)
        inside = self.samples(stage)
        force, displacement = sign * self.force[:, inside], self.displacement[:, inside]
        if force.shape[1] == 0:
            return None
        is_near = np.abs(displacement - start[:, None]) <= self.peak_window
        side = 1.0 if upward else -1.0
        extreme = np.argmax(np.where(is_near, side * force, -np.inf), axis=1)
        rows = np.arange(force.shape[0])
        return Peak(
            force[rows, extreme], self.time[inside][extreme], displacement[rows, extreme], False
        )

    def _before_first_slip(self, stage: Stage) -> Peak | None:
        """The start of the first slip of a stage; None if a realization has no slip."""
        slips = group_of(self.tree, "slips")
        times, owner = slips["start_time"].values, slips["realization_index"].values
        force, time, displacement = [], [], []
        for realization in range(self.force.shape[0]):
            inside = (owner == realization) & (times >= stage.start) & (times < stage.end)
            if not inside.any():
                return None
            first = np.flatnonzero(inside)[np.argmin(times[inside])]
            force.append(stage.direction * slips["force_before"].values[first])
            time.append(times[first])
            displacement.append(np.interp(times[first], self.time, self.displacement[realization]))
        return Peak(np.array(force), np.array(time), np.array(displacement), True)
