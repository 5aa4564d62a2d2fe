"""The tables [run], [output] and [curve] of a configuration file; each field is a key."""

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
    with_ranges,
)


def _or_flag(value: object) -> object:
    """A table: true means its defaults, false no table."""
    if isinstance(value, bool):
        return {} if value else None
    return value


class Steady(Table):
    """Criterion for a steady state. The mean spring forces over the last blocks and over the same
    number of blocks before must agree within their standard error, or within ``tolerance``, and the
    scatter of the earlier blocks must be at most twice that of the last ones. A block is a distance
    of the drive."""

    displacement: Annotated[Length, Field(gt=0)] | None = None
    """Distance that the drive moves in one block; by default the distance that loads spring and
    contacts to the static force."""
    blocks: Annotated[Whole, Field(ge=2, le=10_000)] = 10
    """Number of blocks in each of the two means."""
    tolerance: Annotated[Number, Field(ge=0, lt=1)] = 1e-4
    """Difference of the means, relative to the static force, that is ignored."""


class Stop(Table):
    """Conditions that end a run early."""

    slips: Annotated[Whole, Field(ge=1, lt=2**62)] | None = None
    """Number of slips after which the run ends."""
    displacement: Length | None = None
    """Displacement of the slider at which the run ends; may be negative."""
    steady: Annotated[Steady | None, BeforeValidator(_or_flag)] = None
    """Whether the run ends in a steady state: true, or a table."""

    @model_validator(mode="after")
    def _is_somewhere(self) -> Self:
        if self.displacement == 0:
            raise problem("displacement", "must not be 0, where the slider starts")
        return self


class Run(Table):
    """The engine, the length of a run, and its random numbers.

    A run ends after its duration, after the given number of avalanches, or when a condition of
    [run.stop] holds, whichever comes first.
    """

    engine: Literal["eq", "me"] = "eq"
    """`eq` simulates each of N contacts; `me` solves the master equation, the limit N → ∞."""
    duration: Annotated[Time, Field(gt=0)] | None = None
    """Duration of the run; needed unless something else ends it."""
    drive_displacement: Annotated[Length, Field(gt=0)] | None = None
    """Distance that the drive moves until the run ends, instead of a duration."""
    avalanches: Annotated[Whole, Field(ge=1, lt=2**62)] | None = None
    """Number of avalanches after which the run ends; for lattices and sliders without inertia."""
    stop: Stop | None = None
    """Conditions that end the run early."""
    realizations: Annotated[Whole, Field(ge=1, lt=2**31)] = 1
    """Number of runs that differ only in their random numbers."""
    seed: Annotated[Whole, Field(ge=0, lt=2**63)] = 1
    """Seed of the random numbers."""
    resolution: Annotated[Number, Field(gt=0, le=1)] = 0.25
    """With engine `me`: width of a population of contacts, relative to the standard deviation of
    the breaking stretches; smaller is more precise."""
    force_tolerance: Annotated[Number, Field(gt=0, lt=1)] | None = None
    """With engine `me`: error of the contact force over the static force that is accepted. A run
    whose estimated `force_error` is above it is repeated, up to twice, with the smaller resolution
    that the second order of the steps says; the output has that of the last repeat."""

    @property
    def stops(self) -> Stop:
        """The conditions that end the run early."""
        return self.stop or Stop()


class Output(Table):
    """Settings of the record. Without inertia there are no slips, whatever ``slip_interval`` is."""

    interval: Annotated[Time, Field(gt=0)] | None = None
    """Sampling interval of the trace; by default 1/10000 of the run."""
    slip_interval: Annotated[Time, Field(ge=0)] | None = None
    """Sampling interval of the finer traces around slips; 0 for no finer traces. By default 1/50 of
    the period of ringing on the pinned contacts, or 1/5 of the delay if that is shorter. It is
    longer where slips would then have more than 20 000 samples and more than the trace, and there
    are no finer traces where the trace itself is as fine."""
    slip_velocity: Annotated[Velocity, Field(gt=0)] | None = None
    """Velocity relative to the drive above which a slip is recorded; by default 0.02 Ω_S F_s/K."""
    layers: StrictBool = False
    """Whether the displacement of each layer is recorded."""
    avalanche_size: Annotated[Whole, Field(ge=1, lt=2**53)] | None = None
    """Minimum size of recorded avalanches; by default all are recorded."""
    snapshots: Annotated[
        tuple[Annotated[Time, Field(ge=0)], ...], BeforeValidator(with_ranges)
    ] = ()
    """Times at which a snapshot of all contacts is recorded; with engine `eq`. An entry of the list
    may be a range, ``{ from = "1.9 s", to = "1.93 s", points = 30 }``."""
    snapshot_size: Annotated[Whole, Field(ge=1, lt=2**53)] | None = None
    """Minimum size of avalanches after which a snapshot of all contacts is recorded."""


class Curve(Table):
    """The force curve of the master equation, for ``mesoslip curve``."""

    length: Annotated[Length, Field(gt=0)] | None = None
    """Displacement up to which the curve is computed; by default 20 mean breaking stretches."""
    tolerance: Annotated[Number, Field(ge=1e-14, lt=1)] = 1e-10
    """Error of the force, relative to the static force."""
    newborn_width: Annotated[Length, Field(ge=0)] = 0.0
    """Standard deviation of the stretch at which contacts attach."""
    drive_displacement: Length | None = None
    """Displacement of the drive for which the effective potential is computed."""
    density_at: tuple[Annotated[Length, Field(ge=0)], ...] = ()
    """Displacements at which the density of stretches is computed."""
