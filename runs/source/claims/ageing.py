"""Claims of contacts that age: C21, C22."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from claims.base import Finding, claim, measured, verdict

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]

# Amplitude of the spring force over F_s above which a motion is stick-slip, and below which smooth.
STICK_SLIP, SMOOTH = 0.1, 0.02
# Variation of peaks and falls above which slips are irregular, and of peaks below which regular.
IRREGULAR = 0.1


@claim(
    "C21",
    "ageing turns stick-slip into smooth sliding as v_d grows",
    "in every realization the amplitude of the spring force is more than 0.1 of F_s at the "
    "lowest velocity and less than 0.02 at the highest, and without ageing more than 0.1 at "
    "all; for some damping, with a qualification unless for each",
    ("claims/sweeps/ageing",),
)
def smoother(trees: Sequence[xr.DataTree]) -> Finding:
    (tree,) = trees
    data = tree.to_dataset()
    amplitudes = data["relative_amplitude"].transpose(
        "contacts.ageing.young_force_ratio", "slider.damping_ratio", "drive.velocity", "realization"
    ).values  # fmt: skip
    ageing, others = amplitudes
    dampings = data["slider.damping_ratio"].values
    speeds = data["drive.velocity"].values
    turned = (ageing[:, 0] > STICK_SLIP).all(axis=1) & (ageing[:, -1] < SMOOTH).all(axis=1)
    by_ageing = turned & (others > STICK_SLIP).all(axis=(1, 2))
    return Finding(
        tuple(
            measured(f"amplitude over F_s at {1e6 * speed:g} µm/s, {name}, damping ratio "
                     f"{damping:g}", of_speed, "1", "")
            for damping, *both in zip(dampings, ageing, others, strict=True)
            for name, of_law in zip(("ageing", "no ageing"), both, strict=True)
            for speed, of_speed in zip(speeds, of_law, strict=True)
        ),
        verdict(bool(by_ageing.any()), qualified=not by_ageing.all()),
        f"with damping ratio {_listed(dampings[by_ageing])}; with "
        f"{_listed(dampings[~by_ageing])} the slider still oscillates at the highest velocity"
        if by_ageing.any() and not by_ageing.all()
        else "",
    )  # fmt: skip


@claim(
    "C22",
    "irregular motion lies between stick-slip and smooth sliding for some parameters",
    "with both numbers of contacts, in every realization: peaks of slips vary by less than a "
    "tenth at the lowest velocity, peaks and falls by more at the middle one (falls also if "
    "patterns of 2 or 3 cycles are allowed for), and sliding is smooth at the highest; for "
    "some damping, with a qualification unless for each",
    ("claims/sweeps/irregular",),
)
def irregular(trees: Sequence[xr.DataTree]) -> Finding:
    (tree,) = trees
    data = tree.to_dataset()
    order = ("slider.damping_ratio", "contacts.count", "drive.velocity", "realization")
    peaks, falls, amplitudes = (
        data[name].transpose(*order).values
        for name in ("peak_variation", "fall_irregularity", "relative_amplitude")
    )
    dampings = data["slider.damping_ratio"].values
    speeds = data["drive.velocity"].values
    slips = amplitudes > STICK_SLIP
    between = _everywhere((np.minimum(peaks, falls) > IRREGULAR) & slips)[:, 1]
    regular = _everywhere((peaks < IRREGULAR) & slips)
    smooth = _everywhere(amplitudes < SMOOTH)[:, 2]
    found = between & regular[:, 0] & smooth
    return Finding(
        (
            *(
                measured(f"variation of peaks at {1e6 * speed:g} µm/s, {count} contacts, damping "
                         f"ratio {damping:g}", values, "1", "")
                for damping, of_damping in zip(dampings, peaks, strict=True)
                for count, of_count in zip(data["contacts.count"].values, of_damping, strict=True)
                for speed, values in zip(speeds, of_count, strict=True)
                if np.isfinite(values).all()
            ),
            *(
                measured(f"maximum amplitude over F_s at {1e6 * speeds[2]:g} µm/s, damping ratio "
                         f"{damping:g}", of_damping[:, 2].max(), "1", "")
                for damping, of_damping in zip(dampings, amplitudes, strict=True)
            ),
        ),
        verdict(bool(found.any()), qualified=not found.all()),
        f"with damping ratio {_listed(dampings[found])}; with {_listed(dampings[~found])} the "
        "slider still oscillates at the highest velocity, or slips are not regular at the lowest"
        if found.any() and not found.all()
        else "",
    )  # fmt: skip


def _everywhere(is_so: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Whether it is so for each number of contacts and realization, shape (damping, velocity)."""
    return np.asarray(is_so.all(axis=(1, 3)))


def _listed(values: Array) -> str:
    return ", ".join(f"{one:g}" for one in values)
