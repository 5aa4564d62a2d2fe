"""The normal load: its table in a file, and the share of the sites that it brings into contact.

More load means more contacts, not stronger ones: N L/L_0 of them at the load L. It is linear in
each of some parts, and may jump between them, or oscillates about L_0.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import Field, field_validator, model_validator

from mesoslip.array_types import Array
from mesoslip.configuration.columns import HEADER, FoundColumn, Quantity, cells_of, values_of
from mesoslip.configuration.history import MAX_PARTS, History
from mesoslip.configuration.kernel_parameters import Parameters
from mesoslip.configuration.reading import text_of
from mesoslip.configuration.table import (
    Angle,
    Complaint,
    Complaints,
    Force,
    Number,
    Rate,
    SignedForce,
    Table,
    Time,
    problem,
)
from mesoslip.errors import FileError
from mesoslip.quantities import with_unit

# Column of a profile along an interface.
PROFILE_COLUMN = "normal_force"
# End of the last part, which has none.
NEVER = 1e300
# Part of a site that rounding may add.
TINY_SITE = 1e-9


class LoadPart(NamedTuple):
    """A part of the load: duration [s], normal force at start and end [N]."""

    duration: float
    start_force: float
    end_force: float


class LoadStage(Table):
    """A stage of the load: a constant force, or a ramp from one force to another."""

    duration: Annotated[Time, Field(gt=0)]
    """Duration of the stage."""
    normal_force: SignedForce | None = None
    """Normal force in the stage; 0 separates all contacts."""
    start_normal_force: SignedForce | None = None
    """Normal force at the start of a ramp."""
    end_normal_force: SignedForce | None = None
    """Normal force at the end of a ramp."""

    @model_validator(mode="after")
    def _is_one_force(self) -> Self:
        ends = (self.start_normal_force, self.end_normal_force)
        if (self.normal_force is None) == (ends == (None, None)):
            raise problem(
                "normal_force",
                "give either this, or start_normal_force with end_normal_force for a ramp",
            )
        for key, one in zip(("start_normal_force", "end_normal_force"), ends, strict=True):
            if self.normal_force is None and one is None:
                raise problem(key, "missing; a ramp has start_normal_force and end_normal_force")
        return self

    def part(self) -> LoadPart:
        if self.normal_force is not None:
            return LoadPart(self.duration, self.normal_force, self.normal_force)
        return LoadPart(self.duration, self.start_normal_force or 0.0, self.end_normal_force or 0.0)


class LoadCycle(Table):
    """A vibrating load, L_0 + amplitude × sin(2π frequency × time + phase)."""

    amplitude: Annotated[Force, Field(gt=0)]
    """Amplitude, up to the mean normal force."""
    frequency: Annotated[Rate, Field(gt=0)]
    """Cycles per second."""
    phase: Angle = 0.0
    """Phase at the start of the run [rad]."""


class LoadHistory(History):
    """A measured history of the load, with straight lines between its points, from the first of
    them on. Outputs keep the points, not the name of the file."""

    what = "the load"
    quantity = Quantity("normal_force", "N", "normal force [N]")

    normal_force: tuple[SignedForce, ...] | None = None
    """Normal forces at these times."""

    def parts(self) -> Iterator[LoadPart]:
        """The straight lines between the points."""
        return itertools.starmap(LoadPart, self.lines())


class Load(Table):
    """The normal load. It changes the number of contacts, which is `contacts.count` at the
    reference `normal_force`; without stages, a cycle or a history it is that throughout."""

    normal_force: Annotated[Force, Field(gt=0)]
    """Normal force L_0 at which `contacts.count` contacts carry."""
    stage: tuple[LoadStage, ...] | None = None
    """Successive stages, as `[[load.stage]]` tables; the last force holds until the run ends."""
    cycle: LoadCycle | None = None
    """A vibrating load."""
    history: LoadHistory | None = None
    """A measured history; the last force holds until the run ends."""
    profile: tuple[Number, ...] | None = None
    """Normal forces of the blocks of an interface, from the edge on, of which only the ratios
    matter; or a CSV file with a column `normal_force`, relative to the configuration. Outputs keep
    the numbers, not the name of the file."""

    @field_validator("profile", mode="before")
    @classmethod
    def _read_profile(cls, value: Any) -> Any:
        if not isinstance(value, str):
            return value
        try:
            return read_profile(Path(value))
        except FileError as error:
            raise ValueError(str(error)) from None

    @field_validator("profile")
    @classmethod
    def _is_positive(cls, value: tuple[float, ...] | None) -> tuple[float, ...] | None:
        for block, one in enumerate(value or (), 1):
            if not one > 0:
                raise ValueError(f"must be positive; block {block} has {one:g}")
        return value

    @model_validator(mode="after")
    def _is_one_load(self) -> Self:
        given = [self.stage, self.cycle, self.history]
        if given.count(None) < len(given) - 1:
            raise problem(
                "stage", "give only one of [[load.stage]], [load.cycle] and [load.history]"
            )
        if self.stage is not None and not 1 <= len(self.stage) <= MAX_PARTS:
            raise problem("stage", f"must have from 1 to {MAX_PARTS} stages")
        if self.min_force < 0:
            where = "cycle.amplitude" if self.cycle else "history" if self.history else "stage"
            raise problem(
                where,
                f"lets the normal force fall to {self.min_force:g} N; it must not be below 0, "
                "where all contacts are separated",
            )
        if not self.max_force > 0:
            raise problem("stage", "must have a normal force above 0 somewhere")
        return self

    @cached_property
    def parts(self) -> tuple[LoadPart, ...]:
        """Parts of stages or a history; empty otherwise."""
        if self.stage is not None:
            return tuple(one.part() for one in self.stage)
        return () if self.history is None else tuple(self.history.parts())

    @property
    def max_force(self) -> float:
        """Maximum normal force [N]."""
        if self.cycle is not None:
            return self.normal_force + self.cycle.amplitude
        ends = [max(part.start_force, part.end_force) for part in self.parts]
        return max(ends, default=self.normal_force)

    @property
    def min_force(self) -> float:
        """Minimum normal force [N]."""
        if self.cycle is not None:
            return self.normal_force - self.cycle.amplitude
        ends = [min(part.start_force, part.end_force) for part in self.parts]
        return min(ends, default=self.normal_force)

    @property
    def is_known(self) -> bool:
        """Whether outputs have the normal force."""
        return True

    @property
    def varies(self) -> bool:
        """Whether the load changes in the run."""
        return self.max_force != self.min_force

    @property
    def is_uniform(self) -> bool:
        """Whether all blocks of an interface bear the same."""
        return len(set(self.profile or (1.0,))) == 1

    @property
    def acts(self) -> bool:
        """Whether contacts are not those without a load: it differs from L_0 at some time."""
        return self.varies or self.max_force != self.normal_force

    @property
    def length(self) -> float:
        """Duration of its parts [s]; infinite without any."""
        return math.fsum(part.duration for part in self.parts) if self.parts else math.inf

    def path_length(self, duration: float) -> float:
        """Sum of the changes of the normal force in both directions, in a duration [s] of a cycle,
        or in all parts [N]."""
        if self.cycle is not None:
            return 4 * self.cycle.amplitude * self.cycle.frequency * duration
        ends = [force for part in self.parts for force in (part.start_force, part.end_force)]
        return math.fsum(abs(after - before) for before, after in itertools.pairwise(ends))

    def site_count(self, count: int) -> int:
        """Number of contacts at the maximum of the load, given that at L_0."""
        return max(1, math.ceil(count * (self.max_force / self.normal_force) - TINY_SITE))

    def block_counts(self, sites: int, blocks: int) -> NDArray[np.int64]:
        """Number of contacts of each block, as its share of the load, rounded so that they add up
        to all ``sites``."""
        shares = self.profile or (1.0,) * blocks
        parts = sites * np.array(shares) / math.fsum(shares)
        counts = np.floor(parts + TINY_SITE).astype(np.int64)
        missing = sites - int(counts.sum())
        counts[np.argsort(counts - parts, kind="stable")[:missing]] += 1
        return counts

    def block_problems(self, sites: int, blocks: int) -> Complaints:
        """Errors of the profile of a slider with a number of blocks, 0 for other kinds."""
        if self.profile is None:
            return
        if not blocks:
            yield Complaint("load.profile", 'is for slider.kind = "interface" only')
        elif len(self.profile) != blocks:
            yield Complaint(
                "load.profile",
                f"has {len(self.profile)} values, and slider.blocks = {blocks}: give one for each "
                "block",
            )
        elif not (counts := self.block_counts(sites, blocks)).all():
            yield Complaint(
                "load.profile",
                f"leaves block {int(np.argmin(counts)) + 1} without a contact: give more of them "
                "by contacts.count",
            )

    def kernel_parameters(self, count: int) -> Parameters:
        """Parameters of the load in the kernel, as shares of the sites; none if it is constant."""
        if not self.varies:
            return {}
        full = self.normal_force * self.site_count(count) / count
        if self.cycle is not None:
            return {
                "load_mean": self.normal_force / full,
                "load_amplitude": min(self.cycle.amplitude, self.normal_force) / full,
                "load_rate": 2 * math.pi * self.cycle.frequency,
                "load_phase": self.cycle.phase,
            }
        # The last force holds.
        last = self.parts[-1].end_force
        parts = (*self.parts, LoadPart(math.inf, last, last))
        ends = itertools.accumulate(part.duration for part in parts)
        return {
            "load_part_end": tuple(min(one, NEVER) for one in ends),
            "load_start_share": tuple(min(1.0, part.start_force / full) for part in parts),
            "load_end_share": tuple(min(1.0, part.end_force / full) for part in parts),
        }

    def notes(self, duration: float) -> Iterator[str]:
        """Messages about a load that ends before a run of a duration [s], or separates all."""
        # Durations of stages may be rounded in the file.
        if 1.01 * self.length < duration < math.inf:
            last = with_unit(self.parts[-1].end_force, "N")
            yield (
                f"the load ends after {with_unit(self.length, 's')}: its last normal force, "
                f"{last}, holds for another {with_unit(duration - self.length, 's')}"
            )
        if self.min_force == 0:
            yield "the normal force falls to 0, where all contacts are separated"

    def force_at(self, time: ArrayLike) -> Array:
        """Normal force at times since the start of the run [s], in N; where it jumps, that before
        the jump, as in samples."""
        times = np.asarray(time, dtype=float)
        if self.cycle is not None:
            angle = 2 * math.pi * self.cycle.frequency * times + self.cycle.phase
            return self.normal_force + self.cycle.amplitude * np.sin(angle)
        if not self.parts:
            return np.full_like(times, self.normal_force)
        durations, first, last = (np.array(one) for one in zip(*self.parts, strict=True))
        ends = np.array(list(itertools.accumulate(durations)))
        number = np.minimum(np.searchsorted(ends, times, side="left"), len(ends) - 1)
        part = 1 - (ends[number] - times) / durations[number]
        force: Array = first[number] + np.clip(part, 0, 1) * (last[number] - first[number])
        return np.where(np.isnan(times), np.nan, force)


def read_profile(path: Path) -> list[float]:
    """Normal forces of the blocks in a file, a table with a column of them; the size of its unit
    does not matter."""
    cells = cells_of(text_of(path, "a profile of the load"), str(path))
    names = [HEADER.fullmatch(one) for one in cells.first]
    places = [
        place
        for place, match in enumerate(names)
        if match is not None and match["name"].strip().lower().replace(" ", "_") == PROFILE_COLUMN
    ]
    if not cells.has_header or len(places) != 1:
        raise FileError(
            f"{path}: the header must name one column {PROFILE_COLUMN}, such as 'normal_force [N]'"
        )
    found = {"normal force": FoundColumn(places[0], 1.0)}
    return values_of(cells, cells.first, found)["normal force"]


class Unloaded(Load):
    """No table: contacts are as many as `contacts.count`, whatever presses them."""

    normal_force: float = 1.0

    @property
    def is_known(self) -> bool:
        return False


UNLOADED = Unloaded()
