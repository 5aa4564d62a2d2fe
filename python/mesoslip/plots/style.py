"""How pictures look, what they are drawn into, and how they are saved."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.figure import Figure, SubFigure

from mesoslip.output.files import written_whole

# What a picture is drawn into: a whole figure, or a part of one.
Canvas = Figure | SubFigure

STYLE: Any = {
    "font.size": 8,
    "axes.titlesize": 8,
    "axes.labelsize": 8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "legend.frameon": False,
    "legend.fontsize": 7,
    "lines.linewidth": 0.9,
    "figure.dpi": 200,
    "savefig.dpi": 200,
    "figure.constrained_layout.use": True,
}

# As in the source: the spring force in red and dashed, the contact force in black.
SPRING: dict[str, Any] = {"color": "tab:red", "linestyle": "--", "label": "spring force $F_d$"}
CONTACT: dict[str, Any] = {"color": "black", "label": "contact force $F$"}


_LOCK = threading.RLock()


@contextmanager
def styled() -> Iterator[None]:
    """Draw in this style, and leave that of the session as it was.

    The style is one of the whole process, so only one thread draws at a time.
    """
    with _LOCK, mpl.rc_context(STYLE):
        yield


def canvas(figure: Canvas | None, size: tuple[float, float]) -> Canvas:
    """The figure that is given, or else a new one of a size [inches]."""
    return Figure(figsize=size) if figure is None else figure


def save(figure: Canvas, path: Path) -> None:
    """Save a figure, or the whole that it is a part of.

    Raises
    ------
    FileError
        If it cannot be written, or its ending names no kind of picture.
    """
    whole = figure if isinstance(figure, Figure) else figure.figure
    with written_whole(path) as part, styled():
        whole.savefig(part)
