"""The table ``[sweep]`` of a file: the keys that are varied, and the measures of each run."""

from __future__ import annotations

from typing import Annotated, Any, Literal, Self

from pydantic import Field, StrictBool, StrictStr, model_validator

from mesoslip.configuration.table import Number, Table, Whole, problem

# Maximum number of points of a sweep.
MAX_POINTS = 10_000_000


class Range(Table):
    """Values between two ends."""

    from_: Annotated[Any, Field(alias="from")]
    """First value."""
    to: Any
    """Last value."""
    points: Annotated[Whole, Field(ge=1, le=MAX_POINTS)]
    """Number of values, including both ends."""
    spacing: Literal["linear", "logarithmic"] = "linear"
    """Spacing of the values."""


class Extent(Table):
    """Range of a key in a Latin hypercube."""

    from_: Annotated[Any, Field(alias="from")]
    """Minimum."""
    to: Any
    """Maximum."""
    spacing: Literal["linear", "logarithmic"] = "linear"
    """Distribution of the values."""


class SweepTable(Table):
    """The keys that a sweep varies, and the measures of each run."""

    realizations: Annotated[Whole, Field(ge=1, lt=2**31)] | None = None
    """Realizations of each combination; by default run.realizations."""
    measures: tuple[StrictStr, ...]
    """Names of measures; your own functions as "file.py:function"."""
    discard: Annotated[Number, Field(ge=0, lt=1)] = 0.5
    """Fraction of each run, from its start, that measures leave out."""
    traces: StrictBool = False
    """Whether the output of each point is kept."""
    continue_: Annotated[StrictStr | None, Field(alias="continue")] = None
    """Key of the grid over whose values each run starts from the end of the last one."""
    order: Literal["listed", "up", "down", "up and down"] | None = None
    """Order of the values of `continue`; as listed by default."""
    grid: dict[str, Any] = Field(default_factory=dict)
    """Lists or ranges of values of keys, each an axis; axes multiply."""
    together: tuple[dict[str, Any], ...] = ()
    """Tables of keys that go together as one axis."""
    latin_hypercube: dict[str, Any] | None = None
    """Ranges of keys, sampled by `points` combinations."""

    @model_validator(mode="after")
    def _something_to_do(self) -> Self:
        if not self.measures:
            raise problem("measures", "must name at least one measure")
        if not (self.grid or self.together or self.latin_hypercube):
            raise problem(
                "grid",
                "nothing is varied; name keys in [sweep.grid], [[sweep.together]] or "
                "[sweep.latin_hypercube]",
            )
        if self.order is not None and self.continue_ is None:
            raise problem("order", "is the order of sweep.continue, which is missing")
        return self


class SweepFile(Table):
    """The tables of a sweep's file besides the configuration."""

    sweep: SweepTable
