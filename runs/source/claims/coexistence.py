"""The claim that two motions are possible in a range of velocities: C24."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from mesoslip.theory.derived import derived
from numpy.typing import NDArray
from outputs import configuration

from claims.base import Finding, claim, measured, variable, verdict

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]

# Peak-to-peak spring force over F_s above which a motion is stick-slip, and below which smooth.
STICK_SLIP, SMOOTH = 0.5, 0.1


@claim(
    "C24",
    "a sweep of v_d up and down shows both motions possible in a range",
    "at some velocity, in every realization: on the way up the spring force swings by more "
    "than half of F_s, on the way down by less than a tenth, and smooth sliding is linearly "
    "stable there",
    ("claims/up-and-down",),
)
def up_and_down(trees: Sequence[xr.DataTree]) -> Finding:
    (tree,) = trees
    config = configuration(tree)
    speeds, swings = _swings(tree)
    half = len(speeds) // 2
    rising, falling = swings[:, :half], swings[:, half:][:, ::-1]
    grid = speeds[:half]
    growth = np.array(
        [
            derived(config.replace({"drive": {"velocity": float(speed)}}))[
                "steady_growth_rate"
            ].value
            for speed in grid
        ]
    )
    both = (rising > STICK_SLIP) & (falling < SMOOTH) & (growth < 0)
    last = [grid[one > STICK_SLIP].max(initial=0.0) for one in rising]
    least = [grid[one < SMOOTH].min(initial=np.inf) for one in falling]
    shared = np.flatnonzero(both.all(axis=0))
    return Finding(
        (
            measured("maximum velocity of stick-slip on the way up", last, "m/s", ""),
            measured("minimum velocity of smooth sliding on the way down", least, "m/s", "less"),
            *(
                measured(f"peak-to-peak force over F_s at {1e6 * grid[one]:g} µm/s, {name}",
                         values[:, one], "1", "")
                for one in shared
                for name, values in (("up", rising), ("down", falling))
            ),
            measured("velocity above which smooth sliding is linearly stable",
                     _zero(grid, growth), "m/s", ""),
        ),
        verdict(shared.size > 0),
        "both motions are stable at the same velocities, "
        f"{_listed(grid[shared])}, in every realization"
        if shared.size
        else "there is no velocity with both motions in every realization",
    )  # fmt: skip


def _swings(tree: xr.DataTree) -> tuple[Array, Array]:
    """Velocities of the stages [m/s], and peak-to-peak spring force over F_s in the second half of
    each, shape (realization, stage)."""
    times, force = variable(tree, "time"), variable(tree, "spring_force")
    stages = tree.children["stages"].to_dataset()
    of_first = stages["realization_index"].values == 0
    start, end, speed = (
        stages[name].values[of_first]
        for name in ("stage_start_time", "stage_end_time", "drive_start_velocity")
    )
    swings = [
        np.ptp(force[:, (times > (begin + finish) / 2) & (times <= finish)], axis=1)
        for begin, finish in zip(start, end, strict=True)
    ]
    return speed, np.stack(swings, axis=1) / configuration(tree).contacts.static_force


def _zero(grid: Array, growth: Array) -> float:
    """Velocity at which a rate that falls becomes zero, between points of the grid."""
    return float(np.interp(0.0, -growth, grid))


def _listed(speeds: Array) -> str:
    return ", ".join(f"{1e6 * one:g}" for one in speeds) + " µm/s"
