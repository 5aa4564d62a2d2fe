"""The figures of the page: lines, and an animated lattice."""

from __future__ import annotations

import html
from collections.abc import Callable
from typing import Any

import numpy as np
from bokeh.document import Document
from bokeh.layouts import row
from bokeh.models import ColumnDataSource, CustomJS, LinearColorMapper, Range1d
from bokeh.models.annotations import BoxAnnotation, ColorBar, Span
from bokeh.models.formatters import BasicTickFormatter
from bokeh.models.ui import UIElement
from bokeh.models.widgets import Div, Slider, Toggle
from bokeh.plotting import figure

from mesoslip.explorer.knobs import set_changed
from mesoslip.explorer.live_run import Pace
from mesoslip.explorer.pictures import Lattice, Line, Motion, Theory
from mesoslip.quantities import with_unit

# Time between two snapshots of an animated lattice [ms].
FRAME_MILLISECONDS = 120
# Colors of N contacts, and of infinitely many.
FIRST, SECOND = "#1f3b6f", "#c2571a"
# Room for the numbers of an axis, so that axes below each other have the same length [px].
LEFT, RIGHT = 64, 12
# Reports that a picture was drawn, which figures do in the next frame of the browser.
ACKNOWLEDGE = """
requestAnimationFrame(() => requestAnimationFrame(() => { drawn.tags = [...cb_obj.tags] }))
"""


class Plot:
    """A picture of lines, each with its own source."""

    def __init__(
        self, name: str, title: str, colors: dict[str, str], height: int = 175, **style: Any
    ) -> None:
        self.figure = figure(
            name=name,
            title=title,
            height=height,
            min_border_left=LEFT,
            min_border_right=RIGHT,
            sizing_mode="stretch_width",
            tools="pan,wheel_zoom,box_zoom,reset,save",
            active_drag="box_zoom",
            **style,
        )
        self.figure.toolbar.logo = None
        self.figure.toolbar.autohide = True
        self.figure.axis.axis_label_text_font_style = "normal"
        # Numbers of contacts are written out.
        self.figure.yaxis.formatter = BasicTickFormatter(power_limit_high=6)
        self.sources = {}
        for label, color in colors.items():
            source = ColumnDataSource({"x": [], "y": []}, name=f"{name}:{label}")
            legend: dict[str, Any] = {"legend_label": label} if len(colors) > 1 else {}
            self.figure.line("x", "y", source=source, color=color, line_width=1.3, **legend)
            self.sources[label] = source
        if len(colors) > 1:
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

    def show(self, **lines: Line) -> None:
        """Draw lines by their labels."""
        for label, drawn in lines.items():
            self.sources[label.replace("_", " ")].data = {"x": drawn.x, "y": drawn.y}
        named = next((one for one in lines.values() if not one.is_empty), None)
        for legend in self.figure.legend:
            set_changed(legend, visible=named is not None)
        if named is not None:
            set_changed(self.figure.xaxis[0], axis_label=named.x_label)
            set_changed(self.figure.yaxis[0], axis_label=named.y_label)


class MotionView:
    """Pictures of a run: force, velocity and detached contacts, and a slip in close-up.

    The names of its models begin with the prefix. `drawn` is called when the browser has drawn a
    picture.
    """

    def __init__(
        self,
        prefix: str,
        title: str,
        color: str,
        drawn: Callable[[], None],
        has_trace: bool = False,
    ) -> None:
        self.pace = Pace()
        self._count = 0
        self._range = Range1d(start=0, end=1)
        self.title = Div(text=f"<b>{html.escape(title)}</b>", name=f"{prefix}title")
        self.summary = Div(text="", name=f"{prefix}regime", sizing_mode="stretch_width")
        # The time of the lattice that is shown.
        self.now = Span(location=0, dimension="height", line_color="gray", visible=False)
        self.force = Plot(
            f"{prefix}force",
            "Spring force",
            {"measured": "#999999", "force": color} if has_trace else {"force": color},
            210,
            x_range=self._range,
        )
        self._has_trace = has_trace
        self.force.figure.add_layout(self.now)
        self._done = BoxAnnotation(left=0, fill_color="#888888", fill_alpha=0.12, visible=False)
        self.force.figure.add_layout(self._done)
        self.velocity = Plot(
            f"{prefix}velocity", "Velocity", {"velocity": color}, x_range=self._range
        )
        self.detached = Plot(
            f"{prefix}detached", "Detached contacts", {"detached": color}, x_range=self._range
        )
        self.slip = Plot(
            f"{prefix}slip",
            "The largest slip",
            {"spring force": color, "contact force": "#999999"},
            190,
        )
        self.plots = (self.force, self.velocity, self.detached, self.slip)
        acknowledged = ColumnDataSource(name=f"{prefix}drawn", tags=[0])

        def was_drawn(_attribute: str, _old: Any, _new: Any) -> None:
            self.pace.drawn()
            drawn()

        acknowledged.on_change("tags", was_drawn)
        self.summary.js_on_change("tags", CustomJS(args={"drawn": acknowledged}, code=ACKNOWLEDGE))

    @property
    def roots(self) -> list[UIElement]:
        """The models on the page."""
        return [self.title, self.summary, *(plot.figure for plot in self.plots)]

    def show(self, shown: Motion) -> None:
        """Draw a run as far as it is done; the rest of the time axis is grey."""
        beside = {"measured": shown.measured} if self._has_trace else {}
        self.force.show(force=shown.force, **beside)
        self.velocity.show(velocity=shown.velocity)
        self.detached.show(detached=shown.detached)
        self.slip.show(spring_force=shown.slip_force, contact_force=shown.slip_contact_force)
        heading = "No slip" if shown.slip_force.is_empty else "The largest slip"
        set_changed(self.slip.figure.title, text=heading)
        set_changed(self._range, start=0.0, end=shown.end, reset_start=0.0, reset_end=shown.end)
        reached = shown.force.x[-1] if len(shown.force.x) else 0.0
        set_changed(self._done, left=float(reached), visible=shown.part_done < 1)
        numbers = ", ".join(f"{name} {value}" for name, value in shown.numbers)
        set_changed(
            self.summary, text=f"<b>{html.escape(shown.regime)}</b><br>{html.escape(numbers)}"
        )
        self._count += 1
        self.summary.tags = [self._count]


