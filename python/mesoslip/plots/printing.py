"""How pictures are printed: width, font size, style file, title and letters of panels."""

from __future__ import annotations

import itertools
import logging
import math
import string
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.ticker import MaxNLocator

from mesoslip.errors import ConfigError, FileError, Problem

INCH = 0.0254
# Widths and font sizes that can be read [m, pt].
WIDTHS = (0.03, 2.0)
FONT_SIZES = (3.0, 40.0)
# Width below which panels stand in one column [inch].
NARROW = 4.5
# Dots per inch of print, of pictures of a given width.
PRINT_DPI = 600

STYLE_FILE = Path(__file__).with_name("mesoslip.mplstyle")
# TrueType as Type 42, whatever a style says: journals refuse fonts of Type 3.
FONTS: dict[str, Any] = {"pdf.fonttype": 42, "ps.fonttype": 42}
# Settings of matplotlib that are no matter of a style.
NO_STYLE = ("backend", "interactive", "toolbar", "timezone", "webagg", "savefig.directory")
# Ticks of an axis that has no room for more.
FEW_TICKS = 4
# Label of axes that get no letter, as colour bars have it.
UNLETTERED = "<unlettered>"


@dataclass(frozen=True)
class Print:
    """How a picture is printed.

    Attributes
    ----------
    width
        Width [m]; None for that of the view.
    font_size
        Size of the font [pt]; None for that of the style.
    title
        Title; None for those of the outputs.
    letters
        Whether panels have letters.
    style
        Style file of matplotlib, laid over that of mesoslip.
    """

    width: float | None = None
    font_size: float | None = None
    title: str | None = None
    letters: bool = False
    style: Path | None = None

    def __post_init__(self) -> None:
        found = []
        limits = (
            ("width", self.width, WIDTHS, "m"),
            ("font_size", self.font_size, FONT_SIZES, "pt"),
        )
        for name, value, (low, high), unit in limits:
            if value is not None and not low <= value <= high:
                text = f"must be between {low:g} {unit} and {high:g} {unit}"
                found.append(Problem("", name, text, value))
        if found:
            raise ConfigError(found)

    @property
    def settings(self) -> Any:
        """The settings of matplotlib.

        Raises
        ------
        FileError
            If the style file cannot be read or is wrong.
        """
        settings = dict(read_style(STYLE_FILE))
        if self.width is not None:
            settings["savefig.dpi"] = PRINT_DPI
        if self.style is not None:
            settings |= read_style(self.style)
        if self.font_size is not None:
            settings["font.size"] = self.font_size
        return settings | FONTS


DEFAULT = Print()
_PRINT: ContextVar[Print] = ContextVar("print", default=DEFAULT)


def current() -> Print:
    """How pictures are printed now."""
    return _PRINT.get()


@contextmanager
def printed(how: Print) -> Iterator[None]:
    """Draw pictures for print."""
    if how.style is not None:
        # As it is now, not as it was for an earlier picture.
        read_style.cache_clear()
    token = _PRINT.set(how)
    try:
        yield
    finally:
        _PRINT.reset(token)


@cache
def read_style(path: Path) -> dict[str, Any]:
    """Settings of a style file of matplotlib.

    Raises
    ------
    FileError
        If it cannot be read, or has an unknown key or a wrong value.
    """
    problems: list[str] = []

    class Listener(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            problems.append(" ".join(record.getMessage().split()))

    logger, listener = logging.getLogger("matplotlib"), Listener(logging.WARNING)
    propagates = logger.propagate
    logger.addHandler(listener)
    logger.propagate = False
    try:
        settings = mpl.rc_params_from_file(path, fail_on_error=True, use_default_template=False)
    except OSError as error:
        raise FileError(f"{path}: cannot be read: {error.strerror or error}") from error
    except (KeyError, ValueError) as error:
        raise FileError(f"{path}: is no style of matplotlib: {error}") from error
    finally:
        logger.removeHandler(listener)
        logger.propagate = propagates
    if problems:
        first = problems[0].partition(" You probably need")[0].replace(f" in file {path}", "")
        raise FileError(f"{path}: is no style of matplotlib: {first}")
    return {name: value for name, value in settings.items() if not name.startswith(NO_STYLE)}


def is_narrow(figure: Figure | SubFigure | None) -> bool:
    """Whether a figure, or the one to come, is too narrow for panels beside each other."""
    if figure is not None:
        return bool(figure.bbox.width / figure.figure.dpi < NARROW)
    width = current().width
    return width is not None and width / INCH < NARROW


def size_of(size: tuple[float, float]) -> tuple[float, float]:
    """Width and height of a figure [inch] for print, from those of its view."""
    width = current().width
    if width is None:
        return size
    return width / INCH, size[1] * math.sqrt(width / INCH / size[0])


def finish(figure: Figure | SubFigure) -> None:
    """Add the title and the letters of panels; long labels of short axes become two lines."""
    how = current()
    if how.title:
        from mesoslip.plots.style import filled

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
        wrap_labels(figure)
        thin_ticks(figure)


def _is_panel(axes: Axes) -> bool:
    """Whether axes are a panel of their own: no bar of colours, no second scale of others."""
    others = [one for one in axes.get_shared_x_axes().get_siblings(axes) if one is not axes]
    is_second = axes.patch.get_visible() is False and any(
        one.get_subplotspec() == axes.get_subplotspec() for one in others
    )
    return axes.get_label() not in (UNLETTERED, "<colorbar>") and not is_second


def wrap_labels(figure: Figure | SubFigure) -> None:
    """Break vertical labels that are longer than their axes, which reach into others."""
    figure.figure.draw_without_rendering()
    for axes in figure.axes:
        label = axes.yaxis.label
        height = axes.get_window_extent().height
        if label.get_text() and label.get_window_extent().height > height:
            label.set_text(_in_two_lines(label.get_text()))


def thin_ticks(figure: Figure | SubFigure) -> None:
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
