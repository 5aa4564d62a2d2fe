"""The page: controls on the left, pictures on the right. What it shows is made elsewhere."""

from __future__ import annotations

import html
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from bokeh.document import Document
from bokeh.layouts import column, row
from bokeh.models import ColumnDataSource, CustomJS, LinearColorMapper, Range1d
from bokeh.models.annotations import BoxAnnotation, ColorBar, Span
from bokeh.models.ui import UIElement
from bokeh.models.widgets import Button, Div, Select, Slider, TextInput, Toggle
from bokeh.plotting import figure

from mesoslip.configuration.config import Config
from mesoslip.errors import ConfigError, MesoslipError
from mesoslip.explorer.controls import BY_KEY, NONE, STEPS, Control
from mesoslip.explorer.following import Worker, explored, follow
from mesoslip.explorer.pictures import Lattice, Line, Motion, Theory, motion, theory
from mesoslip.explorer.session import Session
from mesoslip.output.files import write_results
from mesoslip.simulation.runner import Results
from mesoslip.simulation.stop import StopFlag

# Time between two snapshots of a moving lattice [ms].
FRAME_MILLISECONDS = 120
CHANGED: dict[str, str | None] = {"background-color": "#fff3cd", "border-radius": "4px"}
UNCHANGED: dict[str, str | None] = {}
RED: dict[str, str | None] = {"color": "#b00020"}
# Tag of the status of what cannot be run; otherwise the part of the run that is drawn.
REFUSED = -1
# Colors of N contacts, and of infinitely many.
FIRST, SECOND = "#1f3b6f", "#c2571a"

# The browser saves what the server has put into a source, under the name that it has been given.
SAVE = CustomJS(
    code="""
    const content = cb_obj.data.content
    if (content.length == 0) return
    const link = document.createElement("a")
    link.href = URL.createObjectURL(new Blob([content], {type: "application/octet-stream"}))
    link.download = cb_obj.tags[0]
    link.click()
    setTimeout(() => URL.revokeObjectURL(link.href), 60000)
    """
)
COPY = "navigator.clipboard.writeText(command.value)"


class ControlView:
    """A control on the page: a slider or a choice, the value as text, and what is wrong with it."""

    def __init__(self, control: Control, session: Session, change: Callable[[str, str], None]):
        self.control, self._session, self._change = control, session, change
        # What the page shows: a change to that is no wish of a person.
        self._text, self._position = "", 0
        self._scale = None if control.choices else control.scale(_number(session, control.key))
        self.message = Div(visible=False, styles=RED, name=f"{control.key}:message", width=250)
        self._field: Select | TextInput
        self._slider: Slider | None = None
        if self._scale is None:
            options: list[Any] = [one for one in control.choices if one != NONE or self._may_lack]
            self._field = Select(options=options, name=control.key, width=250)
            parts: list[UIElement] = [self._field]
        else:
            self._field = TextInput(name=control.key, width=250)
            self._slider = Slider(
                start=0,
                end=STEPS,
                step=1,
                value=0,
                show_value=False,
                title="",
                name=f"{control.key}:slider",
                width=235,
            )
            self._slider.on_change("value", self._moved)
            parts = [self._field, self._slider]
        self._field.on_change("value", self._typed)
        self.layout = column(*parts, self.message, name=f"{control.key}:control", width=260)
        self.show()

    @property
    def _may_lack(self) -> bool:
        return self._session.start_text(self.control.key) == NONE

    def _moved(self, _attribute: str, _old: Any, position: float) -> None:
        if position != self._position and self._scale is not None:
            self._change(self.control.key, self.control.text(self._scale.value(position)))

    def _typed(self, _attribute: str, _old: Any, text: str) -> None:
        if text != self._text:
            self._change(self.control.key, text)

    def show(self) -> None:
        """Show the value, whether it is changed, and what is wrong with it."""
        session, key = self._session, self.control.key
        is_changed = session.is_changed(key)
        before = session.start_text(key) or "not given"
        self._text = session.text(key)
        _set(self._field, title=self.control.label + (f" ● was {before}" * is_changed))
        _set(self._field, value=self._text, styles=CHANGED if is_changed else UNCHANGED)
        value = _number(session, key)
        if self._slider is not None and self._scale is not None and key not in session.problems:
            if isinstance(value, int | float):
                self._position = self._scale.position(float(value))
            _set(self._slider, value=self._position)
        told = session.problems.get(key, "")
        _set(self.message, text=html.escape(told), visible=bool(told))
        _set(self.layout, visible=key in session.shown)


