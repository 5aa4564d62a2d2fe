"""Claims of the regime of the motion, and of avalanches: C6, C10, C12, C19."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from mesoslip.analysis.regime.outputs import regimes
from mesoslip.output.access import group_of
from outputs import configuration

from claims.base import Finding, claim, measured, variable, verdict
from claims.slips import of_each

if TYPE_CHECKING:
    import xarray as xr

SMOOTH, STICK_SLIP, IRREGULAR = 0, 1, 2


def motion(tree: xr.DataTree) -> str:
    """Regimes of the realizations of a run at its end, in words."""
    data = regimes(tree)["regime"]
    meanings = data.attrs["flag_meanings"].split()
    found, counts = np.unique(data.values, return_counts=True)
    return ", ".join(f"{count} {meanings[code]}" for code, count in zip(found, counts, strict=True))


def all_are(tree: xr.DataTree, *expected: int) -> bool:
    """Whether all realizations are in one of some regimes."""
    return bool(np.isin(regimes(tree)["regime"].values, expected).all())


def peak_to_peak(tree: xr.DataTree) -> list[float]:
    """Peak-to-peak spring force over its mean in the last fifth of each realization."""
    force = variable(tree, "spring_force")
    end = force[:, -force.shape[1] // 5 :]
    return [float(np.ptp(one) / abs(one.mean())) for one in end]


@claim(
    "C6",
    "without delay sliding becomes smooth although K << K*; with a long one the slider sticks "
    "and slips (S22)",
    "in the end, after 400, 200, 100 and 100 s: oscillation below a tenth of the mean without "
    "delay, smooth at 0.1 ms, stick-slip or irregular at 0.5 and 10 ms, in every realization",
    tuple(f"claims/delay-{one}" for one in ("0", "0.1", "0.5", "10")),
)
def delay(trees: Sequence[xr.DataTree]) -> Finding:
    delays = [configuration(tree).contacts.delay * 1e3 for tree in trees]
    return Finding(
        tuple(
            measured(f"oscillation over mean, delay {one:g} ms", peak_to_peak(tree), "1", source)
            for one, tree, source in zip(
                delays, trees, ("smooth", "smooth", "stick-slip", "stick-slip"), strict=True
            )
        ),
        verdict(
            max(peak_to_peak(trees[0])) < 0.1
            and all_are(trees[1], SMOOTH)
            and all(all_are(tree, STICK_SLIP, IRREGULAR) for tree in trees[2:])
        ),
        "in the end: "
        + "; ".join(f"{one:g} ms: {motion(tree)}" for one, tree in zip(delays, trees, strict=True)),
    )


@claim(
    "C10",
    "interaction widens the range of stick-slip; at xi = 0.3 one avalanche spans the whole "
    "system and F falls abruptly to about zero (S25 to S27)",
    "smooth at xi = 0, not at 0.3; there an avalanche of more than 90 % of N, and F below 5 % "
    "of F_s, in every realization",
    tuple(f"claims/interaction-{one}" for one in ("0", "0.03", "0.1", "0.3")),
)
def interaction(trees: Sequence[xr.DataTree]) -> Finding:
    found, largest = [], []
    for tree in trees:
        interaction = configuration(tree).interaction
        strength = 0.0 if interaction is None else interaction.strength
        data = group_of(tree, "avalanches")
        owner, size = data["realization_index"].values, data["size"].values
        count = configuration(tree).contacts.count
        parts = [size[owner == one].max() / count for one in range(tree.sizes["realization"])]
        largest.append(min(parts))
        found.append(
            measured(f"oscillation over mean, xi = {strength:g}", peak_to_peak(tree), "1", "")
        )
        found.append(measured(f"largest avalanche over N, xi = {strength:g}", parts, "1", ""))
    minimum = variable(trees[-1], "contact_force").min(axis=1)
    static = configuration(trees[-1]).contacts.static_force
    return Finding(
        (*found, measured("minimum F over F_s, xi = 0.3", minimum / static, "1", "about 0")),
        verdict(
            all_are(trees[0], SMOOTH)
            and all_are(trees[-1], STICK_SLIP, IRREGULAR)
            and largest[-1] > 0.9
            and bool(np.all(minimum < 0.05 * static))
        ),
        "in the end: " + "; ".join(motion(tree) for tree in trees),
    )


@claim(
    "C19",
    "the mean size of avalanches grows with the strength of the interaction (S26)",
    "from xi = 0 over 0.03 and 0.1 to 0.3 it grows each time, with separate ranges of the "
    "realizations; so does the mean over breaks of the size of their avalanche",
    tuple(f"claims/interaction-{one}" for one in ("0", "0.03", "0.1", "0.3")),
)
def avalanche_size(trees: Sequence[xr.DataTree]) -> Finding:
    strengths, means, weighted = [], [], []
    for tree in trees:
        interaction = configuration(tree).interaction
        strengths.append(0.0 if interaction is None else interaction.strength)
        data = group_of(tree, "avalanches")
        owner, size = data["realization_index"].values, data["size"].values
        parts = [size[owner == one] for one in range(tree.sizes["realization"])]
        means.append(np.array([one.mean() for one in parts]))
        weighted.append(np.array([np.sum(one**2.0) / np.sum(one) for one in parts]))
    return Finding(
        tuple(
            measured(f"{quantity}, xi = {strength:g}", values, "1", "larger for larger xi")
            for quantity, all_values in (
                ("mean size of avalanches", means),
                ("mean size of the avalanche of a break", weighted),
            )
            for strength, values in zip(strengths, all_values, strict=True)
        ),
        verdict(
            all(
                weak.max() < strong.min()
                for all_values in (means, weighted)
                for weak, strong in pairwise(all_values)
            )
        ),
        "",
    )


@claim(
    "C12",
    "F_d against v_d t does not depend on v_d in slow drives; at high v_d sliding is smooth",
    "peaks and periods at 0.02 to 0.2 µm/s scatter as realizations do; smooth at 300 µm/s",
    (
        *(
            "claims/velocity-0.02",
            "claims/velocity-0.05",
            "claims/klein",
            "claims/velocity-0.2",
        ),
        *(f"claims/velocity-{one}" for one in (1, 10, 30, 100, 300)),
    ),
)
def velocity(trees: Sequence[xr.DataTree]) -> Finding:
    slow, fast = trees[:4], trees[4:]
    speeds = [configuration(tree).drive_speed * 1e6 for tree in trees]
    peaks = [of_each(tree, lambda one: one["force_before"].values[1:].mean()) for tree in slow]
    distances = [
        of_each(tree, lambda one: one["waiting_time"].values[2:].mean()) * speed * 1e-6
        for tree, speed in zip(slow, speeds, strict=False)
    ]
    means = [np.array([one.mean() for one in all_values]) for all_values in (peaks, distances)]
    errors = [
        np.sqrt(np.mean([one.var(ddof=1) / one.size for one in all_values]))
        for all_values in (peaks, distances)
    ]
    # All four agree if they scatter like means of five realizations do.
    is_universal = all(
        np.std(mean, ddof=1) < 2 * error for mean, error in zip(means, errors, strict=True)
    )
    return Finding(
        (
            *(
                measured(f"mean peak at {speed:g} µm/s", one, "N", "the same")
                for speed, one in zip(speeds, peaks, strict=False)
            ),
            *(
                measured(
                    f"displacement of the drive in a period at {speed:g} µm/s",
                    one,
                    "m",
                    "the same",
                )
                for speed, one in zip(speeds, distances, strict=False)
            ),
            *(
                measured(
                    f"oscillation over mean at {speed:g} µm/s",
                    peak_to_peak(tree),
                    "1",
                    "smooth at high",
                )
                for speed, tree in zip(speeds[4:], fast, strict=True)
            ),
        ),
        verdict(is_universal and all_are(fast[-1], SMOOTH), True),
        "over a decade of slow drives peaks and periods agree within their scatter. With "
        "increasing velocity the oscillation grows before sliding becomes smooth: where the force "
        "falls with velocity through the delay, the slider oscillates at Omega_S around steady "
        "sliding; in the end: "
        + "; ".join(
            f"{speed:g} µm/s: {motion(tree)}" for speed, tree in zip(speeds[4:], fast, strict=True)
        ),
    )
