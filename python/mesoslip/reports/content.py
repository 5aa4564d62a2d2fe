"""Contents of a report: sections of texts, tables and pictures, whatever their appearance."""

from __future__ import annotations

import hashlib
import io
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import matplotlib as mpl
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from mesoslip.array_types import DataTree
from mesoslip.configuration.config import Config
from mesoslip.errors import FileError
from mesoslip.output.access import config_of
from mesoslip.plots.style import Canvas, styled

# Intervals of a line in each of which the page shows the extremes, fewer than in print.
PARTS = 1000
# Maximum magnification of a picture on the page.
MAX_MAGNIFICATION = 1.25
# Resolution of the rasterized parts of pictures.
DOTS_PER_INCH = 150
# No metadata of the machine or the time, so that the same outputs give the same page.
NO_METADATA = dict.fromkeys(("Creator", "Date", "Format", "Type"))


@dataclass(frozen=True)
class Subject:
    """An output in a report, with its name on the page."""

    name: str
    tree: DataTree

    @property
    def config(self) -> Config:
        """The configuration of the output."""
        return config_of(self.tree, self.name)

    @property
    def has_config(self) -> bool:
        """Whether it has a whole configuration; a measured trace may have a part of one."""
        try:
            return bool(self.config)
        except FileError:
            return False


@dataclass(frozen=True)
class Text:
    """A paragraph; a warning is highlighted."""

    text: str
    warns: bool = False


@dataclass(frozen=True)
class Table:
    """A table: its head, its rows, a note below it, and the numbers of rows that are marked."""

    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ""
    marked: tuple[int, ...] = ()


@dataclass(frozen=True)
class Picture:
    """A picture as an SVG, with its caption."""

    svg: str
    caption: str


@dataclass(frozen=True)
class Source:
    """The text of a file, folded."""

    title: str
    text: str


Block = Text | Table | Picture | Source


@dataclass(frozen=True)
class Section:
    title: str
    blocks: tuple[Block, ...] = field(default=())


# Writes a section about outputs of one kind side by side; None if the section would be empty.
Writer = Callable[[Sequence[Subject]], Section | None]


def drawn(caption: str, draw: Callable[[], Canvas]) -> Picture:
    """Draw a figure for a page; its caption is its text for screen readers too."""
    stream = io.StringIO()
    # Identifiers in the SVG derive from the caption, which no other picture of a page has.
    with styled(), mpl.rc_context({"svg.fonttype": "none", "svg.hashsalt": caption}):
        figure = draw()
        whole = figure if isinstance(figure, Figure) else figure.figure
        for one in whole.findobj(PolyCollection):
            # Thousands of contacts on their lattice.
            one.set_rasterized(True)
        whole.savefig(stream, format="svg", dpi=DOTS_PER_INCH, metadata=NO_METADATA)
    text = stream.getvalue()
    # Matplotlib names clip paths after their positions, which vary by rounding.
    own = hashlib.sha256(caption.encode("utf-8", "backslashreplace")).hexdigest()[:8]
    for number, name in enumerate(re.findall(r'<clipPath id="(p[0-9a-f]+)"', text)):
        text = text.replace(name, f"clip-{own}-{number}")
    width = MAX_MAGNIFICATION * whole.get_figwidth()
    size = re.compile(r"<svg [^>]*?(?= xmlns| viewBox)", re.DOTALL)
    text = size.sub(f'<svg style="width: 100%; max-width: {width:g}in"', text, count=1)
    return Picture(text[text.index("<svg") :], caption)
