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
    blocks: Annotated[Whole, Field(ge=2, le=10_000)] = 10
    tolerance: Annotated[Number, Field(ge=0, lt=1)] = 1e-4


class Stop(Table):
    """What ends a run before its time."""

    slips: Annotated[Whole, Field(ge=1, lt=2**62)] | None = None
    displacement: Length | None = None
    steady: Annotated[Steady | None, BeforeValidator(_or_flag)] = None

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
    duration: Annotated[Time, Field(gt=0)] | None = None
    drive_displacement: Annotated[Length, Field(gt=0)] | None = None
    avalanches: Annotated[Whole, Field(ge=1, lt=2**62)] | None = None
    stop: Stop | None = None
    realizations: Annotated[Whole, Field(ge=1, lt=2**31)] = 1
    seed: Annotated[Whole, Field(ge=0, lt=2**63)] = 1
    resolution: Annotated[Number, Field(gt=0, le=1)] = 0.25

    @property
    def stops(self) -> Stop:
        """What ends it before its time, if anything does."""
        return self.stop or Stop()


class Output(Table):
    """What is recorded; sliders without inertia have no slips, whatever ``slip_interval``."""

    interval: Annotated[Time, Field(gt=0)] | None = None
    slip_interval: Annotated[Time, Field(gt=0)] | None = None
    slip_velocity: Annotated[Velocity, Field(gt=0)] | None = None
    layers: StrictBool = False
    avalanche_size: Annotated[Whole, Field(ge=1, lt=2**53)] | None = None
    snapshots: tuple[Annotated[Time, Field(ge=0)], ...] = ()
    snapshot_size: Annotated[Whole, Field(ge=1, lt=2**53)] | None = None


class Curve(Table):
    """The force curve of the master equation, for ``mesoslip curve``."""

    length: Annotated[Length, Field(gt=0)] | None = None
    tolerance: Annotated[Number, Field(ge=1e-14, lt=1)] = 1e-10
    newborn_width: Annotated[Length, Field(ge=0)] = 0.0
    drive_displacement: Length | None = None
    density_at: tuple[Annotated[Length, Field(ge=0)], ...] = ()
