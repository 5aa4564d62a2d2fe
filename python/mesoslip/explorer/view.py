"""The page: knobs on the left, pictures on the right. `pictures` computes the numbers.

Each piece is a root of its own, which `page.html` places: a change draws only its piece again.
"""

from __future__ import annotations

import html
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from bokeh.document import Document
from bokeh.layouts import row
from bokeh.models import ColumnDataSource, CustomJS
from bokeh.models.ui import UIElement
from bokeh.models.widgets import Button, Div, TextInput, Toggle

from mesoslip.configuration.config import Config
from mesoslip.errors import ConfigError, MesoslipError
from mesoslip.execution.newest_job import NewestJob
from mesoslip.execution.stop import Stop
from mesoslip.explorer.controls import BY_KEY
from mesoslip.explorer.figures import FIRST, SECOND, LatticeView, MotionView, TheoryView
from mesoslip.explorer.knobs import PLAIN, RED, ControlView, set_changed
from mesoslip.explorer.live_run import explored, run_live, runnable
from mesoslip.explorer.movies import movie_of
from mesoslip.explorer.pictures import Measured, Motion, Theories, Theory, motion
from mesoslip.explorer.session import Session
from mesoslip.output.writing import write_results
from mesoslip.simulation.run_realizations import Results

# Time between the picture of a change and the theory, in case of another change [s].
REST = 0.15
# Tag of the status if the run is refused; otherwise the tag is the part of the run that is drawn.
REFUSED = -1

# The browser saves the content of a source under the name in its tags.
SAVE = """
const content = cb_obj.data.content
if (content.length == 0) return
const link = document.createElement("a")
link.href = URL.createObjectURL(new Blob([content], {type: "application/octet-stream"}))
link.download = cb_obj.tags[0]
link.click()
setTimeout(() => URL.revokeObjectURL(link.href), 60000)
"""
COPY = """
navigator.clipboard.writeText(command.value).then(() => {
  const before = button.label
  button.label = "copied"
  setTimeout(() => { button.label = before }, 1500)
})
"""
COMMAND = """
.bk-input { height: 26px; min-height: 26px; padding: 0 6px; font-family: monospace; color: #222; }
"""
# The style sheet places the parts that are shown, which are the classes of the page.
ARRANGE = "document.querySelector('main').className = cb_obj.tags.join(' ')"

# Shows a message when the connection to the program is lost, and hides it afterwards.
LOST = "document.body.classList.add('lost')"
FOUND = "document.body.classList.remove('lost')"


