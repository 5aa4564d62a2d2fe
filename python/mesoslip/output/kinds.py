"""Kinds of outputs, one for each command.

A new kind needs a line here, a default view of the same name in `mesoslip.plots.views`, and its
sections in `mesoslip.reports.sections`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

from mesoslip.errors import FileError
from mesoslip.output.arrays import Tree
from mesoslip.output.variables import has_force


class Kind(NamedTuple):
    """A kind of output: its name with an article, and a test whether an output is of it."""

    description: str
    is_of: Callable[[Tree], bool]


# The first kind whose test holds is that of an output.
KINDS = {
    "run": Kind("a run", lambda tree: has_force(tree.data_vars)),
    "sweep": Kind("a sweep", lambda tree: "status" in tree.data_vars),
    "cycle": Kind("a cycle", lambda tree: "settled_motion" in tree.attrs),
    "branches": Kind("branches of cycles", lambda tree: "continued_key" in tree.attrs),
    "steady": Kind(
        "steady sliding over velocity", lambda tree: "critical_stiffness" in tree.data_vars
    ),
    "curve": Kind("a force curve", lambda tree: "slope" in tree.data_vars),
    "onset": Kind("an onset of slip", lambda tree: "stable" in tree.attrs),
    "lyapunov": Kind("a Lyapunov exponent", lambda tree: "lyapunov_exponent" in tree.data_vars),
    "rates": Kind("a posterior of rates and states", lambda tree: "laws" in tree.attrs),
    "fit": Kind("a fit", lambda tree: "posterior" in tree.children),
}


def kind_of(tree: Tree) -> str:
    """The kind of an output, a name in `KINDS`."""
    for name, kind in KINDS.items():
        if kind.is_of(tree):
            return name
    *others, last = (kind.description for kind in KINDS.values())
    raise FileError(f"the output is neither {', '.join(others)} nor {last}: it has no picture")


def kind_of_all(trees: Sequence[Tree], names: Sequence[str]) -> str:
    """The kind of outputs for one picture or page; raises a `FileError` if there are several."""
    kinds = {kind_of(tree): name for tree, name in zip(trees, names, strict=True)}
    if len(kinds) > 1:
        found = ", ".join(f"{name} is {KINDS[kind].description}" for kind, name in kinds.items())
        raise FileError(f"outputs of different commands cannot be combined: {found}")
    return next(iter(kinds))
