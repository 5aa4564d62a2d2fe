"""Claims of the force curve and of the onset of slip: C2, C14."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from outputs import configuration
from scipy.signal import argrelextrema

from claims.base import Finding, claim, measured, verdict

if TYPE_CHECKING:
    import xarray as xr

# Scaled time of the onset in which its exponent is measured.
START = 0.03


@claim(
    "C2",
    "F(X) rises linearly, peaks near F_s - Delta F_s, and oscillates with decreasing amplitude "
    "(S18)",
    "linear within 1 % below F_s - 3 Delta F_s; peak within Delta F_s of that, with a "
    "qualification if not within a quarter of it; each oscillation smaller than the previous "
    "one",
    ("S18.curve",),
)
def force_curve(trees: Sequence[xr.DataTree]) -> Finding:
    (tree,) = trees
    contacts = configuration(tree).contacts
    data = tree.to_dataset()
    stretch = data["displacement"].values / contacts.break_stretch
    force = data["contact_force"].values / contacts.static_force
    width = contacts.threshold.relative_width
    early = (stretch > 0) & (stretch < 1 - 3 * width)
    deviation = np.max(np.abs(force[early] / stretch[early] - 1))
    (peaks,) = argrelextrema(force, np.greater)
    (valleys,) = argrelextrema(force, np.less)
    count = min(len(peaks), len(valleys), 4)
    if count == 0:
        return Finding((), verdict(False), "the force has no peak")
    oscillations = force[peaks[:count]] - force[valleys[:count]]
    peak = force[peaks[0]]
    return Finding(
        (
            measured(
                "deviation from Nk X below F_s - 3 Delta F_s",
                deviation,
                "1",
                "linear in the beginning",
            ),
            measured("peak over F_s", peak, "1", f"about {1 - width:g}"),
            measured(
                "each oscillation over the previous one",
                oscillations[1:] / oscillations[:-1],
                "1",
                "below 1",
            ),
        ),
        verdict(
            deviation < 0.01
            and abs(peak - (1 - width)) < width
            and bool(np.all(oscillations[1:] < oscillations[:-1])),
            abs(peak - (1 - width)) > width / 4,
        ),
        f"the peak is at F_s - {(1 - peak) / width:.2f} Delta F_s",
    )


@claim(
    "C14",
    "sequential breaking starts the drop of the force like t^3, instant melting like t^2 (S19)",
    "exponents for tau -> 0 within 0.1",
    ("S19a.onset", "S19b.onset"),
)
def onset(trees: Sequence[xr.DataTree]) -> Finding:
    found, ends = [], []
    for tree in trees:
        width = configuration(tree).contacts.threshold.relative_width
        ends.append((width, 2 / (tree.attrs["D1"] * tree.attrs["D2"])))
        for name, power in (("sequential", 3), ("melting", 2)):
            data = tree.children[name].to_dataset()
            tau, drop = data["onset_time"].values, -data["relative_force_drop"].values
            start = (tau > 0) & (tau < START)
            # The next term of the expansion makes the logarithm deviate in proportion to time.
            terms = np.stack(
                [np.log(tau[start]), tau[start], tau[start] ** 2, np.ones(start.sum())], axis=1
            )
            exponent = np.linalg.lstsq(terms, np.log(drop[start]), rcond=None)[0][0]
            found.append((name, power, width, exponent))
    return Finding(
        (
            *(
                measured(f"exponent, {name}, width {width:g}", exponent, "1", f"{power}")
                for name, power, width, exponent in found
            ),
            *(
                measured(f"tau at which t^4 takes over, width {width:g}", end, "1", "")
                for width, end in ends
            ),
        ),
        verdict(all(abs(exponent - power) < 0.1 for _, power, _, exponent in found), True),
        "the cubic start is short: after tau = 2/(D1 D2) the term D2 x^2 is larger, and the force "
        "falls faster than t^3",
    )
