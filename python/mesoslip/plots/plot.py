"""Draw outputs, and save the picture."""

from __future__ import annotations

import math
import operator
from collections.abc import Sequence
from contextlib import ExitStack
from typing import TYPE_CHECKING

from mesoslip.configuration.reading import PathLike, as_path
from mesoslip.configuration.units import to_si
from mesoslip.errors import ConfigError, FileError, Problem
from mesoslip.output.inputs import OutputLike, opened, several
from mesoslip.plots.draw import draw, movie_of
from mesoslip.plots.extent import Extent
from mesoslip.plots.movie import ENDINGS, write
from mesoslip.plots.printing import Print, finish, printed
from mesoslip.plots.style import save, styled
from mesoslip.plots.views import takes_arrays
from mesoslip.plots.views.base import Options

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure


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
    figure: Figure | SubFigure | None = None,
    ax: Axes | None = None,
    width: float | str | None = None,
    font_size: float | None = None,
    title: str | None = None,
    letters: bool = False,
    style: PathLike | None = None,
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
        is a movie: of the views "layers", "contacts", or "lattice", which shows the avalanche that
        spreads before a snapshot, or all snapshots. Without a view it is one that the output has.
    view
        View of a run, such as "avalanches" for their sizes, "lattice" and
        "contacts" for a snapshot, "layers" for
        the waves in an elastic slider, "response" for steady forces, velocity steps and holds; or
        measure of a sweep.
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
    figure
        Figure, or part of one, to draw into; a new one by default.
    ax
        Axes for the most informative panel, and for nothing else.
    width
        Width of a new figure for print, such as "8.6 cm" (or 0.086, in meters) for a column of a
        journal; panels that stood beside each other are below each other if it is narrow.
    font_size
        Size of the font [pt]; 8 by default.
    title
        Title of the picture instead of those of the outputs; "" for none.
    letters
        Whether panels have the letters (a), (b), and so on.
    style
        Style file of matplotlib (``.mplstyle``), laid over that of mesoslip.

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
    options = Options(extent, _whole("snapshot", snapshot))
    how = Print(
        None if width is None else _quantity("width", width, "m", "8.6 cm"),
        None if font_size is None else _number("font_size", font_size, "a number of points"),
        title,
        letters,
        None if style is None else as_path(style),
    )
    if width is not None and (figure is not None or ax is not None):
        raise ConfigError([Problem("", "width", "is for a new figure", width)])
    for key, value, method in (("figure", figure, "add_subplot"), ("ax", ax, "plot")):
        if value is not None and not hasattr(value, method):
            kind = "a figure" if key == "figure" else "axes"
            raise ConfigError([Problem("", key, f"must be {kind} of matplotlib", value)])
    path = None if file is None else as_path(file)
    is_movie = path is not None and path.suffix.lower() in ENDINGS
    if is_movie and len(outputs) > 1:
        raise FileError(f"{path}: a movie is of one output")
    with ExitStack() as stack, printed(how):
        trees, names = opened(
            outputs, stack, lambda tree: not is_movie and takes_arrays(tree, view)
        )
        if path is not None and is_movie:
            with styled():
                film = movie_of(trees[0], view, options)
                write(film, path)
            return film.figure
        drawn = draw(trees, names, view, options, figure=figure, axes=ax)
        if ax is None:
            with styled():
                finish(drawn)
        if path is not None:
            save(drawn, path)
    return drawn


def _quantity(key: str, value: object, unit: str, example: str) -> float:
    """A quantity in SI: a string with a unit, a number, or an array of one number.

    Raises
    ------
    ConfigError
        If it is something else, or has another dimension.
    """
    if not isinstance(value, str):
        return _number(key, value, f"a quantity such as {example!r}, or a number in {unit}")
    try:
        return to_si(value, unit, example)
    except ValueError as error:
        raise ConfigError([Problem("", key, str(error), value)]) from None


def _number(key: str, value: object, wanted: str) -> float:
    """A number, or an array of one; ``wanted`` is for the message.

    Raises
    ------
    ConfigError
        If it is something else.
    """
    try:
        if isinstance(value, str | bytes | bool):
            raise TypeError
        return float(value)  # type: ignore[arg-type]
    except (OverflowError, TypeError, ValueError):
        raise ConfigError([Problem("", key, f"must be {wanted}", value)]) from None


def _whole(key: str, value: object) -> int | None:
    """A whole number, or None.

    Raises
    ------
    ConfigError
        If it is something else.
    """
    try:
        if isinstance(value, bool):
            raise TypeError
        return None if value is None else operator.index(value)  # type: ignore[arg-type]
    except TypeError:
        raise ConfigError([Problem("", key, "must be a whole number", value)]) from None
