"""Pictures of outputs: the view of one, or a comparison of several."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from matplotlib.axes import Axes

from mesoslip.array_types import DataTree
from mesoslip.configuration import differences
from mesoslip.errors import FileError
from mesoslip.output.access import config_of, is_measured
from mesoslip.output.kinds import KINDS, kind_of, kind_of_all
from mesoslip.plots.key_names import plain, setting
from mesoslip.plots.movie import Movie
from mesoslip.plots.style import Canvas, legend_above, styled
from mesoslip.plots.views import VIEWS, view_of
from mesoslip.plots.views.base import Options, View

NO_OPTIONS = Options()
# Views of a movie for which none was asked: the first that the output has.
MOVIES = ("lattice", "layers", "fronts", "contacts")


class Picture(NamedTuple):
    """Draws outputs: all panels into a figure, a new one if it is None, or one panel into axes."""

    whole: Callable[[Canvas | None], Canvas]
    panel: Callable[[Axes], None]


def picture(
    trees: Sequence[DataTree],
    names: Sequence[str],
    view: str | None = None,
    options: Options = NO_OPTIONS,
) -> Picture:
    """A view of an output, or of several of one command over each other; see `draw`."""
    if len(trees) > 1:
        return _comparison(trees, names, view, options)
    (tree,) = trees
    chosen, options = _chosen(tree, view, options)
    return Picture(
        lambda figure: chosen.draw(tree, options, figure),
        lambda axes: chosen.panel(axes, tree, options),
    )


def _comparison(
    trees: Sequence[DataTree], names: Sequence[str], view: str | None, options: Options
) -> Picture:
    kind = kind_of_all(trees, names)
    chosen, options = _chosen(trees[0], view, options)
    compare_panel = chosen.compare_panel
    if compare_panel is None:
        raise FileError(
            f"the view {chosen.name!r} shows one output at a time, {KINDS[kind].description}"
        )
    labels = labels_of(trees, names)

    def panel(axes: Axes) -> None:
        compare_panel(axes, trees, labels, options)
        if axes.get_legend_handles_labels()[0]:
            legend_above(axes, columns=1)

    return Picture(lambda figure: chosen.compare(trees, labels, options, figure), panel)


def movie_of(tree: DataTree, name: str | None = None, options: Options = NO_OPTIONS) -> Movie:
    """The movie of a view of an output, by default of the first of `MOVIES` that it has."""
    if name is not None:
        chosen, options = _chosen(tree, name, options)
        if chosen.movie is None:
            names = [one.name for one in VIEWS if one.movie and one.kind == chosen.kind]
            others = f"; {', '.join(names)} have one" if names else ""
            raise FileError(f"the view {chosen.name!r} has no movie{others}")
        return chosen.movie(tree, options)
    reasons = []
    for one in MOVIES:
        view = next(
            (each for each in VIEWS if each.name == one and each.kind == kind_of(tree)), None
        )
        if view is not None and view.movie is not None:
            try:
                return view_of(tree, one, options).movie(tree, options)  # type: ignore[misc]
            except FileError as error:
                reasons.append(f"no movie of the {one}: {error}")
    raise FileError("\n".join(reasons or [f"{KINDS[kind_of(tree)].description} has no movie"]))


def _chosen(tree: DataTree, name: str | None, options: Options) -> tuple[View, Options]:
    """The view of a name, and its options; the name of a view of a sweep is that of a measure."""
    kind = kind_of(tree)
    takes_measure = any(one.name == one.kind == kind and "measure" in one.options for one in VIEWS)
    if name is not None and name != kind and takes_measure:
        name, options = None, replace(options, measure=name)
    return view_of(tree, name, options), options


def labels_of(trees: Sequence[DataTree], names: Sequence[str]) -> list[str]:
    """A label for each output: how it differs from the others."""
    short = [plain(Path(name).stem if name.endswith(".nc") else name) for name in names]
    try:
        configs = [config_of(tree) for tree in trees]
    except FileError:
        # A measured trace may lack a configuration.
        return short
    labels = differences.labels(configs, short, setting)
    return [
        f"measured: {name}" if is_measured(tree) else label
        for tree, name, label in zip(trees, short, labels, strict=True)
    ]


def draw(
    trees: Sequence[DataTree],
    names: Sequence[str],
    view: str | None = None,
    options: Options = NO_OPTIONS,
    *,
    figure: Canvas | None = None,
    axes: Axes | None = None,
) -> Canvas:
    """Draw a view of outputs, or a measure of a sweep, into a figure, or its most informative panel
    into axes; several over each other."""
    chosen = picture(trees, names, view, options)
    if axes is None:
        return chosen.whole(figure)
    with styled():
        chosen.panel(axes)
    return axes.figure