class Page:
    """The page of one tab, with its own changes and runs."""

    def __init__(
        self, document: Document, start: Config, source: str, trace: Measured | None = None
    ) -> None:
        self._document, self._trace = document, trace
        self._stem = Path(source).stem or "run"
        self.session = Session(start, source)
        self._results: Results | None = None
        # Numbers of changes: the last one, the last that could be run, the one that is shown, and
        # the one for which theory was started.
        self._change_count = self._turn = self._shown = self._explained = 0
        self._is_closed = False
        # Time of the last change by the user [s].
        self.last_change = time.monotonic()
        self._workers = {
            "run": NewestJob(),
            "limit": NewestJob(),
            "theory": NewestJob(REST),
            "movie": NewestJob(),
        }
        self._theories = Theories()
        self._controls = {
            key: ControlView(control, self.session, self._change) for key, control in BY_KEY.items()
        }
        self._status = Div(text="", name="status", tags=[0])
        self._error = Div(text="", name=":message", styles=RED, visible=False)
        self._command = TextInput(
            name="command", sizing_mode="stretch_width", disabled=True, stylesheets=[COMMAND]
        )
        self._files = ColumnDataSource({"content": []}, name="files", tags=[""])
        self._files.js_on_change("data", CustomJS(code=SAVE))
        self._limit = Toggle(label="compare with N → ∞", name="limit", width=150)
        self._limit.on_change("active", lambda _a, _o, _n: self._update())
        self._limit_message = Div(visible=False, styles=RED, name="limit:message")
        self._motion = MotionView("", "N contacts", FIRST, self._explain, trace is not None)
        self._limit_motion = MotionView(
            "limit:", "N → ∞, the master equation", SECOND, lambda: None, trace is not None
        )
        self._theory = TheoryView()
        self._lattice = LatticeView(document, self._motion.now)
        document.title = f"mesoslip explore: {start.title or source}"
        # The models of a document are collected once, not for each piece of the page.
        with document.models.freeze():
            for root in self._roots():
                document.add_root(root)
        groups: dict[str, list[str]] = {}
        for key, control in BY_KEY.items():
            groups.setdefault(control.group, []).append(f"{key}:control")
        heading = start.title or source
        if start.run.realizations > 1:
            heading += f" (the first of {start.run.realizations} realizations)"
        document.template_variables.update(heading=heading, knobs=groups)
        document.js_on_event("connection_lost", CustomJS(code=LOST))
        document.js_on_event("client_reconnected", CustomJS(code=FOUND))
        document.on_event("document_ready", lambda _event: self._update())
        document.on_session_destroyed(lambda _context: self.close())
        self._show_controls()

    def close(self) -> None:
        """End the runs of the page."""
        self._is_closed = True
        self._results = None
        for worker in self._workers.values():
            worker.close()

    def _roots(self) -> Iterator[UIElement]:
        """The pieces of the page."""
        yield from (view.layout for view in self._controls.values())
        buttons = {
            "reset": ("reset all", self._reset),
            "save": ("save as TOML", self._save),
            "download": ("download the output", self._download),
            "movie": ("make the movie", self._make_movie),
        }
        made: list[UIElement] = []
        for name, (label, callback) in buttons.items():
            button = Button(label=label, name=name, width=150)
            button.on_click(callback)
            made.append(button)
        copy = Button(label="copy the command", name="copy", width=150)
        copy.js_on_click(CustomJS(args={"command": self._command, "button": copy}, code=COPY))
        # These models have no place on the page, but belong to its document.
        arrangement = ColumnDataSource(name="arrangement", tags=[])
        arrangement.js_on_change("tags", CustomJS(code=ARRANGE))
        self._arrangement = arrangement
        held = {"files": self._files, "arrangement": arrangement}
        self._status.js_on_change("tags", CustomJS(args=held, code=""))
        yield row(*made, copy, self._limit, name="buttons", styles={"flex-wrap": "wrap"})
        yield from (self._error, self._limit_message, self._command, self._status)
        for view in (self._motion, self._limit_motion, self._theory, self._lattice):
            yield from view.roots

    @contextmanager
    def _together(self) -> Iterator[None]:
        """Send all changes as one message."""
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
        set_changed(self._error, text=html.escape(elsewhere), visible=bool(elsewhere))
        set_changed(self._command, value=self.session.command)

    def _update(self, is_back: bool = False) -> None:
        """Show the controls, and run the configuration if it can be run; otherwise the run that is
        shown continues. `is_back` means that the last change was taken back, as its run failed."""
        self._change_count += 1
        self.last_change = time.monotonic()
        with self._together():
            self._show_controls()
            if not self.session.is_runnable:
                self._refuse("not run: correct the values marked in red")
                return
            if self.session.problems and not is_back:
                self._refuse("refused, see the message in red: the run is unchanged")
                return
            self._results = None
            self._turn = self._change_count
            self._report("running …")
            self._workers["theory"].cancel()
            self._start("run", explored(self.session.config))
            self._start_limit(self.session.config)

    def _start_limit(self, config: Config) -> None:
        """Run infinitely many contacts too, if that is wanted and possible."""
        message = ""
        is_wanted = bool(self._limit.active)
        self._workers["limit"].cancel()
        if is_wanted:
            try:
                self._start("limit", runnable(config.replace({"run.engine": "me"})))
            except ConfigError as error:
                message = "N → ∞: " + "; ".join(one.message for one in error.problems)
        set_changed(self._limit_message, text=html.escape(message), visible=bool(message))
        self._arrange(beside=is_wanted and not message)

    def _arrange(self, **parts: bool) -> None:
        """Show or hide parts of the page."""
        there = [one for one in self._arrangement.tags if parts.get(one, True)]
        there += [one for one, is_there in parts.items() if is_there and one not in there]
        set_changed(self._arrangement, tags=there)

    def _start(self, name: str, config: Config) -> None:
        turn = self._turn
        view = self._motion if name == "run" else self._limit_motion
        show = self._show_motion if name == "run" else self._show_limit

        def job(stop: Stop) -> None:
            def look(results: Results) -> None:
                shown = motion(results, self._trace), results if results.complete else None
                view.pace.wait()
                view.pace.sent()
                self._publish(show, turn, shown)

            try:
                run_live(config, stop, look)
            except MesoslipError as error:
                self._publish(self._fail, turn, str(error))
            except Exception as error:
                self._publish(self._fail, turn, f"internal error: {error!r}")
                raise

        self._workers[name].submit(job)

    def _explain(self) -> None:
        """Compute the theory of the run that was drawn, unless it is known: after the picture, for
        which the user waits."""
        turn, config = self._turn, self.session.config
        if self._is_closed or self._shown != turn or self._explained == turn:
            return
        self._explained = turn
        known = self._theories.known(config)
        if known is not None:
            self._workers["theory"].cancel()
            with self._together():
                self._theory.show(known)
            return

        def job(stop: Stop) -> None:
            for shown in self._theories.compute(config):
                if stop.is_set():
                    return
                self._publish(self._show_theory, turn, shown)

        self._workers["theory"].submit(job)

    def _publish(self, show: Callable[[int, Any], None], turn: int, shown: object) -> None:
        """Show results of a turn on the page."""
        if self._is_closed:
            return
        try:
            self._document.add_next_tick_callback(partial(self._show, show, turn, shown))
        except AttributeError:
            # A tab that is closed has its document destroyed before the page is closed.
            context = self._document.session_context
            if context is not None and not context.destroyed:
                raise

    def _show(self, show: Callable[[int, Any], None], turn: int, shown: object) -> None:
        # A picture of an earlier change is shown, unless it is older than that on the page.
        if not self._is_closed and turn >= self._shown:
            with self._together():
                show(turn, shown)

    def _report(self, text: str) -> None:
        set_changed(self._status, text=html.escape(text), styles=PLAIN)

    def _refuse(self, message: str) -> None:
        """Report why the configuration is not run."""
        set_changed(self._status, text=html.escape(message), styles=RED)
        self._status.tags = [self._change_count, REFUSED]

    def _fail(self, turn: int, message: str) -> None:
        if turn != self._turn:
            return
        if self.session.take_back(message):
            self._update(is_back=True)
        else:
            self._refuse(message)

    def _show_motion(self, turn: int, shown: tuple[Motion, Results | None]) -> None:
        self._shown = turn
        drawn, results = shown
        self._motion.show(drawn)
        self._lattice.show(drawn.lattice)
        self._arrange(lattice=drawn.lattice is not None)
        if turn < self._turn:
            return
        self._results = results
        if turn == self._change_count:
            self._report(drawn.progress)
            # Tests wait for this.
            self._status.tags = [turn, drawn.part_done]

    def _show_limit(self, _turn: int, shown: tuple[Motion, Results | None]) -> None:
        self._limit_motion.show(shown[0])

    def _show_theory(self, turn: int, shown: Theory) -> None:
        if turn == self._turn:
            self._theory.show(shown)

    def _save(self) -> None:
        if not self.session.is_runnable:
            self._report("not saved: correct the values marked in red")
            return
        self._send(f"{self._stem}.toml", self.session.config.to_toml().encode())

    def _download(self) -> None:
        if self._results is None:
            self._report("the output is available when the run is done")
            return
        with TemporaryDirectory() as folder:
            path = Path(folder) / f"{self._stem}.nc"
            write_results(self._results, path)
            self._send(path.name, path.read_bytes())

    def _make_movie(self) -> None:
        """Run once more with what a movie needs, and send the movie to the browser."""
        if not self.session.is_runnable:
            self._report("no movie: correct the values marked in red")
            return
        turn, config = self._turn, self.session.config

        def say(text: str) -> None:
            self._publish(lambda _turn, shown: self._report(shown), turn, text)

        def job(stop: Stop) -> None:
            try:
                content = movie_of(config, stop, say)
            except MesoslipError as error:
                say(f"no movie: {error}")
                return
            if content is not None:
                self._publish(self._send_movie, turn, content)

        self._report("the movie: running …")
        self._workers["movie"].submit(job)

    def _send_movie(self, _turn: int, content: bytes) -> None:
        self._send(f"{self._stem}.gif", content)
        self._report("the movie is done")

    def _send(self, name: str, content: bytes) -> None:
        """Send a file to the browser to save."""
        self._files.tags = [name]
        self._files.data = {"content": np.frombuffer(content, dtype=np.uint8)}