def _number(session: Session, key: str) -> object:
    return session.values.get(key)


def _set(model: Any, **properties: Any) -> None:
    """Set properties of a model that are not so already, as each of them goes over the wire."""
    for name, value in properties.items():
        if getattr(model, name) != value:
            setattr(model, name, value)


class Plot:
    """A picture of lines, each with a source of its own."""

    def __init__(self, name: str, title: str, colors: dict[str, str], **style: Any) -> None:
        self.figure = figure(
            name=name,
            title=title,
            height=200,
            sizing_mode="stretch_width",
            tools="pan,wheel_zoom,box_zoom,reset,save",
            active_drag="box_zoom",
            **style,
        )
        self.figure.toolbar.logo = None
        self.sources = {}
        for label, color in colors.items():
            source = ColumnDataSource({"x": [], "y": []}, name=f"{name}:{label}")
            legend: dict[str, Any] = {"legend_label": label} if len(colors) > 1 else {}
            self.figure.line("x", "y", source=source, color=color, line_width=1.3, **legend)
            self.sources[label] = source
        if len(colors) > 1:
            self.figure.legend.location = "top_right"
            self.figure.legend.label_text_font_size = "8pt"
            self.figure.legend.background_fill_alpha = 0.6

    def show(self, **lines: Line) -> None:
        """Draw lines by their labels."""
        for label, drawn in lines.items():
            self.sources[label.replace("_", " ")].data = {"x": drawn.x, "y": drawn.y}
        named = next((one for one in lines.values() if not one.is_empty), None)
        if named is not None:
            _set(self.figure.xaxis[0], axis_label=named.x_label)
            _set(self.figure.yaxis[0], axis_label=named.y_label)


class MotionView:
    """Pictures of a run: force, velocity and detached contacts, and a slip in close-up."""

    def __init__(self, prefix: str, title: str, color: str) -> None:
        self._range = Range1d(start=0, end=1)
        self.title = Div(text=f"<b>{html.escape(title)}</b>", name=f"{prefix}title")
        self.told = Div(text="", name=f"{prefix}regime", sizing_mode="stretch_width")
        self.now = Span(location=0, dimension="height", line_color="gray", visible=False)
        self.force = Plot(f"{prefix}force", "Spring force", {"force": color}, x_range=self._range)
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
        )
        self.plots = (self.force, self.velocity, self.detached, self.slip)
        self.layout = column(
            self.title,
            self.told,
            *(plot.figure for plot in self.plots),
            name=f"{prefix}motion",
            sizing_mode="stretch_width",
        )

    def show(self, shown: Motion) -> None:
        """Draw what a run has come to; what it has not yet come to is grey."""
        self.force.show(force=shown.force)
        self.velocity.show(velocity=shown.velocity)
        self.detached.show(detached=shown.detached)
        self.slip.show(spring_force=shown.slip_force, contact_force=shown.slip_contact_force)
        _set(self._range, start=0.0, end=shown.end, reset_start=0.0, reset_end=shown.end)
        reached = shown.force.x[-1] if len(shown.force.x) else 0.0
        _set(self._done, left=float(reached), visible=shown.part_done < 1)
        numbers = ", ".join(f"{name} {value}" for name, value in shown.numbers)
        _set(self.told, text=f"<b>{html.escape(shown.regime)}</b><br>{html.escape(numbers)}")


