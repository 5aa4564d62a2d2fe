"""The figures of the page: lines, and an animated lattice."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from bokeh.document import Document
from bokeh.models import ColumnDataSource, LinearColorMapper, Range1d
from bokeh.models.annotations import BoxAnnotation, ColorBar, Span
from bokeh.models.formatters import BasicTickFormatter
from bokeh.models.ui import UIElement
from bokeh.plotting import figure

from mesoslip.explorer.elements import Elements
from mesoslip.explorer.pictures import NOTHING, Axis, Interface, Lattice, Line, Motion, Theory
from mesoslip.quantities import with_unit

# Time between two snapshots of an animated lattice [ms].
FRAME_MILLISECONDS = 120
# Lines that are drawn over those of the run, by their names in legends.
LIMIT, PINNED, MEASURED = "N → ∞", "pinned", "measured"
THIS = "this run"
# Colours of the run, and of curves drawn over it.
FIRST, CONTACT = "#1f3b6f", "#8a8f98"
OVER = {MEASURED: "#777777", LIMIT: "#c2571a", PINNED: "#c98a00"}
# Room for the numbers of an axis, so that axes below each other have the same length [px].
ROOM: dict[str, Any] = {"min_border_left": 64, "min_border_right": 12}
TOOLS = "pan,wheel_zoom,box_zoom,reset,save"


def set_changed(model: Any, **properties: Any) -> None:
    """Set the properties of a model that differ: the browser draws again for each that is set."""
    for name, value in properties.items():
        if getattr(model, name) != value:
            setattr(model, name, value)


def empty_figure(name: str, tools: str = TOOLS, **style: Any) -> Any:
    """A figure as wide as the page."""
    made = figure(name=name, sizing_mode="stretch_width", tools=tools, **style)
    made.toolbar.logo = None
    made.toolbar.autohide = True
    made.axis.axis_label_text_font_style = "normal"
    return made


class Plot:
    """A picture of lines, each with its own source; without a line it is hidden."""

    def __init__(
        self,
        elements: Elements,
        name: str,
        title: str,
        colors: Mapping[str, str],
        height: int = 175,
        **style: Any,
    ) -> None:
        self._elements, self._name = elements, name
        style = ROOM | style
        self.figure = empty_figure(
            name, title=title, height=height, active_drag="box_zoom", **style
        )
        # Numbers of contacts are written out.
        self.figure.yaxis.formatter = BasicTickFormatter(power_limit_high=6)
        self.sources = {}
        for label, color in colors.items():
            source = ColumnDataSource({"x": [], "y": []}, name=f"{name}:{label}")
            dash = "dashed" if label == PINNED else "solid"
            self.figure.line(
                *("x", "y"),
                source=source,
                color=color,
                line_width=1.3,
                line_dash=dash,
                legend_label=label,
            )
            self.sources[label] = source
        # Above the picture, where no line can be.
        self.figure.add_layout(self.figure.legend[0], "above")
        self.figure.legend.update(
            orientation="horizontal",
            label_text_font_size="8pt",
            border_line_color=None,
            background_fill_alpha=0.0,
            padding=0,
            margin=0,
        )

    def show(self, title: str, lines: Mapping[str, Line], along: Axis | None = None) -> None:
        """Draw lines by their labels on a horizontal axis, by default that of the first one, in the
        largest unit that one of them has on the vertical axis."""
        drawn = [label for label, one in lines.items() if not one.is_empty]
        self._elements.show(f"panel:{self._name}", hidden=not drawn)
        if drawn:
            first = lines[drawn[0]]
            unit = max((lines[label].up.unit for label in drawn), key=lambda one: one.size)
            first = first.on(along or first.along, replace(first.up, unit=unit))
        for label, source in self.sources.items():
            one = lines.get(label, NOTHING)
            if not one.is_empty:
                one = one.on(first.along, first.up)
            if len(one.x) or len(source.data["x"]):
                source.data = {"x": one.x, "y": one.y}
        if not drawn:
            return
        (legend,) = self.figure.legend
        set_changed(legend, visible=len(drawn) > 1)
        for label, item in zip(self.sources, legend.items, strict=True):
            set_changed(item, visible=label in drawn)
        set_changed(self.figure.title, text=title)
        set_changed(self.figure.xaxis[0], axis_label=first.x_label)
        set_changed(self.figure.yaxis[0], axis_label=first.y_label)
        words = "; ".join(f"{label}: {lines[label].description}" for label in drawn)
        self._elements.show(f"described:{self._name}", text=words)


class InterfaceView:
    """An interface in space and time: stress over strength, and the ruptures of blocks."""

    def __init__(self, elements: Elements, x_range: Range1d) -> None:
        self._elements = elements
        self._stress = ColumnDataSource(
            {"image": [], "x": [], "y": [], "dw": [], "dh": []}, name="interface:image"
        )
        self._ruptures = ColumnDataSource({"x": [], "y": []}, name="interface:ruptures")
        self._range = Range1d(start=0, end=1)
        picture = empty_figure(
            "interface",
            title="Stress over strength along the interface; dots: blocks break",
            height=240,
            x_range=x_range,
            y_range=self._range,
            **ROOM,
        )
        mapper = LinearColorMapper(palette="Cividis256", low=0, high=1)
        look: dict[str, Any] = {"color_mapper": mapper}
        picture.image(source=self._stress, **look)
        picture.scatter("x", "y", source=self._ruptures, size=4, color="#e4572e")
        bar: dict[str, Any] = {"orientation": "horizontal", "height": 6, "width": 240, "padding": 2}
        picture.add_layout(ColorBar(color_mapper=mapper, **bar), "above")
        self._figure = picture
        self.roots: list[UIElement] = [picture]

    def show(self, shown: Interface | None) -> None:
        """Draw an interface; nothing without one."""
        self._elements.show("panel:interface", hidden=shown is None)
        if shown is None:
            return
        image = {"image": [shown.stress], "x": [0], "y": [0]}
        self._stress.data = image | {"dw": [shown.duration], "dh": [shown.length]}
        drawn = shown.ruptures
        self._ruptures.data = {"x": drawn.x, "y": drawn.y}
        set_changed(self._range, start=0.0, end=shown.length, reset_start=0.0)
        set_changed(self._range, reset_end=shown.length)
        set_changed(self._figure.xaxis[0], axis_label=drawn.x_label)
        set_changed(self._figure.yaxis[0], axis_label=drawn.y_label)
        words = f"{shown.stress.shape[0]} blocks, {len(drawn.x)} ruptures of blocks"
        if not drawn.is_empty:
            words += f"; {drawn.description}"
        self._elements.show("described:interface", text=words)


# Titles of the pictures of a run, and their heights.
TITLES = {
    "force": ("Force", 210),
    "velocity": ("Velocity", 175),
    "load": ("Normal force", 175),
    "detached": ("Detached contacts", 175),
    "loop": ("Force against the displacement of the slider", 175),
    "slip": ("The largest slip", 190),
}


class MotionView:
    """Pictures of a run, with other runs over it: force, velocity, detached contacts, and the
    largest slip in close-up."""

    def __init__(self, elements: Elements) -> None:
        self._range = Range1d(start=0, end=1)
        # The time of the lattice that is shown.
        self.now = Span(location=0, dimension="height", line_color="gray", visible=False)
        over = {name: OVER[name] for name in (LIMIT, PINNED)}
        self._plots = {}
        for name, (title, height) in TITLES.items():
            is_slip = name == "slip"
            colors = {"spring force" if is_slip else THIS: FIRST} | over
            if name == "force":
                colors = {MEASURED: OVER[MEASURED]} | colors
            if is_slip:
                colors = {"contact force": CONTACT} | colors
            is_over_time = name not in {"loop", "slip"}
            style: dict[str, Any] = {"x_range": self._range} if is_over_time else {}
            self._plots[name] = Plot(elements, name, title, colors, height, **style)
        force = self._plots["force"].figure
        force.add_layout(self.now)
        self._done = BoxAnnotation(left=0, fill_color="#888888", fill_alpha=0.12, visible=False)
        force.add_layout(self._done)
        self._interface = InterfaceView(elements, self._range)
        plots = [plot.figure for plot in self._plots.values()]
        self.roots: list[UIElement] = [*plots, *self._interface.roots]

    def show(self, shown: Motion, others: Mapping[str, Motion]) -> None:
        """Draw a run as far as it is done, and others over it; the rest of the time is grey."""
        for name in ("force", "velocity", "load", "detached", "loop"):
            lines = {THIS: getattr(shown, name)}
            lines |= {label: getattr(other, name) for label, other in others.items()}
            if name == "force":
                lines[MEASURED] = shown.measured
            title, _ = TITLES[name]
            if name == "force" and not shown.force.is_empty:
                title = shown.force.up.quantity.capitalize()
            along = None if name == "loop" else shown.force.along
            self._plots[name].show(title, lines, along)
        slips = {"spring force": shown.slip_force, "contact force": shown.slip_contact_force}
        slips |= {label: other.slip_force for label, other in others.items()}
        self._plots["slip"].show(TITLES["slip"][0], slips)
        self._interface.show(shown.interface)
        set_changed(self._range, start=0.0, end=shown.end, reset_start=0.0, reset_end=shown.end)
        reached = shown.force.x[-1] if len(shown.force.x) else 0.0
        set_changed(self._done, left=float(reached), visible=shown.part_done < 1)


class TheoryView:
    """The force curve of the master equation, and predictions from it."""

    def __init__(self, elements: Elements) -> None:
        self._elements = elements
        self.plot = Plot(
            elements,
            "curve",
            "F(X) of slow sliding",
            {"force": FIRST, "slope -K": OVER[LIMIT]},
            190,
            x_range=Range1d(start=0, end=1),
            y_range=Range1d(start=0, end=1),
        )
        self._critical = ColumnDataSource({"x": [], "y": []}, name="curve:X_c")
        self.plot.figure.scatter("x", "y", source=self._critical, size=9, color=OVER[LIMIT])
        self.roots: list[UIElement] = [self.plot.figure]

    def show(self, shown: Theory) -> None:
        """Draw the curve, and the line of slope -K through X_c."""
        title = "F(X) of slow sliding" + ("" if shown.spring.is_empty else ", and the spring")
        self.plot.show(title, {"force": shown.curve, "slope -K": shown.spring})
        found = [] if shown.critical is None else [shown.critical]
        self._critical.data = {"x": [x for x, _ in found], "y": [y for _, y in found]}
        if not shown.curve.is_empty:
            force = shown.curve.y
            span = float(np.nanmax(force) - min(0.0, np.nanmin(force))) or 1.0
            # The line of a stiff spring may leave the picture.
            low, high = min(0.0, float(np.nanmin(force))) - 0.05 * span, float(np.nanmax(force))
            high, end = high + 0.1 * span, float(shown.curve.x[-1])
            set_changed(
                self.plot.figure.y_range, start=low, end=high, reset_start=low, reset_end=high
            )
            set_changed(
                self.plot.figure.x_range, start=0.0, end=end, reset_start=0.0, reset_end=end
            )
        numbers = ", ".join(f"{name} = {value}" for name, value in shown.numbers)
        text = "; ".join(one for one in (numbers, shown.summary) if one).replace("`", "")
        self._elements.show("theory", symbols=text)


class LatticeView:
    """An animated lattice: the load of each contact, its force over its threshold."""

    def __init__(self, elements: Elements, document: Document, now: Span) -> None:
        self._elements, self._document, self._now = elements, document, now
        self._lattice: Lattice | None = None
        self._number = 0
        self._beat: Any = None
        self._source = ColumnDataSource(
            {"image": [], "x": [], "y": [], "dw": [], "dh": []}, name="lattice:image"
        )
        mapper = LinearColorMapper(palette="Viridis256", low=0, high=1, nan_color="#bbbbbb")
        tools = "pan,wheel_zoom,reset,save"
        picture = empty_figure("lattice", tools, height=360, max_width=420, match_aspect=True)
        picture.axis.visible = False
        picture.grid.visible = False
        # On any background of the page.
        picture.border_fill_alpha = picture.background_fill_alpha = 0.0
        look: dict[str, Any] = {"color_mapper": mapper}
        picture.image(source=self._source, **look)
        bar: dict[str, Any] = {"background_fill_alpha": 0.0, "major_label_text_color": "#7a7a7a"}
        picture.add_layout(ColorBar(color_mapper=mapper, width=8, **bar), "right")
        self.roots: list[UIElement] = [picture]
        self.show(None)

    def show(self, lattice: Lattice | None) -> None:
        """Show snapshots, beginning with the last one; nothing without a lattice."""
        self._lattice = lattice
        self._elements.show("panel:lattice", hidden=lattice is None)
        set_changed(self._now, visible=lattice is not None)
        if lattice is None:
            self.play(False)
        elif self._beat is None:
            self.draw(len(lattice.times) - 1)
        else:
            self.draw(self._number)

    def draw(self, number: int) -> None:
        """Show a snapshot."""
        lattice = self._lattice
        if lattice is None:
            return
        last = len(lattice.times) - 1
        self._number = number = min(number, last)
        loads = lattice.loads[number]
        rows, columns = loads.shape
        data = {"image": [loads], "x": [0], "y": [0], "dw": [columns], "dh": [rows]}
        self._source.data = data
        time = with_unit(float(lattice.times[number]), "s", 4)
        caption = f"at {time}; grey: detached"
        if lattice.avalanches[number]:
            caption += f"; largest avalanche since the last snapshot: {lattice.avalanches[number]}"
        self._elements.show("lattice:caption", text=caption)
        detached = 100 * float(np.mean(np.isnan(loads)))
        words = f"{columns} columns and {rows} rows, {detached:.2g} % detached, mean load of the"
        words += f" others {float(np.nanmean(loads)) if detached < 100 else 0.0:.2g}"
        self._elements.show("described:lattice", text=words)
        self._elements.show("snapshot", max=max(1, last), value=number, valuetext=time)
        set_changed(self._now, location=float(lattice.positions[number]))

    @property
    def is_playing(self) -> bool:
        """Whether the snapshots follow each other."""
        return self._beat is not None

    def play(self, is_active: bool) -> None:
        """Show the snapshots one after another, or stop."""
        if self._beat is not None:
            self._document.remove_periodic_callback(self._beat)
            self._beat = None
        if is_active:
            self._beat = self._document.add_periodic_callback(self._step, FRAME_MILLISECONDS)
        self._elements.show("moving", text="stop" if is_active else "play", pressed=is_active)

    def _step(self) -> None:
        if self._lattice is not None:
            self.draw((self._number + 1) % len(self._lattice.times))
            self._elements.send()
