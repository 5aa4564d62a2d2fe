"""The tables of a configuration file that are nobody's kind; those of sliders and of contacts have
rooms of their own, and so has the drive. Adding a key is adding a field.
"""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import BeforeValidator, Field, StrictBool, model_validator

from mesoslip.configuration.table import (
    Length,
    Number,
    Table,
    Time,
    Velocity,
    Whole,
    problem,
)


def _or_flag(value: object) -> object:
    """A table, or true for one of defaults and false for none."""
    if isinstance(value, bool):
        return {} if value else None
    return value


class Steady(Table):
    """When a state is steady: the mean of the spring force over some blocks, and that over as many
    before, agree within their standard error, or within a part of the static force, and the latter
    do not scatter twice as much. Each block is a way of the drive."""

    displacement: Annotated[Length, Field(gt=0)] | None = None
    """Way of the drive of one block; by default that which loads spring and contacts to the static
    force."""
    blocks: Annotated[Whole, Field(ge=2, le=10_000)] = 10
    """Blocks that are averaged, and as many before them."""
    tolerance: Annotated[Number, Field(ge=0, lt=1)] = 1e-4
    """Difference of the means over the static force that passes for none."""


class Stop(Table):
    """What ends a run before its time."""

    slips: Annotated[Whole, Field(ge=1, lt=2**62)] | None = None
    """Slips after which the run ends, as soon as the last of them is over."""
    displacement: Length | None = None
    """Displacement of the slider at which the run ends; negative on the way back."""
    steady: Annotated[Steady | None, BeforeValidator(_or_flag)] = None
    """Whether the run ends in a steady state: true, or a table."""

    @model_validator(mode="after")
    def _is_somewhere(self) -> Self:
        if self.displacement == 0:
            raise problem("displacement", "must not be 0, where the slider starts")
        return self


class Run(Table):
    """What is computed, for how long, and with which random numbers.

    A run is over after its duration, or as soon as it has had as many avalanches as are wanted, or
    what its table stop says has come.
    """

    engine: Literal["eq", "me"] = "eq"
    """`eq` follows each contact, `me` infinitely many by the master equation."""
    duration: Annotated[Time, Field(gt=0)] | None = None
    """How long the run is; needed if nothing else ends it."""
    drive_displacement: Annotated[Length, Field(gt=0)] | None = None
    """Way of the drive after which the run ends, instead of a duration."""
    avalanches: Annotated[Whole, Field(ge=1, lt=2**62)] | None = None
    """Avalanches after which the run ends; for sliders without inertia, and lattices."""
    stop: Stop | None = None
    """What ends the run before its duration."""
    realizations: Annotated[Whole, Field(ge=1, lt=2**31)] = 1
    """Number of runs that differ in their random numbers alone."""
    seed: Annotated[Whole, Field(ge=0, lt=2**63)] = 1
    """Key of the random numbers."""
    resolution: Annotated[Number, Field(gt=0, le=1)] = 0.25
    """With engine `me`: width of a population of contacts over the spread of the breaking
    stretches."""

    @property
    def stops(self) -> Stop:
        """What ends it before its time, if anything does."""
        return self.stop or Stop()


class Output(Table):
    """What is recorded; sliders without inertia have no slips, whatever ``slip_interval``."""

    interval: Annotated[Time, Field(gt=0)] | None = None
    """Interval of the trace; by default a ten-thousandth of the run."""
    slip_interval: Annotated[Time, Field(gt=0)] | None = None
    """Interval of the finer traces during slips; none by default."""
    slip_velocity: Annotated[Velocity, Field(gt=0)] | None = None
    """Velocity above the drive's that makes a slip; by default 0.02 Ω_S F_s/K."""
    layers: StrictBool = False
    """Whether the displacement of each layer is recorded."""
    avalanche_size: Annotated[Whole, Field(ge=1, lt=2**53)] | None = None
    """Least size of an avalanche in the catalogue; by default all."""
    snapshots: tuple[Annotated[Time, Field(ge=0)], ...] = ()
    """Times at which the lattice is recorded."""
    snapshot_size: Annotated[Whole, Field(ge=1, lt=2**53)] | None = None
    """Least size of an avalanche after which the lattice is recorded."""


class Curve(Table):
    """The force curve of the master equation, for ``mesoslip curve``."""

    length: Annotated[Length, Field(gt=0)] | None = None
    """Displacement up to which the curve is computed; by default twenty mean breaking stretches."""
    tolerance: Annotated[Number, Field(ge=1e-14, lt=1)] = 1e-10
    """Error of the curve over the static force."""
    newborn_width: Annotated[Length, Field(ge=0)] = 0.0
    """Standard deviation of the stretch at which contacts attach."""
    drive_displacement: Length | None = None
    """Displacement of the drive for which the effective potential is computed."""
    density_at: tuple[Annotated[Length, Field(ge=0)], ...] = ()
    """Displacements at which the density of stretches is computed."""
