"""Style of pictures: colours, titles, legends, figures and files."""

from __future__ import annotations

import textwrap
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure

from mesoslip.configuration.config import Config
from mesoslip.output.arrays import Tree
from mesoslip.output.targets import written_whole
from mesoslip.plots.key_names import changes_in_a_line, plain, shown_length
from mesoslip.plots.printing import current, is_narrow, size_of

# A whole figure, or a part of one.
Canvas = Figure | SubFigure

# Paul Tol's high-contrast colours, which differ in lightness too (the file mesoslip.mplstyle).
RED, YELLOW, BLUE = "#bb5566", "#ddaa33", "#004488"
# As in the source: the spring force in red and dashed, the contact force in black.
SPRING: dict[str, Any] = {"color": RED, "linestyle": "--", "label": "spring force $F_d$"}
CONTACT: dict[str, Any] = {"color": "black", "label": "contact force $F$"}
# Realizations behind the first one.
OTHERS: dict[str, Any] = {"color": "0.75", "linewidth": 0.5, "zorder": 1}
# Measured points with errors.
POINTS: dict[str, Any] = {"fmt": "o", "color": "black", "markersize": 3}
# A law fitted to a record, as a broad line below it that does not hide its peaks.
FITTED: dict[str, Any] = {"color": RED, "linewidth": 2.4, "alpha": 0.6, "zorder": 1.5}
# Characters in an inch of a line of the size 8.
CHARACTERS_PER_INCH = 16
# Width of the ticks and labels beside axes [inch].
BESIDE_AXES = 0.6
# Height of the ticks and labels below axes [inch].
BELOW_AXES = 0.3


def titles(
    axes: Axes,
    tree: Tree,
    about: str = "",
    *,
    mathematical: str = "",
    beside_legend: bool = False,
) -> None:
    """Write the title of an output over axes, and below it its changes from its base in a line.

    A line about what is shown may follow, and a last one with formulas. `beside_legend` leaves room
    for a legend between title and axes.
    """
    width = axes_width(axes)
    title, changes = headings(tree, characters(width))
    lines = [wrapped(title, width, max_lines=2), changes, wrapped(about, width, max_lines=2)]
    lines = [one for one in lines if one]
    lines += [mathematical] if mathematical else []
    lines += [""] * legend_rows(axes) if beside_legend else []
    axes.set_title("\n".join(lines), loc="left")


def write_title(axes: Axes, text: str) -> None:
    """Write a title, which may have symbols, in as many lines as it needs over axes."""
    axes.set_title(wrapped(text, axes_width(axes)), loc="left")


def headings(tree: Tree, room: int) -> tuple[str, str]:
    """The title of an output and its changes from its base, as far as they fit into a number of
    characters; empty if the picture has a title."""
    if current().title is not None:
        return "", ""
    title = tree.attrs.get("title", "")
    if tree.attrs.get("complete") == "false":
        title = f"{title} ({tree.attrs['comment']})"
    base = tree.attrs.get("base_configuration")
    if base is None:
        return plain(title), ""
    config = Config.from_toml(tree.attrs["configuration"])
    return plain(title), changes_in_a_line(config, Config.from_toml(base), room)


def filled(text: str, width: float, max_lines: int | None = None) -> str:
    """A text in lines of a width [inch], without symbols of mathematics."""
    return wrapped(plain(text), width, max_lines)


def wrapped(text: str, width: float, max_lines: int | None = None) -> str:
    """A text, which may have symbols such as $v_d$, in lines of a width [inch]."""
    # A number and its error stay in one line.
    joined = text.replace(" ± ", "\N{NO-BREAK SPACE}±\N{NO-BREAK SPACE}")
    room = max(20, characters(width))
    lines = textwrap.fill(joined, room, max_lines=max_lines, placeholder=" …")
    return lines.replace("\N{NO-BREAK SPACE}", " ")


def characters(width: float) -> int:
    """Characters in a line of a width [inch]."""
    return int(CHARACTERS_PER_INCH * width * 8 / mpl.rcParams["font.size"])