class TheoryView:
    """The force curve of the master equation, and what follows from it."""

    def __init__(self) -> None:
        self.plot = Plot(
            "curve",
            "F(X) of slow sliding, and the spring",
            {"force": FIRST, "slope -K": SECOND},
            x_range=Range1d(start=0, end=1),
            y_range=Range1d(start=0, end=1),
        )
        self._critical = ColumnDataSource({"x": [], "y": []}, name="curve:X_c")
        self.plot.figure.scatter("x", "y", source=self._critical, size=9, color=SECOND)
        self.told = Div(text="", name="theory", sizing_mode="stretch_width")
        self.layout = column(self.plot.figure, self.told, sizing_mode="stretch_width")

    def show(self, shown: Theory) -> None:
        """Draw the curve, and the line of slope -K through X_c."""
        self.plot.sources["force"].data = {"x": shown.curve.x, "y": shown.curve.y}
        self.plot.sources["slope -K"].data = {"x": shown.spring.x, "y": shown.spring.y}
        found = [] if shown.critical is None else [shown.critical]
        self._critical.data = {"x": [x for x, _ in found], "y": [y for _, y in found]}
        if not shown.curve.is_empty:
            force = shown.curve.y
            span = float(np.nanmax(force) - min(0.0, np.nanmin(force))) or 1.0
            # The line of a stiff spring leaves the picture.
            low, high = min(0.0, float(np.nanmin(force))) - 0.05 * span, float(np.nanmax(force))
            high, end = high + 0.1 * span, float(shown.curve.x[-1])
            _set(self.plot.figure.y_range, start=low, end=high, reset_start=low, reset_end=high)
            _set(self.plot.figure.x_range, start=0.0, end=end, reset_start=0.0, reset_end=end)
            _set(self.plot.figure.xaxis[0], axis_label=shown.curve.x_label)
            _set(self.plot.figure.yaxis[0], axis_label=shown.curve.y_label)
        numbers = ", ".join(f"{name} = {value}" for name, value in shown.numbers)
        _set(self.told, text=f"{html.escape(numbers)}<br>{html.escape(shown.told)}")


class LatticeView:
    """A lattice of contacts in motion: how near each is to breaking."""

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
            title="Load of the contacts",
            height=360,
            width=420,
            match_aspect=True,
            tools="pan,wheel_zoom,reset,save",
        )
        self._figure.toolbar.logo = None
        look: dict[str, Any] = {"color_mapper": mapper}
        self._figure.image(source=self._source, **look)
        self._figure.add_layout(ColorBar(color_mapper=mapper, width=8), "right")
        self._place = Slider(
            start=0, end=1, step=1, value=0, title="snapshot", name="snapshot", width=300
        )
        self._place.on_change("value", lambda _a, _o, place: self._draw(int(place)))
        self._moving = Toggle(label="▶ move", name="moving", width=90)
        self._moving.on_change("active", lambda _a, _o, is_active: self._move(is_active))
        self.layout = column(self._figure, row(self._moving, self._place), visible=False)

    def show(self, lattice: Lattice | None) -> None:
        """Show snapshots, first the last one; nothing without a lattice."""
        self._lattice = lattice
        _set(self.layout, visible=lattice is not None)
        _set(self._now, visible=lattice is not None)
        if lattice is None:
            self._moving.active = False
            return
        last = len(lattice.times) - 1
        _set(self._place, end=max(1, last))
        if self._place.value != last and not self._moving.active:
            self._place.value = last
        else:
            self._draw(min(int(self._place.value), last))

    def _draw(self, place: int) -> None:
        lattice = self._lattice
        if lattice is None:
            return
        place = min(place, len(lattice.times) - 1)
        loads = lattice.loads[place]
        rows, columns = loads.shape
        data = {"image": [loads], "x": [0], "y": [0], "dw": [columns], "dh": [rows]}
        self._source.data = data
        told = f"Load of the contacts at {lattice.times[place]:.4g} s, grey: detached"
        if lattice.avalanches[place]:
            told += f"; before it an avalanche of {lattice.avalanches[place]}"
        _set(self._figure.title, text=told)
        _set(self._now, location=float(lattice.places[place]))

    def _move(self, is_active: bool) -> None:
        if self._beat is not None:
            self._document.remove_periodic_callback(self._beat)
            self._beat = None
        if is_active:
            self._beat = self._document.add_periodic_callback(self._step, FRAME_MILLISECONDS)

    def _step(self) -> None:
        if self._lattice is not None:
            self._place.value = (int(self._place.value) + 1) % len(self._lattice.times)


