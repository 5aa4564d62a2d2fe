"""The figures of Braun's "Stick-slip kinetics", from the outputs of the runs of the same names.

Adding one is a function and a line in the module of its topic, and its runs in ``runs/source``.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from mesoslip.plots.style import save, styled
from outputs import chosen, opened

from figures import avalanches, interaction, motion, theory
from figures.base import add_caption, caption

FIGURES = theory.FIGURES | motion.FIGURES | interaction.FIGURES | avalanches.FIGURES


def draw(names: Iterable[str], outputs: Path, folder: Path) -> list[Path]:
    """Draw figures, all by default, from the outputs of their runs.

    Returns
    -------
    list of pathlib.Path
        The pictures, ``NAME.png`` in the folder.

    Raises
    ------
    ConfigError
        If there is no such figure.
    FileError
        If the output of a run is missing.
    """
    wanted = chosen(names, FIGURES, "figure", outputs)
    paths = []
    for name, one in wanted.items():
        with opened(one.runs, outputs) as trees, styled():
            figure = one.draw(trees)
            add_caption(figure, caption(name, one.shows, trees))
        path = folder / f"{name}.png"
        save(figure, path)
        paths.append(path)
    return paths
