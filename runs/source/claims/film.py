"""Claims of slip times of a film that melts as a whole and of contacts: C17, C18."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from claims.base import Finding, claim, measured, verdict

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]

# Viscosity over that of the bulk up to which a slip time must be unchanged, and by how much.
MAX_RATIO, NEARLY = 1e5, 0.1
# Changes of a slip time that are little.
LITTLE = 1.0


@claim(
    "C17",
    "only a film that melts as a whole needs a huge viscosity; with contacts that break one "
    "by one the slip time does not depend on it",
    "up to 1e5 times the viscosity of the bulk the duration of the first slip changes by less "
    "than a tenth for contacts, and by more for the film",
    ("claims/sweeps/film",),
)
def film(trees: Sequence[xr.DataTree]) -> Finding:
    (tree,) = trees
    data = tree.to_dataset()
    ratio = data["contacts.drag_rate"].values / data["contacts.drag_rate"].values[0]
    durations = data["mean_slip_duration"].transpose(
        "contacts.count", "contacts.drag_rate", "realization"
    )
    of_film, of_contacts = durations.values
    changes = [one.mean(axis=1) / one[0].mean() - 1 for one in (of_film, of_contacts)]
    moderate = ratio <= MAX_RATIO * (1 + 1e-9)
    largest = [np.abs(one[moderate]).max() for one in changes]
    means = durations.mean("realization").values[:, moderate]
    apart = np.abs(means[1] / means[0] - 1).max()
    names = ("film as a whole", f"{data['contacts.count'].values[1]} contacts")
    return Finding(
        (
            *(
                measured(f"duration of the first slip, {name}, {one:.0e} of the bulk", values, "s",
                         "")
                for name, all_values in zip(names, (of_film, of_contacts), strict=True)
                for one, values in zip(ratio, all_values, strict=True)
                if one in (ratio[0], ratio[3], ratio[4], ratio[5], ratio[7])
            ),
            measured("maximum change up to 1e5, film", largest[0], "1", "large"),
            measured("maximum change up to 1e5, contacts", largest[1], "1", "small"),
        ),
        verdict(bool(largest[1] < NEARLY and largest[0] > NEARLY)),
        f"the claim is false at this delay, 0.5 ms: up to 1e5 the slip times of both differ by at "
        f"most {100 * apart:.0f} % and depend on the viscosity alike. What counts is the share of "
        "contacts that are detached in the slip, which the delay sets; here, for the film as for "
        "contacts, half of them at the viscosity of the bulk and a quarter at 1e5. With a delay of "
        "0.02 ms the change at 1e5 is 5 % for contacts and 13 % for the film, a small difference "
        "of the kind claimed (docs/melting-film.md)",
    )  # fmt: skip


@claim(
    "C18",
    "the slip time grows with the dispersion of thresholds, a little",
    "the duration of the first slip grows with each width from 0.001 to 0.2, by less than a "
    "factor of two in all",
    ("claims/sweeps/slip-time",),
)
def dispersion(trees: Sequence[xr.DataTree]) -> Finding:
    (tree,) = trees
    data = tree.to_dataset()
    widths = data["contacts.threshold.relative_width"].values
    durations = data["mean_slip_duration"].transpose(
        "contacts.threshold.relative_width", "realization"
    ).values  # fmt: skip
    means = durations.mean(axis=1)
    growth = means[-1] / means[0] - 1
    return Finding(
        (
            *(
                measured(f"duration of the first slip, width {width:g}", values, "s", "")
                for width, values in zip(widths, durations, strict=True)
            ),
            measured("growth from the first to the last", growth, "1", "small"),
        ),
        verdict(bool(np.all(np.diff(means) > 0) and growth < LITTLE)),
        f"it grows by {100 * growth:.0f} % for two hundred times the width",
    )
