"""The views: a file each, with its `View` in the variable ``VIEW``.

Adding one is adding a file to this folder, and its name to the build.
"""

from __future__ import annotations

import pkgutil
from importlib import import_module

from mesoslip.array_types import DataTree
from mesoslip.errors import ConfigError, FileError, Problem
from mesoslip.output.arrays import Tree
from mesoslip.output.kinds import KINDS, kind_of
from mesoslip.plots.views.base import Options, View

VIEWS: tuple[View, ...] = tuple(
    import_module(f"{__name__}.{file.name}").VIEW
    for file in pkgutil.iter_modules(__path__)
    if file.name != "base"
)


def names_of_views(kind: str) -> list[str]:
    """Names of the views of a kind of output, the default view first."""
    names = {view.name for view in VIEWS if view.kind == kind}
    return sorted(names, key=lambda name: (name != kind, name))


def takes_arrays(tree: Tree, name: str | None) -> bool:
    """Whether the view of an output can be drawn without xarray."""
    return any(
        KINDS[one.kind].is_of(tree)
        for one in VIEWS
        if one.takes_arrays and one.name == (name or one.kind)
    )


def view_of(tree: DataTree, name: str | None, options: Options) -> View:
    """The view of an output, by default that of its kind, which has the options."""
    kind = kind_of(tree)
    there = [one for one in VIEWS if one.kind == kind and one.name == (name or kind)]
    if not there:
        if any(one.name == name for one in VIEWS):
            raise FileError(f"the output is {KINDS[kind].description}: it has no view {name!r}")
        choice = ", ".join(names_of_views(kind))
        text = f"no such view of {KINDS[kind].description}; choose from {choice}"
        raise ConfigError.of("view", text, name)
    view = next((one for one in there if one.applies(tree)), there[0])
    unknown = options.given - view.options
    if unknown:
        text = f"no option of the view {view.name!r} of {KINDS[kind].description}"
        raise ConfigError([Problem("", one, text) for one in sorted(unknown)])
    return view