class Page:
    """A page of its own for each tab, with its own changes and its own runs."""

    def __init__(self, document: Document, start: Config, source: str) -> None:
        self._document = document
        self._stem = Path(source).stem or "run"
        self.session = Session(start, source)
        self._results: Results | None = None
        # Number of what is shown, or to be shown, so that nothing outdated is.
        self._turn = 0
        self._is_closed = False
        self._workers = {name: Worker(f"explore {name}") for name in ("run", "limit", "theory")}
        self._controls = {
            key: ControlView(control, self.session, self._change) for key, control in BY_KEY.items()
        }
        self._status = Div(text="", name="status", tags=[0], sizing_mode="stretch_width")
        self._error = Div(text="", name=":message", styles=RED, visible=False)
        self._command = TextInput(name="command", sizing_mode="stretch_width", disabled=True)
        self._files = ColumnDataSource({"content": []}, name="files", tags=[""])
        self._files.js_on_change("data", SAVE)
        self._limit = Toggle(label="beside N → ∞", name="limit", width=130)
        self._limit.on_change("active", lambda _a, _o, _n: self._update())
        self._limit_message = Div(visible=False, styles=RED, name="limit:message")
        self._motion = MotionView("", "N contacts", FIRST)
        self._beside = MotionView("limit:", "N → ∞, the master equation", SECOND)
        self._beside.layout.visible = False
        self._theory = TheoryView()
        self._lattice = LatticeView(document, self._motion.now)
        document.title = f"mesoslip explore: {start.title or source}"
        document.add_root(self._layout())
        document.on_event("document_ready", lambda _event: self._update())
        document.on_session_destroyed(lambda _context: self.close())
        self._show_controls()

    def close(self) -> None:
        """End all that is under way for the page."""
        self._is_closed = True
        self._results = None
        for worker in self._workers.values():
            worker.close()

    def _layout(self) -> UIElement:
        start = self.session.start
        title = Div(
            text=f"<h2 style='margin: 0'>{html.escape(start.title or self.session.source)}</h2>",
            sizing_mode="stretch_width",
        )
        buttons = {
            "reset": ("reset all", self._reset),
            "save": ("save as TOML", self._save),
            "download": ("download the output", self._download),
        }
        made = []
        for name, (label, callback) in buttons.items():
            button = Button(label=label, name=name, width=150)
            button.on_click(callback)
            made.append(button)
        copy = Button(label="copy the command", name="copy", width=150)
        copy.js_on_click(CustomJS(args={"command": self._command}, code=COPY))
        groups: dict[str, list[UIElement]] = {}
        for key, view in self._controls.items():
            groups.setdefault(BY_KEY[key].group, []).append(view.layout)
        knobs = [
            column(Div(text=f"<b>{name}</b>"), *views, width=270) for name, views in groups.items()
        ]
        beside = row(self._motion.layout, self._beside.layout, sizing_mode="stretch_width")
        right = column(
            title,
            row(*made, copy, self._limit, sizing_mode="stretch_width"),
            self._limit_message,
            self._error,
            self._command,
            self._status,
            beside,
            row(self._theory.layout, self._lattice.layout, sizing_mode="stretch_width"),
            sizing_mode="stretch_width",
        )
        return row(
            column(
                *knobs,
                width=300,
                height_policy="fit",
                styles={
                    "overflow-y": "auto",
                    "max-height": "calc(100vh - 20px)",
                    "position": "sticky",
                    "top": "0",
                },
            ),
            right,
            sizing_mode="stretch_width",
        )

    @contextmanager
    def _together(self) -> Iterator[None]:
        """Send all that is changed as one message."""
        self._document.hold("combine")
        try:
            yield
        finally:
            self._document.unhold()

    def _change(self, key: str, text: str) -> None:
        self.session.change(key, text)
        self._update()

    def _reset(self) -> None:
        self.session.reset()
        self._update()

    def _show_controls(self) -> None:
        for view in self._controls.values():
            view.show()
        elsewhere = self.session.problems.get("", "")
        _set(self._error, text=html.escape(elsewhere), visible=bool(elsewhere))
        _set(self._command, value=self.session.command)

    def _update(self) -> None:
        """Show the controls as they are, and run what they say if it can be run."""
        self._results = None
        self._turn += 1
        session = self.session
        with self._together():
            self._show_controls()
            if session.problems:
                for worker in self._workers.values():
                    worker.cancel()
                self._tell("what is marked in red cannot be run")
                self._status.tags = [self._turn, REFUSED]
                return
            self._tell("running …")
            self._workers["theory"].cancel()
            self._start("run", session.config)
            self._start_limit(session.config)

    def _start_limit(self, config: Config) -> None:
        """Run the same with infinitely many contacts beside it, if that is wanted and possible."""
        told = ""
        is_wanted = bool(self._limit.active)
        self._workers["limit"].cancel()
        if is_wanted:
            try:
                limit = config.replace({"run.engine": "me"})
                self._start("limit", limit)
            except ConfigError as error:
                told = "; ".join(one.message for one in error.problems)
        _set(self._limit_message, text=html.escape(told), visible=bool(told))
        _set(self._beside.layout, visible=is_wanted and not told)

    def _start(self, name: str, config: Config) -> None:
        turn, wanted = self._turn, explored(config)
        show = self._show_motion if name == "run" else self._show_limit
        # Theory waits until there is a first picture, as that is what a person waits for.
        waiting = [config] if name == "run" else []

        def job(stop: StopFlag) -> None:
            def look(results: Results) -> None:
                kept = results if results.complete else None
                self._publish(stop, turn, show, (motion(results), kept))
                if waiting:
                    self._start_theory(stop, turn, waiting.pop())

            try:
                follow(wanted, stop, look)
            except MesoslipError as error:
                self._publish(stop, turn, self._tell, str(error))

        self._workers[name].submit(job)

    def _start_theory(self, run: StopFlag, turn: int, config: Config) -> None:
        if not run.is_set():
            self._workers["theory"].submit(
                lambda stop: self._publish(stop, turn, self._show_theory, theory(config))
            )

    def _publish(
        self, stop: StopFlag, turn: int, show: Callable[[Any], None], shown: object
    ) -> None:
        """Have the page show something, unless it is outdated then."""
        if not stop.is_set():
            self._document.add_next_tick_callback(partial(self._show, stop, turn, show, shown))

    def _show(self, stop: StopFlag, turn: int, show: Callable[[Any], None], shown: object) -> None:
        if self._is_closed or stop.is_set() or turn != self._turn:
            return
        with self._together():
            show(shown)

    def _tell(self, text: str) -> None:
        _set(self._status, text=html.escape(text))

    def _show_motion(self, shown: tuple[Motion, Results | None]) -> None:
        drawn, self._results = shown
        self._motion.show(drawn)
        self._lattice.show(drawn.lattice)
        done = "" if drawn.part_done >= 1 else f"{100 * drawn.part_done:.0f} % of the run"
        self._tell(done or "done")
        # What a test, or who measures, waits for.
        self._status.tags = [self._turn, drawn.part_done]

    def _show_limit(self, shown: tuple[Motion, Results | None]) -> None:
        self._beside.show(shown[0])

    def _show_theory(self, shown: Theory) -> None:
        self._theory.show(shown)

    def _save(self) -> None:
        if self.session.problems:
            self._tell("what is marked in red cannot be saved")
            return
        self._send(f"{self._stem}.toml", self.session.config.to_toml().encode())

    def _download(self) -> None:
        if self._results is None:
            self._tell("the run is not over; the output is there when it is")
            return
        with TemporaryDirectory() as folder:
            path = Path(folder) / f"{self._stem}.nc"
            write_results(self._results, path)
            self._send(path.name, path.read_bytes())

    def _send(self, name: str, content: bytes) -> None:
        """Give the browser a file to save."""
        self._files.tags = [name]
        self._files.data = {"content": np.frombuffer(content, dtype=np.uint8)}
