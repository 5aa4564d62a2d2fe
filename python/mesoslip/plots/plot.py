"""Draw outputs, and save the picture."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import ExitStack
from typing import TYPE_CHECKING

from mesoslip.configuration.reading import PathLike, as_path
from mesoslip.errors import FileError
from mesoslip.output.inputs import OutputLike, opened, several
from mesoslip.plots import avalanches
from mesoslip.plots.draw import draw
from mesoslip.plots.run import Extent
from mesoslip.plots.style import save

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
    start: float = -math.inf,
    end: float = math.inf,
    x: str | None = None,
    figure: Figure | SubFigure | None = None,
    ax: Axes | None = None,
) -> Figure | SubFigure:
    """Draw an output of any command, or several of one command over each other.

    Of a run: force, velocity and detached contacts, with the largest slip beside them; of a slider
    without inertia: force and avalanches; of a force curve: the force and its slope; of an onset of
    slip: the drop of the spring force. The title says what the run changes from its base, the
    legend of several outputs how they differ.

    Parameters
    ----------
    output
        The output, or several.
    file
        Where to save the picture; nowhere by default. If its name ends in ``.gif`` it is an
        animation of the lattice: of the avalanche that spreads before a snapshot, or of all
        snapshots.
    view
        Another picture of a run: "avalanches" for their sizes, "lattice" for a snapshot, "layers"
        for the waves in an elastic slider, "response" for steady forces, velocity steps and holds.
    snapshot
        Number of the snapshot; that after the largest avalanche by default.
    realization
        Number of the realization of a run; by default the first one, with others behind it.
    start, end
        Interval of time of a run [s] that is drawn.
    x
        Horizontal axis of a run: "time", "displacement" of the slider, or "drive" for the
        displacement of the drive; by default the time, of a slider without inertia its
        displacement.
    figure
        Figure, or part of one, to draw into; a new one by default.
    ax
        Axes for the most informative panel, and for nothing else.

    Returns
    -------
    matplotlib.figure.Figure
        The figure that was drawn, or drawn into.

    Raises
    ------
    FileError
        If an output cannot be read or lacks the data of the view, or the picture cannot be written.
    ConfigError
        If there is no such view or horizontal axis.
    """
    outputs = several(output)
    if not outputs:
        raise FileError("there is no output to draw")
    extent = Extent(realization, start, end, x)
    path = None if file is None else as_path(file)
    is_moving = path is not None and path.suffix == ".gif"
    if is_moving and (view not in {None, "lattice"} or len(outputs) > 1):
        what = "of one output" if len(outputs) > 1 else f"not {view!r}"
        raise FileError(f"{path}: only the lattice can be shown in motion, {what}")
    with ExitStack() as stack:
        trees, names = opened(outputs, stack)
        if path is not None and is_moving:
            return avalanches.animate(trees[0], path, snapshot)
        drawn = draw(trees, names, view, snapshot, extent=extent, figure=figure, axes=ax)
        if path is not None:
            save(drawn, path)
    return drawn
