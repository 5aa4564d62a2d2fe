"""Chains of runs: along one axis of a sweep each run starts from the end of the one before."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence

from mesoslip.campaign.combination import Axis
from mesoslip.campaign.measures import Measure
from mesoslip.campaign.sweep_table import SweepTable
from mesoslip.configuration.config import Config
from mesoslip.errors import Problem
from mesoslip.simulation.start import CONTINUED

# Dimension of the order of a chain that goes up and down again, and its values.
DIRECTION = "direction"
DIRECTIONS = ("up", "down")
BOTH = "up and down"


def chain_problems(
    sweep: SweepTable, axes: Sequence[Axis], measures: Sequence[Measure], source: str
) -> Iterator[Problem]:
    """Errors of `sweep.continue` that show before any run."""
    key = sweep.continue_
    if key not in CONTINUED:
        message = (
            f"must be one of {', '.join(CONTINUED)}: with any other key the contacts of the last "
            "run are not contacts of the next one"
        )
        yield Problem(source, "sweep.continue", message, key)
    elif all(axis.keys != (key,) for axis in axes):
        yield Problem(source, "sweep.continue", "needs values in [sweep.grid]", key)
    for one in measures:
        if one.runs_again:
            message = (
                f"{one.name} is measured in another run, which starts as contacts.initial says; "
                "leave it out with sweep.continue"
            )
            yield Problem(source, "sweep.measures", message)


def with_directions(axes: Sequence[Axis], sweep: SweepTable) -> tuple[Axis, ...]:
    """The axes of a sweep, with that of the direction last where it goes up and down."""
    if sweep.order != BOTH:
        return tuple(axes)
    rows = tuple((one,) for one in DIRECTIONS)
    return (*axes, Axis(DIRECTION, (DIRECTION,), rows))


def unchained(config: Config, key: str, source: str) -> Iterator[Problem]:
    """Why a run cannot start from the end of another, or another from its end."""
    if key == "slider.stiffness" and config.slider.oscillator is None:
        message = f"slider.stiffness needs a slider of kind 'rigid', not {config.slider.kind!r}"
        yield Problem(source, "sweep.continue", message)
    if config.pressing.varies:
        message = "must be constant with sweep.continue: its stages start with a run"
        yield Problem(source, "load", message)
    stops: dict[str, float | None] = {
        "run.avalanches": config.run.avalanches,
        "run.stop.displacement": config.run.stops.displacement,
    }
    for name, value in stops.items():
        if value is not None:
            message = (
                "ends a run where no other can start; with sweep.continue a run ends with its "
                "duration, run.stop.slips or run.stop.steady"
            )
            yield Problem(source, name, message, value)


def chained(axes: Sequence[Axis], sweep: SweepTable) -> Iterator[tuple[int, ...]]:
    """Numbers of combinations in chains, each in the order of its runs."""
    along = next(at for at, axis in enumerate(axes) if axis.keys == (sweep.continue_,))
    values = [row[0] for row in axes[along].rows]
    ascending = sorted(range(len(values)), key=lambda number: values[number])
    rank = {number: at for at, number in enumerate(ascending)}
    within = {along, *(at for at, axis in enumerate(axes) if axis.dimension == DIRECTION)}

    indices = list(itertools.product(*(range(len(axis.rows)) for axis in axes)))

    def others(one: int) -> tuple[int, ...]:
        return tuple(number for at, number in enumerate(indices[one]) if at not in within)

    def order(one: int) -> tuple[int, int]:
        at = indices[one][along]
        match sweep.order:
            case "up":
                return 0, rank[at]
            case "down":
                return 0, -rank[at]
            case "up and down":
                goes_down = indices[one][-1]
                return goes_down, -rank[at] if goes_down else rank[at]
            case _:
                return 0, at

    ordered = sorted(range(len(indices)), key=lambda one: (others(one), order(one)))
    return (tuple(chain) for _, chain in itertools.groupby(ordered, key=others))
