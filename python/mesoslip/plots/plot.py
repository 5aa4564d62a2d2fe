"""Draw outputs, and save the picture."""

from __future__ import annotations

import itertools
import math
import operator
import string
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Literal

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.backend_bases import FigureCanvasBase
from matplotlib.figure import Figure, SubFigure
from matplotlib.ticker import MaxNLocator

from mesoslip.configuration import arguments
from mesoslip.configuration.reading import PathLike, as_path
from mesoslip.configuration.units import to_si
from mesoslip.errors import ConfigError, FileError
from mesoslip.output.inputs import OutputLike, opened, several
from mesoslip.plots.draw import draw, movie_of
from mesoslip.plots.extent import Extent
from mesoslip.plots.movie import ENDINGS, write
from mesoslip.plots.printing import JOURNALS, UNLETTERED, Print, current, printed, width_of
from mesoslip.plots.style import Canvas, filled, save, styled
from mesoslip.plots.views import takes_arrays
from mesoslip.plots.views.base import Options

# Ticks of an axis that has no room for more.
FEW_TICKS = 3


@arguments.checked(
    view=arguments.text, x=arguments.text, title=arguments.text, letters=arguments.flag
)
def plot(
    output: OutputLike | Sequence[OutputLike],
    file: PathLike | None = None,
    *,
    view: str | None = None,
    snapshot: int | None = None,
    realization: int | None = None,
    start: float | str = -math.inf,
    end: float | str = math.inf,
    x: str | None = None,
    period: float | str | None = None,
    figure: Figure | SubFigure | None = None,
    ax: Axes | None = None,
    width: float | str | None = None,
    font_size: float | None = None,
    title: str | None = None,
    letters: bool = False,
    style: PathLike | None = None,
    progress: Callable[[float], None] | None = None,
) -> Figure | SubFigure:
    """Draw an output of any command, or several of one command over each other.

    Of a run: force, velocity and detached contacts, with the largest slip beside them; of a slider
    without inertia: force and avalanches; of a force curve: the force and its slope; of an onset of
    slip: the drop of the spring force. The title has the run's changes from its base, the legend of
    several outputs their differences.

    Parameters
    ----------
    output
        The output, or several.
    file
        Where to save the picture; nowhere by default. If its name ends in ``.gif`` or ``.mp4`` it
        is a movie: of the view "layers", "contacts", or "lattice", which shows the avalanche that
        spreads before a snapshot, or all snapshots; by default of the first that the output has.
    view
        View of a run, such as "avalanches" for their sizes, "lattice" and "contacts" for a
        snapshot, "layers" for the waves in an elastic slider, "response" for steady forces,
        velocity steps and holds; or measure of a sweep.
    snapshot
        Number of the snapshot; that after the largest avalanche by default.
    realization
        Number of the realization of a run; by default the first one, with others behind it.
    start, end
        Interval of time of a run that is drawn: seconds, or quantities such as "1.9 s".
    x
        Horizontal axis of a run: "time", "displacement" of the slider, or "drive" for the
        displacement of the drive; by default the time, of a slider without inertia its
        displacement.
    period
        Time of a revolution of a disc, for the view "strokes": seconds, a quantity such as
        "0.92 s", or "auto", by which the force repeats itself.
    figure
        Figure, or part of one, to draw into; a new one by default.
    ax
        Axes for the most informative panel, and for nothing else.
    width
        Width of a new figure for print: a length such as "8.6 cm" (or 0.086, in meters), or a
        column of a journal with its size of the font, such as "aps-1" (`JOURNALS`). In a narrow
        figure panels are below each other, not side by side.
    font_size
        Size of the font [pt]; by default that of the journal, or 8.
    title
        Title of the picture instead of those of the outputs; "" for none.
    letters
        Whether panels have the letters (a), (b), and so on.
    style
        Style file of matplotlib (``.mplstyle``), laid over that of mesoslip.
    progress
        Called with the fraction of the frames of a movie that are drawn, 0 to 1.

    Returns
    -------
    matplotlib.figure.Figure
        The figure that was drawn, or drawn into.

    Raises
    ------
    FileError
        If an output cannot be read or lacks the data of the view, or the picture cannot be written.
    ConfigError
        If there is no such view or horizontal axis, the view does not have one of the options, or
        an option is of a wrong type.

    Examples
    --------
    >>> import mesoslip
    >>> path, *_ = mesoslip.example("klein")  # writes klein.toml
    >>> tree = mesoslip.run(mesoslip.Config.load(path, ["contacts.count=200", "run.duration=3 s"]))
    >>> figure = mesoslip.plot(tree, "klein.pdf", width="aps-1", title="")
    """
    outputs = several(output)
    if not outputs:
        raise FileError("there is no output to draw")
    extent = Extent(
        _whole("realization", realization),
        _quantity("start", start, "s", "1.9 s"),
        _quantity("end", end, "s", "2 s"),
        x,
    )
    turn: float | Literal["auto"] | None = "auto"
    if period != "auto":
        turn = None if period is None else _quantity("period", period, "s", "0.92 s")
        if turn is not None and not 0 < turn < math.inf:
            raise ConfigError.of("period", "must be positive", period)
    options = Options(extent, _whole("snapshot", snapshot), period=turn)
    if isinstance(width, str) and width in JOURNALS:
        journal = JOURNALS[width]
        width, font_size = journal.width, journal.font_size if font_size is None else font_size
    elif isinstance(width, str):
        width = width_of(width, "width")
    how = Print(
        None if width is None else _quantity("width", width, "m", "8.6 cm"),
        None if font_size is None else _number("font_size", font_size, "a number of points"),
        title,
        letters,
        None if style is None else as_path(style),
    )
    if width is not None and (figure is not None or ax is not None):
        raise ConfigError.of("width", "is for a new figure", width)
    for key, value, method in (("figure", figure, "add_subplot"), ("ax", ax, "plot")):
        if value is not None and not hasattr(value, method):
            kind = "a figure" if key == "figure" else "axes"
            raise ConfigError.of(key, f"must be {kind} of matplotlib", value)
    path = None if file is None else as_path(file)
    is_movie = path is not None and path.suffix.lower() in ENDINGS
    if path is not None and not is_movie:
        _check_format(path)
    if is_movie and len(outputs) > 1:
        raise FileError(f"{path}: a movie is of one output")
    with ExitStack() as stack, printed(how):
        trees, names = opened(
            outputs, stack, lambda tree: not is_movie and takes_arrays(tree, view)
        )
        if path is not None and is_movie:
            with styled():
                film = movie_of(trees[0], view, options)
                write(film, path, progress)
            return film.figure
        drawn = draw(trees, names, view, options, figure=figure, axes=ax)
        if ax is None:
            with styled():
                _finish(drawn)
        if path is not None:
            save(drawn, path)
    return drawn


