"""View of a sweep: each measure over one swept key, or as a map over two."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.lines import Line2D

from mesoslip.array_types import DataArray, Dataset, DataTree
from mesoslip.errors import FileError
from mesoslip.plots.boundaries import add_legend, boundary_measures, draw_contours, draw_crossings
from mesoslip.plots.key_names import name_of, plain, symbol_or_name
from mesoslip.plots.printing import current, is_narrow
from mesoslip.plots.style import Canvas, canvas, write_title
from mesoslip.plots.sweep_axis import DIRECTION, SweptKey, scale_of
from mesoslip.plots.sweep_panels import (
    Measured,
    draw_directions,
    draw_line,
    draw_map,
    measured,
    norm_of,
)
from mesoslip.plots.views.base import Options, View
from mesoslip.quantities import number

# Measures of an overview, and of one in a column of a journal.
MAX_PANELS, MAX_NARROW = 6, 3
# Panels in each row of an overview, by their number, and in a row of maps of one measure.
ROWS = {0: [1], 1: [1], 2: [2], 3: [3], 4: [2, 2], 5: [3, 2], 6: [3, 3]}
MAP_COLUMNS = 3
# Width and height of a panel [inch].
PANEL = (3.0, 2.4)
# Those of a figure with a single panel.
ALONE = (4.4, 3.6)


def draw(tree: DataTree, options: Options, figure: Canvas | None) -> Canvas:
    """A panel for each of the first measures of a sweep; or one measure, with a panel for each
    value of the first of three dimensions."""
    data = tree.to_dataset()
    narrow = is_narrow(figure)
    if options.measure is None:
        first = measures(data)[: MAX_NARROW if narrow else MAX_PANELS]
        panels = [_Panel.of(data, one) for one in first]
        rows = ROWS[len(panels)]
        norm = None
    else:
        name = _known(data, options.measure)
        panels = [_Panel.of(part, name) for part in _parts(data)]
        rows = [min(MAP_COLUMNS, len(panels) - at) for at in range(0, len(panels), MAP_COLUMNS)]
        # Panels of one measure are comparable.
        norm = None if panels[0].measured.choices else norm_of([one.measured for one in panels])
    rows = [1] * len(panels) if narrow else rows
    with mpl.rc_context({"axes.spines.top": True, "axes.spines.right": True}):
        size = PANEL[0] * max(rows), PANEL[1] * len(rows) + 0.4
        figure = canvas(figure, size if len(panels) > 1 else ALONE)
        lines: dict[str, Line2D] = {}
        all_axes = _axes(figure, rows)
        for axes, panel in zip(all_axes, panels, strict=True):
            lines |= {str(one.get_label()): one for one in panel.draw(axes, norm)}
        for axes in all_axes[:-1] if narrow else ():
            axes.set_xlabel("")
        if current().title is None and tree.attrs.get("title"):
            figure.suptitle(plain(tree.attrs["title"]), x=0.01, ha="left")
        figure.legend(
            handles=list(lines.values()),
            loc="outside lower left",
            title=_about_means([one.measured for one in panels]),
            alignment="left",
        )
    return figure


def _axes(figure: Canvas, rows: list[int]) -> list[Axes]:
    """Axes in rows of a number of panels each; in an overview they fill their rows."""
    # A grid for each row: constrained layout fails where colour bars share columns of a finer one.
    grid, fills = figure.add_gridspec(len(rows), 1), sum(rows) <= MAX_PANELS
    places = [
        grid[row].subgridspec(1, count if fills else max(rows)) for row, count in enumerate(rows)
    ]
    return [
        figure.add_subplot(place[column])
        for place, count in zip(places, rows, strict=True)
        for column in range(count)
    ]


def _about_means(panels: list[Measured]) -> str:
    """The number of realizations, and what error bars are."""
    count = max(one.realizations for one in panels)
    if count == 1:
        return "one realization of each point"
    has_choices = any(one.choices for one in panels)
    has_numbers = not all(one.choices for one in panels)
    if panels[0].values.ndim > 2:
        words = [*(["mean"] * has_numbers), *(["most frequent"] * has_choices)]
        return f"{' or '.join(words)} of {count} realizations"
    means = f"mean of {count} realizations; bars: standard error"
    shares = "areas: their share" if has_numbers else f"areas: share of {count} realizations"
    return "; ".join([*([means] * has_numbers), *([shares] * has_choices)])


def draw_panel(axes: Axes, tree: DataTree, options: Options) -> None:
    """Draw a measure of a sweep, by default the first: dots and means over one key, a map of the
    mean, or of the most frequent choice, over two."""
    data = tree.to_dataset()
    name = measures(data)[0] if options.measure is None else _known(data, options.measure)
    panel = _Panel.of(data, name)
    add_legend(axes, panel.draw(axes), _about_means([panel.measured]))


def measures(data: Dataset) -> list[str]:
    """Measures of a sweep that have a picture: not those that are boundaries in another."""
    names = [str(name) for name in data.data_vars if name != "status"]
    lines = boundary_measures(names)
    return [name for name in names if name not in lines]


def _known(data: Dataset, name: str) -> str:
    there = [str(one) for one in data.data_vars if one != "status"]
    if name not in there:
        raise FileError(f"the sweep has no measure {name!r}; it has {', '.join(there)}")
    return name


class _Panel(NamedTuple):
    """A measure along the keys that are drawn; other keys have a fixed value, as in its title."""

    data: Dataset
    name: str
    keys: list[SweptKey]
    is_line: bool
    fixed: list[str]
    measured: Measured

    @classmethod
    def of(cls, data: Dataset, name: str) -> _Panel:
        data, names, fixed = _shown_keys(data)
        keys = [SweptKey.of(data[one]) for one in names]
        scale = scale_of(data[name])
        found = measured(data, name, scale.label(name_of(name)), scale.size)
        return cls(data, name, keys, data[names[0]].dims[0] != "sample", fixed, found)

    def draw(self, axes: Axes, norm: Normalize | None = None) -> list[Line2D]:
        """Draw it; returns lines for a legend, of boundaries, directions or points."""
        data, keys = self.data, self.keys
        if len(keys) == 2:
            lines = draw_map(axes, self.measured, keys, norm)
            lines += draw_contours(axes, data, self.name, keys)
        elif DIRECTION in data.dims:
            lines = draw_directions(axes, data, self.measured, keys[0])
            data = data.isel({DIRECTION: 0})
        else:
            lines = draw_line(axes, self.measured, keys[0], is_line=self.is_line)
        if len(keys) == 1:
            lines += draw_crossings(axes, data, self.name, keys[0])
        for key, which in zip(keys, "xy", strict=False):
            key.apply(axes, which)
            if len(keys) == 2:
                key.label_values(axes, which)
        if self.fixed:
            write_title(axes, "; ".join(self.fixed))
        return lines


def _shown_keys(data: Dataset) -> tuple[Dataset, list[str], list[str]]:
    """A sweep at the first values of its third and further dimensions, the keys along the first
    two, and the values of the others in words. If it goes up and down a key, only that is shown."""
    dimensions = _dimensions(data)
    if DIRECTION in data.dims:
        dimensions.sort(key=lambda name: name != data.attrs["continued_key"])
    further = dimensions[1 if DIRECTION in data.dims else 2 :]
    fixed = [f"{symbol_or_name(name)} = {_value(data[name])}" for name in further]
    data = data.isel(dict.fromkeys(further, 0))
    keys = []
    for name in dimensions[: len(dimensions) - len(further)]:
        # The samples of a hypercube are drawn over the first of its keys.
        along = [key for key in data.coords if data[key].dims == (name,) and key != name]
        keys.append(str(along[0]) if name == "sample" and along else name)
    return data, keys, fixed


def _value(coordinate: DataArray) -> str:
    """The first value of a swept key, with the unit that suits all of them."""
    value = coordinate.values[0]
    if coordinate.dtype.kind not in "fiu":
        return plain(str(value))
    scale = scale_of(coordinate)
    return f"{number(value / scale.size)} {scale.name}".rstrip()


def _dimensions(data: Dataset) -> list[str]:
    """Dimensions along which keys vary."""
    without = {"realization", DIRECTION}
    return [str(name) for name in data["status"].dims if name not in without]


def _parts(data: Dataset) -> Iterator[Dataset]:
    """The sweep at each value of its first dimension, if it has three; or of the other dimension,
    if it has two and goes up and down one."""
    dimensions = _dimensions(data)
    if len(dimensions) != (2 if DIRECTION in data.dims else 3):
        yield data
        return
    first = next(one for one in dimensions if one != data.attrs.get("continued_key"))
    dimensions.sort(key=lambda name: name != first)
    for index in range(data.sizes[first]):
        # The dimension comes last, where its single value becomes part of the title.
        yield data.isel({first: [index]}).transpose(*dimensions[1:], first, ...)


VIEW = View(
    name="sweep",
    kind="sweep",
    summary="measures over the swept keys",
    draw_all=draw,
    panel=draw_panel,
    options=frozenset({"measure"}),
)
