"""How pictures look, what they are drawn into, and how they are saved."""

from __future__ import annotations

import textwrap
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import matplotlib as mpl
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure

from mesoslip.configuration import differences
from mesoslip.configuration.config import Config
from mesoslip.output.targets import written_whole

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
# Of the realizations behind the first one.
OTHERS: dict[str, Any] = {"color": "0.75", "linewidth": 0.5, "zorder": 1}
# Of outputs that are drawn over each other; all can be told apart by those who do not see red.
COLORS = ("black", "#d55e00", "#0072b2", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "0.6")

# Characters in a line of a title over an inch of axes.
CHARACTERS_PER_INCH = 16
# Keys that a caption names.
MOST_KEYS = 6


def plain(text: str) -> str:
    """A text that is shown as it is, whatever it holds, on a line."""
    return " ".join(text.split()).replace("$", r"\$")


def caption(tree: xr.DataTree) -> str:
    """What the run of an output changes of what it is based on."""
    base = tree.attrs.get("base_configuration")
    if base is None:
        return ""
    changes = differences.told(
        Config.from_toml(tree.attrs["configuration"]), Config.from_toml(base)
    )
    if len(changes) > MOST_KEYS:
        changes = [*changes[:MOST_KEYS], f"and {len(changes) - MOST_KEYS} keys more"]
    return ", ".join(changes)


def titles(
    axes: Axes,
    tree: xr.DataTree,
    about: str = "",
    *,
    mathematical: str = "",
    beside_legend: bool = False,
) -> None:
    """Write the title of an output over axes, and below it what it changes and what is shown.

    Parameters
    ----------
    axes, tree
        Where, and of which output.
    about
        What of it is shown.
    mathematical
        A last line that may have mathematical symbols.
    beside_legend
        Whether a line is left for a legend between title and axes.
    """
    title = tree.attrs.get("title", "")
    if tree.attrs.get("complete") == "false":
        title = f"{title} ({tree.attrs['comment']})"
    bounds = axes.get_subplotspec()
    figure = axes.figure
    width = figure.bbox.width / figure.dpi * (0.85 if bounds is None else _part(bounds))
    most = max(30, int(CHARACTERS_PER_INCH * width))
    lines = [
        textwrap.fill(plain(text), most, max_lines=2, placeholder=" …")
        for text in (title, caption(tree), about)
        if text
    ]
    lines += [mathematical] if mathematical else []
    lines += [""] if beside_legend else []
    axes.set_title("\n".join(lines), loc="left")


def _part(spec: Any) -> float:
    """Part of the width of a figure that axes of a grid have, about."""
    ratios = spec.get_gridspec().get_width_ratios()
    mine = ratios[spec.colspan.start : spec.colspan.stop]
    part: float = 0.9 * sum(mine) / sum(ratios)
    return part


def legend_above(axes: Axes, columns: int = 3, title: str | None = None) -> None:
    """Put the legend above axes, where it covers nothing."""
    axes.legend(
        loc="lower left",
        bbox_to_anchor=(0, 1.0),
        ncols=columns,
        borderaxespad=0.2,
        columnspacing=1.0,
        handlelength=1.6,
        title=title,
        title_fontsize=7,
        alignment="left",
    )


def shared_legend(figure: Canvas, axes: Axes) -> None:
    """Put a legend of what axes show below a figure, a line for each entry."""
    handles, labels = axes.get_legend_handles_labels()
    width = int(1.1 * CHARACTERS_PER_INCH * figure.bbox.width / figure.dpi)
    labels = [textwrap.fill(label, width) for label in labels]
    figure.legend(handles, labels, loc="outside lower left", ncols=1)


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
