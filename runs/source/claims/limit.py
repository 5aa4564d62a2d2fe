"""The claim that N contacts and the master equation agree: C13."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from outputs import configuration

from claims.base import Finding, claim, measured, variable, verdict
from claims.slips import of_each

if TYPE_CHECKING:
    import xarray as xr


@claim(
    "C13",
    "EQ and the master equation give the same results",
    "difference like N^(-1/2), exponent within 0.05; the first slip's drop within 1 %",
    (
        *("claims/klein", "claims/klein-me", "limit-me"),
        *(f"limit-{power}" for power in range(2, 7)),
    ),
)
def engines(trees: Sequence[xr.DataTree]) -> Finding:
    klein, klein_infinite, infinite, *finite = trees
    exact = variable(infinite, "contact_force")[0]
    counts, errors = [], []
    for tree in finite:
        contacts = configuration(tree).contacts
        counts.append(contacts.count)
        deviation = (variable(tree, "contact_force") - exact) / contacts.static_force
        errors.append(np.sqrt(np.mean(deviation**2, axis=1)))
    means = np.array([one.mean() for one in errors])
    slope = np.polyfit(np.log(counts), np.log(means), 1)[0]
    drops = [
        of_each(tree, lambda one: one["force_drop"].values[0]) for tree in (klein, klein_infinite)
    ]
    return Finding(
        (
            *(
                measured(f"rms difference over F_s, N = {count}", one, "1", "the same")
                for count, one in zip(counts, errors, strict=True)
            ),
            measured("exponent of the difference in N", slope, "1", "-1/2 expected"),
            measured("drop in Klein's first slip, N = 4080", drops[0], "N", "the same"),
            measured("drop in Klein's first slip, N → ∞", drops[1], "N", "the same"),
        ),
        verdict(abs(slope + 0.5) < 0.05 and abs(drops[0].mean() / drops[1].mean() - 1) < 0.01),
        "under a prescribed slider that moves forth and back the difference decreases like "
        "N^(-1/2). After several free slips the difference is that between realizations: the "
        "motion is chaotic",
    )
