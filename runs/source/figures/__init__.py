"""The figures of Braun's "Stick-slip kinetics", from the outputs of the runs of the same names.

Adding one is a function in a module of this folder, and its runs in ``runs/source``.
"""

from __future__ import annotations

import pkgutil
from collections.abc import Iterable
from importlib import import_module
from pathlib import Path

from mesoslip.plots.style import save, styled
from outputs import chosen, opened

from figures import base

for _module in pkgutil.iter_modules(__path__):
    import_module(f"figures.{_module.name}")
FIGURES = dict(sorted(base.FIGURES.items()))


def draw(names: Iterable[str], outputs: Path, folder: Path) -> list[Path]:
    """Draw figures, all by default, from the outputs of their runs; returns the pictures."""
    paths = []
    for name, one in chosen(names, FIGURES, "figure", outputs).items():
        with opened(one.runs, outputs) as trees, styled():
            figure = one.draw(trees)
            base.add_caption(figure, base.caption(name, one.shows, trees))
        path = folder / f"{name}.png"
        save(figure, path)
        paths.append(path)
    return paths
