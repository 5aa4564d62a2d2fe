"""Claims of threshold laws and of kept thresholds, which other papers make: C25, C28."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from mesoslip.theory.force_curve import ForceCurve
from numpy.typing import NDArray
from outputs import configuration

from claims.base import Finding, claim, measured, variable, verdict

if TYPE_CHECKING:
    import xarray as xr

# Relative widths of uniform laws; the last one has the weakest contacts at a hundredth of the mean.
WIDTHS = (0.1, 0.2, 0.3, 0.4, 0.5, 0.57)
# Changes of a loop that is stable, and of one that shakes down, from the first cycle to the last.
STABLE, SHAKEN = 1e-3, 0.1


@claim(
    "C25",
    "the ratio of static peak to steady force of uniform laws falls with their width to 1.155 at "
    "about 0.3, and rises again to 1.159 at 0.57 (Farkas, Dahmen and Wolf 2005 have 1 to 2, "
    "falling)",
    "each within 0.002, the least ratio at a width from 0.25 to 0.45; one stiffness, no back force",
    ("S18.curve",),
)
def peak_over_steady(trees: Sequence[xr.DataTree]) -> Finding:
    base = configuration(trees[0])
    ratio = {}
    for width in WIDTHS:
        law = {"law": "uniform", "relative_width": width}
        curve = ForceCurve(base.replace({"contacts.threshold": law})).summary()
        peak, steady = curve["F_peak"], curve["F_steady"]
        assert isinstance(peak, float)
        assert isinstance(steady, float)
        ratio[width] = peak / steady
    lowest = min(ratio, key=ratio.__getitem__)
    source = {0.1: "at most 2", 0.3: "1.155", 0.57: "1.159"}
    return Finding(
        tuple(
            measured(f"F_peak/F_steady at the width {width:g}", ratio[width], "1", text)
            for width, text in source.items()
        ),
        verdict(
            abs(ratio[0.3] - 1.155) < 2e-3
            and abs(ratio[0.57] - 1.159) < 2e-3
            and 0.25 < lowest < 0.45
            and ratio[0.57] > ratio[lowest],
        ),
        "the ratio does not go on falling: contacts of wide laws are weak and strong at once, and "
        "the steady force, which strong contacts bear, no longer grows faster than the peak",
    )


@claim(
    "C28",
    "under small strokes loops of contacts that keep their thresholds are stable (Iwan's model), "
    "and shake down if thresholds are drawn again",
    "the loop of the last cycle within 0.1 % of the first, and within 10 % of "
    "4 sum k x_s (A - x_s); below a tenth of the first with thresholds that are drawn again; "
    "amplitude 0.3 F_s/(N k), uniform law of width 0.55",
    ("claims/loops-keep", "claims/loops-redraw"),
)
def loops(trees: Sequence[xr.DataTree]) -> Finding:
    kept, drawn = (_loops(tree) for tree in trees)
    config = configuration(trees[0])
    contacts, cycle = config.contacts, config.drive.cycle
    assert cycle is not None
    strength = contacts.threshold.above(0.0).quantile((np.arange(20_000) + 0.5) / 20_000)
    reach = cycle.amplitude / contacts.break_stretch
    slipped = np.where(strength < reach, strength * (reach - strength), 0.0)
    iwan = 4 * contacts.static_force * contacts.break_stretch * float(np.mean(slipped))
    last, first = kept[:, -1], kept[:, 0]
    shaken = drawn[:, -1] / drawn[:, 0]
    return Finding(
        (
            measured("loop of the last cycle over the first, kept", last / first, "1", "1"),
            measured("loop over that of Iwan's model, kept", last / iwan, "1", "1"),
            measured("loop of the last cycle over the first, drawn again", shaken, "1", "shrinks"),
        ),
        verdict(
            bool(np.all(np.abs(last / first - 1) < STABLE))
            and abs(float(np.mean(last)) / iwan - 1) < 0.1
            and bool(np.all(np.abs(shaken) < SHAKEN))
        ),
        "contacts that are drawn stronger than the stroke reaches stay pinned",
    )


def _loops(tree: xr.DataTree) -> NDArray[np.float64]:
    """Energy of each whole cycle of a drive back and forth, for each realization [J]."""
    x, force = variable(tree, "displacement"), variable(tree, "contact_force")
    ends = np.flatnonzero(np.isclose(x[0], np.max(x[0]), rtol=1e-6, atol=0))
    return np.array(
        [
            np.trapezoid(force[:, first : last + 1], x[:, first : last + 1], axis=1)
            for first, last in itertools.pairwise(ends)
        ]
    ).T