def _quantity(key: str, value: object, unit: str, example: str) -> float:
    """A quantity in SI: a string with a unit, a number, or an array of one number."""
    if not isinstance(value, str):
        return _number(key, value, f"a quantity such as {example!r}, or a number in {unit}")
    try:
        return to_si(value, unit, example)
    except ValueError as error:
        raise ConfigError.of(key, str(error), value) from None


def _number(key: str, value: object, wanted: str) -> float:
    """A number, or an array of one; ``wanted`` is for the message."""
    try:
        if isinstance(value, str | bytes | bool):
            raise TypeError
        return float(value)  # type: ignore[arg-type]
    except (OverflowError, TypeError, ValueError):
        raise ConfigError.of(key, f"must be {wanted}", value) from None


def _whole(key: str, value: object) -> int | None:
    try:
        if isinstance(value, bool):
            raise TypeError
        return None if value is None else operator.index(value)  # type: ignore[arg-type]
    except TypeError:
        raise ConfigError.of(key, "must be a whole number", value) from None


def _check_format(path: Path) -> None:
    """Refuse the name of a picture in a format that matplotlib does not write."""
    formats = [f".{one}" for one in FigureCanvasBase.get_supported_filetypes()]
    if path.suffix.lower() not in formats:
        raise FileError(
            f"{path}: the name of a picture ends in one of {', '.join(formats)}; that of a movie "
            f"in {' or '.join(ENDINGS)}"
        )


def _finish(figure: Canvas) -> None:
    """Add the title and the letters of panels; long labels of short axes become two lines."""
    how = current()
    if how.title:
        text = filled(how.title, 0.95 * figure.bbox.width / figure.figure.dpi)
        figure.suptitle(text, x=0.01, ha="left")
    if how.letters:
        panels = [one for one in figure.axes if _is_panel(one)]
        if len(panels) > 1:
            for letter, axes in zip(string.ascii_lowercase, panels, strict=False):
                axes.annotate(
                    f"({letter})",
                    (0, 1),
                    xycoords="axes fraction",
                    xytext=(-4, 4),
                    textcoords="offset points",
                    ha="right",
                    va="bottom",
                )
    if how.width is not None or how.font_size is not None:
        _wrap_labels(figure)
        _thin_ticks(figure)


def _is_panel(axes: Axes) -> bool:
    """Whether axes are a panel of their own, and no colour bar or second scale of others."""
    others = [one for one in axes.get_shared_x_axes().get_siblings(axes) if one is not axes]
    is_second = axes.patch.get_visible() is False and any(
        one.get_subplotspec() == axes.get_subplotspec() for one in others
    )
    return axes.get_label() not in (UNLETTERED, "<colorbar>") and not is_second


def _wrap_labels(figure: Canvas) -> None:
    """Break vertical labels that are longer than their axes, and would reach into others."""
    figure.figure.draw_without_rendering()
    for axes in figure.axes:
        label = axes.yaxis.label
        height = axes.get_window_extent().height
        if label.get_text() and label.get_window_extent().height > height:
            label.set_text(_in_two_lines(label.get_text()))


def _thin_ticks(figure: Canvas) -> None:
    """Use fewer ticks on horizontal axes whose labels would touch each other."""
    figure.figure.draw_without_rendering()
    for axes in figure.axes:
        labels = [one.get_window_extent() for one in axes.get_xticklabels() if one.get_text()]
        gap = 0.5 * mpl.rcParams["font.size"] * figure.figure.dpi / 72
        touch = any(after.x0 < before.x1 + gap for before, after in itertools.pairwise(labels))
        if touch and isinstance(axes.xaxis.get_major_locator(), MaxNLocator):
            axes.locator_params(axis="x", nbins=FEW_TICKS)


def _in_two_lines(text: str) -> str:
    """A text broken at the space nearest to its middle, not within a formula."""
    spaces = [at for at, one in enumerate(text) if one == " " and text[:at].count("$") % 2 == 0]
    if not spaces:
        return text
    at = min(spaces, key=lambda one: abs(one - len(text) / 2))
    return f"{text[:at]}\n{text[at + 1 :]}"
