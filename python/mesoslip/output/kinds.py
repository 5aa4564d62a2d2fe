"""Which command an output is of."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import xarray as xr

from mesoslip.errors import FileError


class Kind(NamedTuple):
    """A kind of output: what it is called, and what tells it from others."""

    told: str
    is_of: Callable[[xr.DataTree], bool]


# Outputs of commands, the first that fits.
KINDS = {
    "run": Kind("a run", lambda tree: "spring_force" in tree.data_vars),
    "sweep": Kind("a sweep", lambda tree: "status" in tree.data_vars),
    "curve": Kind("a force curve", lambda tree: "slope" in tree.data_vars),
    "onset": Kind("an onset of slip", lambda tree: "stable" in tree.attrs),
    "fit": Kind("a fit", lambda tree: "posterior" in tree.children),
}


def kind_of(tree: xr.DataTree) -> str:
    """Which kind an output is of, a name of `KINDS`.

    Raises
    ------
    FileError
        If it is of none of them.
    """
    for name, kind in KINDS.items():
        if kind.is_of(tree):
            return name
    *others, last = (kind.told for kind in KINDS.values())
    raise FileError(f"the output is neither {', '.join(others)} nor {last}: it has no picture")


def kind_of_all(trees: Sequence[xr.DataTree], names: Sequence[str]) -> str:
    """Which kind outputs are of that go into one picture, or on one page.

    Raises
    ------
    FileError
        If they are of several kinds.
    """
    kinds = {kind_of(tree): name for tree, name in zip(trees, names, strict=True)}
    if len(kinds) > 1:
        found = ", ".join(f"{name} is {KINDS[kind].told}" for kind, name in kinds.items())
        raise FileError(f"outputs of different commands do not go together: {found}")
    return next(iter(kinds))
