"""The interface of views: pictures of one kind of output."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

from matplotlib.axes import Axes

from mesoslip.plots.extent import EVERYTHING, Extent
from mesoslip.plots.movie import Movie
from mesoslip.plots.style import Canvas, canvas, shared_legend, styled

if TYPE_CHECKING:
    import xarray as xr

# Options of a view of a trace.
EXTENT = frozenset({"realization", "start, end", "x"})


@dataclass(frozen=True)
class Options:
    """Options of views; each view has some of them.

    Attributes
    ----------
    extent
        Realization, window of time and horizontal axis.
    snapshot
        Number of a snapshot of the lattice.
    measure
        Measure of a sweep.
    """

    extent: Extent = EVERYTHING
    snapshot: int | None = None
    measure: str | None = None

    @property
    def given(self) -> set[str]:
        """Names of the options that are not at their defaults."""
        is_given = {
            "realization": self.extent.realization is not None,
            "start, end": not self.extent.is_whole,
            "x": self.extent.against is not None,
            "snapshot": self.snapshot is not None,
            "measure": self.measure is not None,
        }
        return {name for name, given in is_given.items() if given}


Draw: TypeAlias = "Callable[[xr.DataTree, Options, Canvas | None], Canvas]"
DrawPanel: TypeAlias = "Callable[[Axes, xr.DataTree, Options], None]"
Compare: TypeAlias = (
    "Callable[[Sequence[xr.DataTree], Sequence[str], Options, Canvas | None], Canvas]"
)
ComparePanel: TypeAlias = "Callable[[Axes, Sequence[xr.DataTree], Sequence[str], Options], None]"


@dataclass(frozen=True)
class View:
    """A picture of one kind of output.

    Attributes
    ----------
    name
        Name by which it is asked for; the default view of a kind has the kind's name.
    kind
        Kind of output (`mesoslip.output.kinds.KINDS`).
    summary
        Contents of the picture, for messages and help.
    draw
        Draws an output into a figure, a new one if it is None.
    panel
        Draws the most informative panel alone into axes.
    options
        Names of the options it has, as in `Options.given`.
    compare, compare_panel
        The same for several outputs with a label each; None if it shows one output only.
    applies
        Whether it is for an output, where views of one name are for different outputs of a kind.
    movie
        Makes a movie of an output; None if there is none.
    takes_arrays
        Whether its pictures need no more of an output than `mesoslip.output.arrays.Arrays` has.
    """

    name: str
    kind: str
    summary: str
    draw: Draw
    panel: DrawPanel
    options: frozenset[str] = frozenset()
    compare: Compare | None = None
    compare_panel: ComparePanel | None = None
    applies: Callable[[xr.DataTree], bool] = lambda _: True
    movie: Callable[[xr.DataTree, Options], Movie] | None = None
    takes_arrays: bool = False


def single_panel(
    draw: Callable[[Axes], None], entries: int, figure: Canvas | None = None
) -> Canvas:
    """A figure of one panel, with a legend of some entries below it."""
    with styled():
        figure = canvas(figure, (6.5, 3.2 + 0.16 * entries))
        axes = figure.subplots()
        draw(axes)
        if axes.get_legend_handles_labels()[0]:
            shared_legend(figure, axes)
    return figure