def axes_width(axes: Axes) -> float:
    """Approximate width of axes [inch]."""
    bounds, figure = axes.get_subplotspec(), axes.figure
    whole = figure.bbox.width / figure.figure.dpi
    if bounds is None:
        return 0.85 * whole
    ratios: Any = bounds.get_gridspec().get_width_ratios()
    width = 0.9 * sum(ratios[bounds.colspan.start : bounds.colspan.stop]) / sum(ratios) * whole
    return float(min(width, width / 0.9 - BESIDE_AXES))


def axes_height(axes: Axes) -> float:
    """Approximate height of axes without the labels below them [inch]."""
    bounds, figure = axes.get_subplotspec(), axes.figure
    whole = figure.bbox.height / figure.figure.dpi
    if bounds is None:
        return 0.75 * whole
    rows: Any = bounds.get_gridspec().nrows
    return float(max(0.75 * len(bounds.rowspan) / rows * whole - BELOW_AXES, BELOW_AXES))


def legend_above(axes: Axes, columns: int = 3, title: str | None = None) -> None:
    """Put the legend above axes, where it hides no data, in up to a number of columns."""
    if title is None and not axes.get_legend_handles_labels()[0]:
        # Nothing was drawn, as of a damaged output.
        return
    axes.legend(
        loc="lower left",
        bbox_to_anchor=(0, 1.0),
        ncols=_legend_columns(axes, columns),
        borderaxespad=0.2,
        columnspacing=1.0,
        handlelength=1.6,
        title=title,
        alignment="left",
    )


def _legend_columns(axes: Axes, columns: int = 3) -> int:
    """Number of columns of a legend that fit above axes."""
    # A line and its distance take five characters.
    labels = axes.get_legend_handles_labels()[1]
    lengths = [shown_length(one) + 5 for one in labels]
    room = 1.15 * characters(axes_width(axes))
    for count in range(min(columns, len(labels)), 1, -1):
        rows = -(-len(labels) // count)
        widths = [max(lengths[at : at + rows]) for at in range(0, len(lengths), rows)]
        if sum(widths) <= room:
            return count
    return 1


def legend_rows(axes: Axes) -> int:
    labels = axes.get_legend_handles_labels()[1]
    return -(-len(labels) // _legend_columns(axes))


def shared_legend(figure: Canvas, axes: Axes) -> None:
    """Put the legend of axes below a figure, a line for each entry."""
    handles, labels = axes.get_legend_handles_labels()
    width = 1.05 * figure.bbox.width / figure.figure.dpi - 0.3
    labels = [wrapped(label, width) for label in labels]
    figure.legend(handles, labels, loc="outside lower left", ncols=1)


def curve_style(number: int) -> dict[str, Any]:
    """Colour and dashes of one of several curves, as the style has them."""
    styles = list(mpl.rcParams["axes.prop_cycle"])
    return dict(styles[number % len(styles)])


def curve_color(number: int) -> Any:
    """Colour of one of several curves."""
    return curve_style(number).get("color", "black")


_LOCK = threading.RLock()


@contextmanager
def styled() -> Iterator[None]:
    """Draw in the style of mesoslip, one thread at a time, and restore matplotlib's one style of
    the session."""
    with _LOCK, mpl.rc_context(current().settings):
        yield


def canvas(figure: Canvas | None, size: tuple[float, float]) -> Canvas:
    """The given figure, or a new one of the size of a view [inch] or of print."""
    return Figure(figsize=size_of(size)) if figure is None else figure


def side_by_side(
    figure: Canvas | None, size: tuple[float, float], count: int = 2
) -> tuple[Canvas, list[Axes]]:
    """A figure of a size [inch] with panels beside each other, or below each other if narrow."""
    if count > 1 and is_narrow(figure):
        figure = canvas(figure, (3.4, 0.85 * count * size[1]))
        return figure, list(figure.subplots(count, 1))
    figure = canvas(figure, size)
    return figure, list(figure.subplots(1, count, squeeze=False)[0])


def save(figure: Canvas, path: Path) -> None:
    """Save a figure; of a part of one, the whole figure."""
    whole = figure if isinstance(figure, Figure) else figure.figure
    with written_whole(path) as part, styled():
        whole.savefig(part)