class TheoryView:
    """The force curve of the master equation, and predictions from it."""

    def __init__(self) -> None:
        self.plot = Plot(
            "curve",
            "F(X) of slow sliding, and the spring",
            {"force": FIRST, "slope -K": SECOND},
            190,
            x_range=Range1d(start=0, end=1),
            y_range=Range1d(start=0, end=1),
        )
        self._critical = ColumnDataSource({"x": [], "y": []}, name="curve:X_c")
        self.plot.figure.scatter("x", "y", source=self._critical, size=9, color=SECOND)
        self.summary = Div(text="", name="theory", sizing_mode="stretch_width")
        self.roots: list[UIElement] = [self.plot.figure, self.summary]

    def show(self, shown: Theory) -> None:
        """Draw the curve, and the line of slope -K through X_c."""
        heading = "No F(X)" if shown.curve.is_empty else "F(X) of slow sliding, and the spring"
        set_changed(self.plot.figure.title, text=heading)
        for legend in self.plot.figure.legend:
            set_changed(legend, visible=not shown.curve.is_empty)
        self.plot.sources["force"].data = {"x": shown.curve.x, "y": shown.curve.y}
        self.plot.sources["slope -K"].data = {"x": shown.spring.x, "y": shown.spring.y}
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
            set_changed(self.plot.figure.xaxis[0], axis_label=shown.curve.x_label)
            set_changed(self.plot.figure.yaxis[0], axis_label=shown.curve.y_label)
        numbers = ", ".join(f"{name} = {value}" for name, value in shown.numbers)
        set_changed(self.summary, text=f"{html.escape(numbers)}<br>{html.escape(shown.summary)}")


class LatticeView:
    """An animated lattice: the load of each contact, its force over its threshold."""

    def __init__(self, document: Document, now: Span) -> None:
        self._document, self._now = document, now
        self._lattice: Lattice | None = None
        self._beat: Any = None
        self._source = ColumnDataSource(
            {"image": [], "x": [], "y": [], "dw": [], "dh": []}, name="lattice:image"
        )
        mapper = LinearColorMapper(palette="Viridis256", low=0, high=1, nan_color="#bbbbbb")
        self._figure = figure(
            name="lattice",
            title="Load of the contacts: force over threshold",
            height=400,
            max_width=420,
            sizing_mode="stretch_width",
            match_aspect=True,
            tools="pan,wheel_zoom,reset,save",
        )
        self._figure.toolbar.logo = None
        self._figure.toolbar.autohide = True
        look: dict[str, Any] = {"color_mapper": mapper}
        self._figure.image(source=self._source, **look)
        self._figure.add_layout(ColorBar(color_mapper=mapper, width=8), "right")
        self._snapshot = Slider(
            start=0, end=1, step=1, value=0, title="snapshot", name="snapshot", width=240
        )
        self._snapshot.on_change("value", lambda _a, _o, number: self._draw(int(number)))
        self._moving = Toggle(label="▶ play", name="moving", width=90)
        self._moving.on_change("active", lambda _a, _o, is_active: self._move(is_active))
        self._caption = Div(text="", name="lattice:caption", sizing_mode="stretch_width")
        self.roots: list[UIElement] = [
            self._figure,
            self._caption,
            row(self._moving, self._snapshot, name="lattice:moving"),
        ]

    def show(self, lattice: Lattice | None) -> None:
        """Show snapshots, beginning with the last one; nothing without a lattice."""
        self._lattice = lattice
        set_changed(self._now, visible=lattice is not None)
        if lattice is None:
            set_changed(self._moving, active=False)
            return
        last = len(lattice.times) - 1
        set_changed(self._snapshot, end=max(1, last))
        if self._snapshot.value != last and not self._moving.active:
            self._snapshot.value = last
        else:
            self._draw(min(int(self._snapshot.value), last))

    def _draw(self, number: int) -> None:
        lattice = self._lattice
        if lattice is None:
            return
        number = min(number, len(lattice.times) - 1)
        loads = lattice.loads[number]
        rows, columns = loads.shape
        data = {"image": [loads], "x": [0], "y": [0], "dw": [columns], "dh": [rows]}
        self._source.data = data
        caption = f"at {with_unit(float(lattice.times[number]), 's', 4)}; grey: detached"
        if lattice.avalanches[number]:
            caption += f"; largest avalanche since the last snapshot: {lattice.avalanches[number]}"
        set_changed(self._caption, text=caption)
        set_changed(self._now, location=float(lattice.positions[number]))

    def _move(self, is_active: bool) -> None:
        if self._beat is not None:
            self._document.remove_periodic_callback(self._beat)
            self._beat = None
        if is_active:
            self._beat = self._document.add_periodic_callback(self._step, FRAME_MILLISECONDS)

    def _step(self) -> None:
        if self._lattice is not None:
            self._snapshot.value = (int(self._snapshot.value) + 1) % len(self._lattice.times)
