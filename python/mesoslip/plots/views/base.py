"""The interface of views: pictures of one kind of output."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

from matplotlib.axes import Axes

from mesoslip.array_types import DataTree
from mesoslip.plots.extent import EVERYTHING, Extent
from mesoslip.plots.movie import Movie
from mesoslip.plots.style import Canvas, canvas, shared_legend, styled

# Options of a view of a trace.
EXTENT = frozenset({"realization", "start, end", "x"})


@dataclass(frozen=True)
class Options:
    """Options of views; each view has some of them."""

    extent: Extent = EVERYTHING
    """Realization, window of time and horizontal axis of a run."""
    snapshot: int | None = None
    """Number of a snapshot of the contacts."""
    measure: str | None = None
    """Measure of a sweep."""
    period: float | Literal["auto"] | None = None
    """Time of a revolution of a disc [s]."""

    @property
    def given(self) -> set[str]:
        """Names of the options that are not at their defaults."""
        is_given = {
            "realization": self.extent.realization is not None,
            "start, end": not self.extent.is_whole,
            "x": self.extent.against is not None,
            "snapshot": self.snapshot is not None,
            "measure": self.measure is not None,
            "period": self.period is not None,
        }
        return {name for name, given in is_given.items() if given}


Draw: TypeAlias = "Callable[[DataTree, Options, Canvas | None], Canvas]"
DrawPanel: TypeAlias = "Callable[[Axes, DataTree, Options], None]"
Compare: TypeAlias = "Callable[[Sequence[DataTree], Sequence[str], Options, Canvas | None], Canvas]"
ComparePanel: TypeAlias = "Callable[[Axes, Sequence[DataTree], Sequence[str], Options], None]"


@dataclass(frozen=True)
class View:
    """A picture of one kind of output. Its functions are called with the style of mesoslip set."""

    name: str
    """Name by which it is asked for; the default view of a kind has the name of the kind."""
    kind: str
    """Kind of output (`mesoslip.output.kinds.KINDS`)."""
    summary: str
    """Contents of the picture, for messages and help."""
    panel: DrawPanel
    """Draws the most informative panel into axes."""
    draw_all: Draw | None = None
    """Draws all panels into a figure, a new one if it is None; None if there is one panel."""
    options: frozenset[str] = frozenset()
    """Names of the options it has, as in `Options.given`."""
    compare_panel: ComparePanel | None = None
    """Draws a panel of several outputs, each with a label; None if it shows one output only."""
    compare_all: Compare | None = None
    """Draws all panels of several outputs; None if there is one."""
    legend_entries: int = 1
    """Entries of each output in the legend of a panel of several."""
    applies: Callable[[DataTree], bool] = lambda _: True
    """Whether it is for an output, where views of one name are for different outputs of a kind."""
    movie: Callable[[DataTree, Options], Movie] | None = None
    """Makes a movie of an output; None if there is none."""
    caption: Callable[[DataTree], str] | None = None
    """Contents of the picture of an output; None if they are those of the summary."""
    takes_arrays: bool = False
    """Whether `mesoslip.output.arrays.Arrays` has all that it needs of an output."""

    def draw(self, tree: DataTree, options: Options, figure: Canvas | None) -> Canvas:
        with styled():
            if self.draw_all is not None:
                return self.draw_all(tree, options, figure)
            return _single_panel(lambda axes: self.panel(axes, tree, options), 0, figure)

    def compare(
        self,
        trees: Sequence[DataTree],
        labels: Sequence[str],
        options: Options,
        figure: Canvas | None,
    ) -> Canvas:
        """Draw several outputs, with a legend of their labels."""
        panel, entries = self.compare_panel, self.legend_entries * len(trees)
        assert panel is not None
        with styled():
            if self.compare_all is not None:
                return self.compare_all(trees, labels, options, figure)
            return _single_panel(lambda axes: panel(axes, trees, labels, options), entries, figure)


def _single_panel(
    draw: Callable[[Axes], None], entries: int, figure: Canvas | None = None
) -> Canvas:
    """A figure of one panel, with its legend, of a number of entries, below it."""
    figure = canvas(figure, (6.5, 3.2 + 0.16 * entries))
    axes = figure.subplots()
    draw(axes)
    if axes.get_legend_handles_labels()[0]:
        shared_legend(figure, axes)
    return figure
