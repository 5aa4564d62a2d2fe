"""Contents of a report: sections of texts, tables and pictures, whatever their appearance."""

from __future__ import annotations

import hashlib
import io
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import matplotlib as mpl
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from mesoslip.configuration.config import Config
from mesoslip.errors import FileError
from mesoslip.output.access import config_of
from mesoslip.plots.style import Canvas, styled

if TYPE_CHECKING:
    import xarray as xr

# Intervals of a line in each of which the page shows the extremes: fewer than in print.
PARTS = 1000
# Maximum width of a picture on the page over that in print.
MAX_MAGNIFICATION = 1.25
# Resolution of the rasterized parts of pictures.
DOTS_PER_INCH = 150
# No metadata of the machine or the time, so that the same outputs give the same page.
NO_METADATA = dict.fromkeys(("Creator", "Date", "Format", "Type"))


@dataclass(frozen=True)
class Subject:
    """An output in a report, with its name on the page."""

    name: str
    tree: xr.DataTree

    @property
    def config(self) -> Config:
        """The configuration of the output."""
        return config_of(self.tree, self.name)

    @property
    def has_config(self) -> bool:
        """Whether it has a whole configuration: a measured trace may have a part of one."""
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
    """A table of texts: its head, its rows, a note below it, and numbers of marked rows."""

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
    """A section of a report."""

    title: str
    blocks: tuple[Block, ...] = field(default=())


# Writes a section about an output, or about several of one kind side by side; None if the section
# would be empty.
Writer = Callable[[Sequence[Subject]], Section | None]


def drawn(caption: str, draw: Callable[[], Canvas]) -> Picture:
    """A figure as a picture of a page.

    Parameters
    ----------
    caption
        Its caption, also its text for screen readers.
    draw
        Draws the figure.
    """
    stream = io.StringIO()
    # Identifiers in the SVG derive from the caption, which is unique on a page.
    with styled(), mpl.rc_context({"svg.fonttype": "none", "svg.hashsalt": caption}):
        figure = draw()
        whole = figure if isinstance(figure, Figure) else figure.figure
        for one in whole.findobj(PolyCollection):
            # Thousands of contacts on their lattice.
            one.set_rasterized(True)
        whole.savefig(stream, format="svg", dpi=DOTS_PER_INCH, metadata=NO_METADATA)
    text = stream.getvalue()
    # Matplotlib names them after their positions, which the layout gives to rounding only.
    own = hashlib.sha256(caption.encode("utf-8", "backslashreplace")).hexdigest()[:8]
    for number, name in enumerate(re.findall(r'<clipPath id="(p[0-9a-f]+)"', text)):
        text = text.replace(name, f"clip-{own}-{number}")
    # As wide as the page, up to a maximum magnification.
    width = MAX_MAGNIFICATION * whole.get_figwidth()
    size = re.compile(r"<svg [^>]*?(?= xmlns| viewBox)", re.DOTALL)
    text = size.sub(f'<svg style="width: 100%; max-width: {width:g}in"', text, count=1)
    return Picture(text[text.index("<svg") :], caption)
