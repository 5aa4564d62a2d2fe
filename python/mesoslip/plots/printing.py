"""How pictures are printed: width, font size, style file, title and letters of panels."""

from __future__ import annotations

import logging
import math
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import matplotlib as mpl
from matplotlib.figure import Figure, SubFigure

from mesoslip.configuration.units import text_to_si
from mesoslip.errors import ConfigError, FileError, Problem

INCH = 0.0254


class Journal(NamedTuple):
    """A column of a journal: its width [m] and the size of the font in figures [pt]."""

    width: float
    font_size: float


# By the instructions to authors of the American Physical Society (capitals of at least 2 mm),
# Elsevier (lettering of 7 pt) and Nature (5 to 7 pt).
JOURNALS = {
    "aps-1": Journal(0.086, 8.0),
    "aps-2": Journal(0.178, 8.0),
    "elsevier-1": Journal(0.090, 7.0),
    "elsevier-1.5": Journal(0.140, 7.0),
    "elsevier-2": Journal(0.190, 7.0),
    "nature-1": Journal(0.089, 7.0),
    "nature-2": Journal(0.183, 7.0),
}
# Widths and font sizes that can be read [m, pt].
WIDTHS = (0.03, 2.0)
FONT_SIZES = (3.0, 40.0)
# Width below which panels stand in one column [inch].
NARROW = 4.5
# Maximum height of a narrow figure over its width, and height of any figure: a page of text [inch].
MAX_ASPECT, MAX_HEIGHT = 1.5, 9.4
# Dots per inch of print, of pictures of a given width.
PRINT_DPI = 600

STYLE_FILE = Path(__file__).with_name("mesoslip.mplstyle")
# TrueType as Type 42, whatever a style says: journals refuse fonts of Type 3.
FONTS: dict[str, Any] = {"pdf.fonttype": 42, "ps.fonttype": 42}
# Settings of matplotlib that do not belong to a style.
NO_STYLE = ("backend", "interactive", "toolbar", "timezone", "webagg", "savefig.directory")
# Label of axes that get no letter.
UNLETTERED = "<unlettered>"


@dataclass(frozen=True)
class Print:
    """How a picture is printed, where it differs from its view, its outputs and the style."""

    width: float | None = None
    """Width [m]."""
    font_size: float | None = None
    """Size of the font [pt]."""
    title: str | None = None
    letters: bool = False
    """Whether panels have letters."""
    style: Path | None = None
    """Style file of matplotlib, laid over that of mesoslip."""

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
        settings = dict(read_style(STYLE_FILE))
        if self.width is not None:
            settings["savefig.dpi"] = PRINT_DPI
        if self.style is not None:
            settings |= read_style(self.style)
        if self.font_size is not None:
            settings["font.size"] = self.font_size
        return settings | FONTS


def width_of(text: str, key: str) -> float:
    """A width of print [m] that is a length."""
    try:
        return text_to_si(text, "m", "8.6 cm")
    except ValueError as error:
        message = f"{error}, or the column of a journal: {', '.join(JOURNALS)}"
        raise ConfigError.of(key, message, text) from None


DEFAULT = Print()
_PRINT: ContextVar[Print] = ContextVar("print", default=DEFAULT)


def current() -> Print:
    """How pictures are printed now."""
    return _PRINT.get()


@contextmanager
def printed(how: Print) -> Iterator[None]:
    """Draw pictures as they are printed."""
    if how.style is not None:
        # The file may have changed since an earlier picture.
        read_style.cache_clear()
    token = _PRINT.set(how)
    try:
        yield
    finally:
        _PRINT.reset(token)


@cache
def read_style(path: Path) -> dict[str, Any]:
    """Settings of a style file of matplotlib; a `FileError` for an unknown key or a wrong value."""
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
    inches = width / INCH
    limit = MAX_ASPECT * inches if inches < NARROW else MAX_HEIGHT
    return inches, min(size[1] * math.sqrt(inches / size[0]), limit)
