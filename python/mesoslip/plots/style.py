"""Style of pictures: colours, titles, legends, figures and files."""

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

# A whole figure, or a part of one.
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
# Realizations behind the first one.
OTHERS: dict[str, Any] = {"color": "0.75", "linewidth": 0.5, "zorder": 1}
# Outputs over each other; all can be distinguished without seeing red.
COLORS = ("black", "#d55e00", "#0072b2", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "0.6")

# Characters in a line of a title over an inch of axes.
CHARACTERS_PER_INCH = 16
# Changed keys that a caption names.
MAX_KEYS = 6


def plain(text: str) -> str:
    """A text on one line, with dollars as they are and not as formulas."""
    return " ".join(text.split()).replace("$", r"\$")


def caption(tree: xr.DataTree) -> str:
    """The changes of a run from its base."""
    base = tree.attrs.get("base_configuration")
    if base is None:
        return ""
    changes = differences.changes(
        Config.from_toml(tree.attrs["configuration"]), Config.from_toml(base)
    )
    if len(changes) > MAX_KEYS:
        changes = [*changes[:MAX_KEYS], f"and {len(changes) - MAX_KEYS} more keys"]
    return ", ".join(changes)


def titles(
    axes: Axes,
    tree: xr.DataTree,
    about: str = "",
    *,
    mathematical: str = "",
    beside_legend: bool = False,
) -> None:
    """Write the title of an output over axes, and below it its changes from its base.

    Parameters
    ----------
    axes, tree
        Where, and of which output.
    about
        A further line, such as the realizations that are shown.
    mathematical
        A last line that may have formulas.
    beside_legend
        Whether a line is left for a legend between title and axes.
    """
    title = tree.attrs.get("title", "")
    if tree.attrs.get("complete") == "false":
        title = f"{title} ({tree.attrs['comment']})"
    bounds = axes.get_subplotspec()
    figure = axes.figure
    width = figure.bbox.width / figure.dpi * (0.85 if bounds is None else _part(bounds))
    max_characters = max(30, int(CHARACTERS_PER_INCH * width))
    lines = [
        textwrap.fill(plain(text), max_characters, max_lines=2, placeholder=" …")
        for text in (title, caption(tree), about)
        if text
    ]
    lines += [mathematical] if mathematical else []
    lines += [""] if beside_legend else []
    axes.set_title("\n".join(lines), loc="left")


def _part(spec: Any) -> float:
    """Approximate width of axes of a grid over that of the figure."""
    ratios = spec.get_gridspec().get_width_ratios()
    own = ratios[spec.colspan.start : spec.colspan.stop]
    part: float = 0.9 * sum(own) / sum(ratios)
    return part


def legend_above(axes: Axes, columns: int = 3, title: str | None = None) -> None:
    """Put the legend above axes, where it hides no data."""
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
    """Put the legend of axes below a figure, a line for each entry."""
    handles, labels = axes.get_legend_handles_labels()
    width = int(1.1 * CHARACTERS_PER_INCH * figure.bbox.width / figure.dpi)
    labels = [textwrap.fill(label, width) for label in labels]
    figure.legend(handles, labels, loc="outside lower left", ncols=1)


_LOCK = threading.RLock()


@contextmanager
def styled() -> Iterator[None]:
    """Draw in this style; that of the session stays as it was.

    Matplotlib has one style for the whole process, so only one thread draws at a time.
    """
    with _LOCK, mpl.rc_context(STYLE):
        yield


def canvas(figure: Canvas | None, size: tuple[float, float]) -> Canvas:
    """The given figure, or a new one of a size [inch] if it is None."""
    return Figure(figsize=size) if figure is None else figure


def save(figure: Canvas, path: Path) -> None:
    """Save a figure; of a part of one, the whole figure.

    Raises
    ------
    FileError
        If it cannot be written, or its ending is no known format.
    """
    whole = figure if isinstance(figure, Figure) else figure.figure
    with written_whole(path) as part, styled():
        whole.savefig(part)
