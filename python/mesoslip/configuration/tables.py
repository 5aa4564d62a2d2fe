"""The tables of a configuration file that are nobody's kind; those of sliders and of contacts have
rooms of their own, and so has the drive. Adding a key is adding a field.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, StrictBool

from mesoslip.configuration.table import (
    Length,
    Number,
    Table,
    Time,
    Velocity,
    Whole,
)


class Run(Table):
    """What is computed, for how long, and with which random numbers.

    A run is over after its duration, or as soon as it has had as many avalanches as are wanted.
    """

    engine: Literal["eq", "me"] = "eq"
    duration: Annotated[Time, Field(gt=0)] | None = None
    drive_displacement: Annotated[Length, Field(gt=0)] | None = None
    avalanches: Annotated[Whole, Field(ge=1, lt=2**62)] | None = None
    realizations: Annotated[Whole, Field(ge=1, lt=2**31)] = 1
    seed: Annotated[Whole, Field(ge=0, lt=2**63)] = 1
    resolution: Annotated[Number, Field(gt=0, le=1)] = 0.25


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
