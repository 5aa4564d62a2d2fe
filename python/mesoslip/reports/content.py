"""What a report is made of: sections of texts, tables and pictures, however the page looks."""

from __future__ import annotations

import hashlib
import io
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import matplotlib as mpl
import xarray as xr
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from mesoslip.configuration.config import Config
from mesoslip.output.access import config_of
from mesoslip.plots.style import Canvas, styled

# A page shows fewer dots than a picture that is printed.
PARTS = 1000
# By how much pictures may be larger than they are printed.
MAGNIFIED = 1.25
# Dots of what a picture draws as dots.
DOTS_PER_INCH = 150
# Nothing of the machine or the time, so that a report is the same when it is made again.
NO_METADATA = dict.fromkeys(("Creator", "Date", "Format", "Type"))


@dataclass(frozen=True)
class Subject:
    """What a report is about: an output, and the name by which the page calls it."""

    name: str
    tree: xr.DataTree

    @property
    def config(self) -> Config:
        """The configuration of the output."""
        return config_of(self.tree, self.name)


@dataclass(frozen=True)
class Text:
    """A paragraph; one that warns stands out."""

    text: str
    warns: bool = False


@dataclass(frozen=True)
class Table:
    """A table: its head, its rows, all texts, and what is said below it."""

    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ""


@dataclass(frozen=True)
class Picture:
    """A picture as the text of an SVG, and what it shows."""

    svg: str
    caption: str


@dataclass(frozen=True)
class Source:
    """A text as it stands in a file, folded away."""

    title: str
    text: str


Block = Text | Table | Picture | Source


@dataclass(frozen=True)
class Section:
    """A section of a report."""

    title: str
    blocks: tuple[Block, ...] = field(default=())


# What writes a section about an output, or about several of one kind side by side; None if there
# is nothing to say.
Writer = Callable[[Sequence[Subject]], Section | None]


def drawn(caption: str, draw: Callable[[], Canvas]) -> Picture:
    """A picture of what is drawn.

    Parameters
    ----------
    caption
        What it shows; also what is read to those who do not see it.
    draw
        What draws it.
    """
    stream = io.StringIO()
    # The names of a picture's parts are those of its caption, which no other one of the page has.
    with styled(), mpl.rc_context({"svg.fonttype": "none", "svg.hashsalt": caption}):
        figure = draw()
        whole = figure if isinstance(figure, Figure) else figure.figure
        for one in whole.findobj(PolyCollection):
            # Thousands of contacts on their lattice.
            one.set_rasterized(True)
        whole.savefig(stream, format="svg", dpi=DOTS_PER_INCH, metadata=NO_METADATA)
    text = stream.getvalue()
    # Named after their places, which the layout tells to rounding, and not always to the bit.
    own = hashlib.sha256(caption.encode("utf-8", "backslashreplace")).hexdigest()[:8]
    for number, name in enumerate(re.findall(r'<clipPath id="(p[0-9a-f]+)"', text)):
        text = text.replace(name, f"clip-{own}-{number}")
    # As wide as the page where that is not much more than the picture.
    width = MAGNIFIED * whole.get_figwidth()
    size = re.compile(r"<svg [^>]*?(?= xmlns| viewBox)", re.DOTALL)
    text = size.sub(f'<svg style="width: 100%; max-width: {width:g}in"', text, count=1)
    return Picture(text[text.index("<svg") :], caption)
