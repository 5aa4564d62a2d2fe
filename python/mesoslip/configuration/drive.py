"""The drive: its tables in a file, and its parts of constant acceleration for the kernel.

Every drive is a sequence of parts, in each of which the velocity changes linearly with time. Each
part has the number of its stage.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import Annotated, Literal, NamedTuple, Self

from pydantic import Field, StrictBool, model_validator

from mesoslip.configuration.columns import Quantity
from mesoslip.configuration.history import MAX_PARTS, History
from mesoslip.configuration.table import (
    ForceRate,
    Length,
    MeasuredLength,
    Rate,
    SignedForce,
    Table,
    Time,
    Velocity,
    Whole,
    problem,
)


class DrivePart(NamedTuple):
    """A part of the drive: duration [s], velocities at start and end [m/s] (of a force, its rate
    [N/s]), and the number of its stage, from 0."""

    duration: float
    start_velocity: float
    end_velocity: float
    stage: int

    @property
    def max_speed(self) -> float:
        """Maximum speed [m/s]."""
        return max(abs(self.start_velocity), abs(self.end_velocity))

    @property
    def path_length(self) -> float:
        """Path length of the drive [m]; distances in both directions add up."""
        return self.path_length_in(self.duration)

    @property
    def directions(self) -> set[float]:
        """Signs of its velocities, without 0."""
        velocities = (self.start_velocity, self.end_velocity)
        return {math.copysign(1, one) for one in velocities if one}

    def path_length_in(self, time: float) -> float:
        """Path length of the drive in the first ``time`` seconds [m]."""
        if self.start_velocity == self.end_velocity:
            return abs(self.start_velocity) * time
        start, end = self.start_velocity, self._velocity_at(time)
        if start * end >= 0:
            return 0.5 * abs(start + end) * time
        return 0.5 * time * (start**2 + end**2) / (abs(start) + abs(end))

    def displacements(self, direction: float) -> tuple[float, float]:
        """Largest displacement in a direction, 1 or -1, and that at its end [m]."""
        start, change = direction * self.start_velocity, direction * self.end_velocity
        change -= start
        end = (start + 0.5 * change) * self.duration
        # A part that turns back is farthest where it stands.
        turns = start > 0 > start + change
        farthest = -0.5 * start**2 / change * self.duration if turns else max(0.0, end)
        return farthest, end

    def time_for(self, path_length: float) -> float:
        """Time that a path length takes, at most the duration of the part [s]."""
        if self.start_velocity == self.end_velocity:
            return path_length / abs(self.start_velocity)
        acceleration = (self.end_velocity - self.start_velocity) / self.duration
        turn = -self.start_velocity / acceleration
        before = self.path_length_in(min(max(turn, 0.0), self.duration))
        if turn > 0 and path_length > before:
            after = math.sqrt(2 * (path_length - before) / abs(acceleration))
            return min(turn + after, self.duration)
        start = abs(self.start_velocity)
        change = -abs(acceleration) if turn > 0 else abs(acceleration)
        root = start + math.sqrt(max(0.0, start**2 + 2 * change * path_length))
        return min(2 * path_length / root, self.duration) if root > 0 else 0.0

    def cut(self, duration: float) -> DrivePart:
        """Its first ``duration`` seconds."""
        if duration >= self.duration:
            return self
        return self._replace(duration=duration, end_velocity=self._velocity_at(duration))

    def _velocity_at(self, time: float) -> float:
        if time >= self.duration or self.start_velocity == self.end_velocity:
            return self.end_velocity
        change = self.end_velocity - self.start_velocity
        return self.start_velocity + change * (time / self.duration)


class Stage(Table):
    """A stage of the drive: a constant velocity, a ramp from one velocity to another, or a hold,
    for a duration or a displacement; or a force, constant or a ramp, for a duration."""

    duration: Annotated[Time, Field(gt=0)] | None = None
    """Duration of the stage."""
    displacement: Annotated[Length, Field(gt=0)] | None = None
    """Distance that the drive moves in the stage, instead of a duration."""
    velocity: Velocity | None = None
    """Velocity of the drive; may be negative."""
    start_velocity: Velocity | None = None
    """Velocity at the start of a ramp."""
    end_velocity: Velocity | None = None
    """Velocity at the end of a ramp."""
    hold: StrictBool | None = None
    """Whether the drive stands still."""
    force: SignedForce | None = None
    """Force on a slider without a spring; may be negative."""
    start_force: SignedForce | None = None
    """Force at the start of a ramp."""
    end_force: SignedForce | None = None
    """Force at the end of a ramp."""

    @model_validator(mode="after")
    def _is_one_motion(self) -> Self:
        given = [
            self.velocity is not None,
            self._is_ramp("velocity"),
            bool(self.hold),
            self.force is not None,
            self._is_ramp("force"),
        ]
        if sum(given) != 1:
            raise problem(
                "velocity",
                "give "
                + ("only one of " if any(given) else "")
                + "a velocity, start_velocity with end_velocity, hold = true, a force, or "
                "start_force with end_force",
            )
        for which in ("velocity", "force"):
            keys = (f"start_{which}", f"end_{which}")
            missing = [key for key in keys if getattr(self, key) is None]
            if self._is_ramp(which) and missing:
                raise problem(missing[0], f"missing; a ramp has {keys[0]} and {keys[1]}")
        if self.is_force and self.displacement is not None:
            raise problem("displacement", "is not for a force; give a duration")
        if (self.duration is None) == (self.displacement is None):
            raise problem("duration", "give either a duration or a displacement")
        if self.displacement is not None:
            start, end = self._velocities
            if start * end < 0:
                raise problem(
                    "displacement", "needs velocities of one sign; give a duration instead"
                )
            if start + end == 0:
                raise problem("displacement", "is never reached at velocity 0; give a duration")
        return self

    def _is_ramp(self, which: str) -> bool:
        """Whether one end of a ramp of the velocity or the force is given."""
        return (getattr(self, f"start_{which}"), getattr(self, f"end_{which}")) != (None, None)

    @property
    def is_force(self) -> bool:
        return self.force is not None or self._is_ramp("force")

    @property
    def first_force(self) -> float:
        """Force at its start [N]."""
        return self.force if self.force is not None else self.start_force or 0.0

    @property
    def _velocities(self) -> tuple[float, float]:
        """Velocities at start and end [m/s], or rates of the force [N/s]."""
        if self.is_force:
            assert self.duration is not None
            last = self.force if self.force is not None else self.end_force or 0.0
            rate = (last - self.first_force) / self.duration
            return rate, rate
        if self.hold:
            return 0.0, 0.0
        if self.velocity is not None:
            return self.velocity, self.velocity
        return self.start_velocity or 0.0, self.end_velocity or 0.0

    def part(self, number: int) -> DrivePart:
        start, end = self._velocities
        duration = self.duration
        if duration is None:
            assert self.displacement is not None
            speed = abs(start) if start == end else 0.5 * abs(start + end)
            duration = self.displacement / speed
        return DrivePart(duration, start, end, number)


class Cycle(Table):
    """An oscillating drive, between plus and minus the amplitude, from 0 and back to 0 at the end.
    Each stroke is a stage."""

    shape: Literal["triangle"] = "triangle"
    """`triangle`: constant speed in each stroke."""
    amplitude: Annotated[Length, Field(gt=0)]
    """Maximum displacement of the drive in either direction."""
    velocity: Annotated[Velocity, Field(gt=0)] | None = None
    """Speed of the drive."""
    frequency: Annotated[Rate, Field(gt=0)] | None = None
    """Cycles per second, instead of a velocity."""
    cycles: Annotated[Whole, Field(ge=1, lt=MAX_PARTS // 2)]
    """Number of cycles, after which the run ends."""

    @model_validator(mode="after")
    def _has_a_speed(self) -> Self:
        if (self.velocity is None) == (self.frequency is None):
            raise problem("velocity", "give either a velocity or a frequency")
        return self

    @property
    def speed(self) -> float:
        """Speed of the drive [m/s]; the path length of a cycle is four amplitudes."""
        if self.velocity is not None:
            return self.velocity
        assert self.frequency is not None
        return 4 * self.amplitude * self.frequency

    def parts(self) -> Iterator[DrivePart]:
        last = 2 * self.cycles
        for number in range(last + 1):
            distance = self.amplitude if number in {0, last} else 2 * self.amplitude
            velocity = self.speed if number % 2 == 0 else -self.speed
            yield DrivePart(distance / self.speed, velocity, velocity, number)


class DriveHistory(History):
    """A measured history of the drive: its displacement at given times, with straight lines between
    them. Outputs keep the points, not the name of the file."""

    what = "the drive"
    quantity = Quantity("displacement", "m", "displacement [um]")

    displacement: tuple[MeasuredLength, ...] | None = None
    """Displacements of the drive at these times."""

    @model_validator(mode="after")
    def _is_a_motion(self) -> Self:
        for part in self.parts():
            if part.max_speed > 3e8:
                raise problem("displacement", f"moves at {part.max_speed:g} m/s")
        return self

    def parts(self) -> Iterator[DrivePart]:
        """The straight lines between the points, all in one stage."""
        for duration, start, end in self.lines():
            velocity = (end - start) / duration
            yield DrivePart(duration, velocity, velocity, 0)


class Drive(Table):
    """The drive: one velocity, stages, an oscillation, a measured history, or a force, constant or
    growing."""

    velocity: Velocity | None = None
    """One velocity for the whole run."""
    stage: tuple[Stage, ...] | None = None
    """Successive stages, as `[[drive.stage]]` tables."""
    repeat: Annotated[Whole, Field(ge=1, le=MAX_PARTS)] | None = None
    """Number of passes through the list of stages."""
    cycle: Cycle | None = None
    """An oscillating drive."""
    history: DriveHistory | None = None
    """A measured motion of the drive."""
    force: SignedForce | None = None
    """Constant force on a slider of kind "force", from the start of the run."""
    force_rate: ForceRate | None = None
    """Rate of a force on a slider without a spring, which grows from 0."""

    @model_validator(mode="after")
    def _one_of_them(self) -> Self:
        given = [self.velocity, self.stage, self.cycle, self.history, self.force, self.force_rate]
        if given.count(None) != len(given) - 1:
            raise problem(
                "velocity",
                "give either a velocity, [[drive.stage]] tables, [drive.cycle], [drive.history], "
                "or a force or force_rate to a slider without a spring",
            )
        if self.force_rate == 0:
            raise problem("force_rate", "must not be 0")
        if self.stage is not None and not self.stage:
            raise problem("stage", "must have at least one stage")
        if self.stage is not None and len({one.is_force for one in self.stage}) > 1:
            raise problem("stage", "must all have forces, or all velocities and holds")
        if self.repeat is not None:
            if self.stage is None:
                raise problem("repeat", "needs [[drive.stage]] tables, which it repeats")
            if self.repeat * len(self.stage) > MAX_PARTS:
                raise problem("repeat", f"makes more than {MAX_PARTS} stages")
        return self

    @cached_property
    def parts(self) -> tuple[DrivePart, ...]:
        """The given parts; empty for one velocity or rate without end."""
        if self.stage is not None:
            once = [one.part(0) for one in self.stage]
            times = range(self.repeat or 1)
            return tuple(
                part._replace(stage=turn * len(once) + number)
                for turn in times
                for number, part in enumerate(once)
            )
        given = self.cycle or self.history
        return () if given is None else tuple(given.parts())

    @property
    def is_force(self) -> bool:
        """Whether the drive is a force instead of a displacement."""
        return (
            self.force is not None
            or self.force_rate is not None
            or bool(self.stage and self.stage[0].is_force)
        )

    def start_forces(self, parts: Sequence[DrivePart]) -> tuple[float, ...] | None:
        """Force at the start of each part of a run [N]; None where the drive's value is continuous,
        or not a force."""
        if self.force is not None:
            return (self.force,) * len(parts)
        if self.stage is None or not self.is_force:
            return None
        given = [one.first_force for one in self.stage] * (self.repeat or 1)
        last = parts[-1]
        if last.stage == len(given):
            # The last force continues.
            final = self.stage[-1]
            given.append(final.force if final.force is not None else final.end_force or 0.0)
        return tuple(given[part.stage] for part in parts)

    @property
    def first_force(self) -> float:
        """Constant force, or that at the start of the first stage [N]; 0 for a ramp from 0."""
        if self.force is not None:
            return self.force
        stages = self.stage or ()
        return stages[0].first_force if stages and stages[0].is_force else 0.0

    @property
    def continues(self) -> bool:
        """Whether it continues after its parts, with its last velocity or force."""
        return self.cycle is None and self.history is None

    @cached_property
    def length(self) -> float:
        """Total duration of its parts [s]; infinite for one velocity or rate without end."""
        return math.fsum(part.duration for part in self.parts) if self.parts else math.inf

    @property
    def last_velocity(self) -> float:
        """Velocity after its parts [m/s], or the rate of the force [N/s]."""
        if self.parts and self.is_force:
            return 0.0
        if self.parts:
            return self.parts[-1].end_velocity
        return (self.velocity if self.force_rate is None else self.force_rate) or 0.0

    def time_for(self, path_length: float) -> float:
        """Time that a path length takes [s]; infinite if the drive does not reach it."""
        time = 0.0
        for part in self.parts:
            if part.path_length >= path_length:
                return time + part.time_for(path_length)
            time += part.duration
            path_length -= part.path_length
        speed = abs(self.last_velocity) if self.continues else 0.0
        return time + path_length / speed if speed > 0 else math.inf

    def until(self, duration: float) -> tuple[DrivePart, ...]:
        """Its parts until a time [s], continued at the last velocity if they are shorter."""
        parts: list[DrivePart] = []
        remaining = duration
        for part in self.parts:
            parts.append(part.cut(remaining))
            remaining -= parts[-1].duration
            if remaining <= 0:
                break
        if remaining > 0 or not parts:
            velocity = self.last_velocity
            last = parts[-1] if parts else DrivePart(0.0, velocity, velocity, 0)
            if last.start_velocity == velocity and last.end_velocity == velocity:
                parts[-1:] = [last._replace(duration=last.duration + remaining)]
            elif remaining > 1e-12 * duration:
                # After a ramp, a constant velocity is another stage.
                parts.append(DrivePart(remaining, velocity, velocity, last.stage + 1))
        return tuple(parts)
