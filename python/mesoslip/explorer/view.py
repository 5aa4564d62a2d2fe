"""The page: knobs on the left, pictures on the right. `pictures` computes the numbers.

Each figure is a root of its own, which `page.html` places: a change draws only its figure again.
Everything else on the page is in `elements`.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from bokeh.document import Document
from bokeh.models import ColumnDataSource, CustomJS

from mesoslip.configuration.config import Config
from mesoslip.configuration.differences import MISSING, differences, is_bookkeeping
from mesoslip.errors import ConfigError, MesoslipError
from mesoslip.examples import example_config
from mesoslip.execution.newest_job import NewestJob
from mesoslip.execution.stop import Stop
from mesoslip.explorer.controls import BY_KEY, STEPS, Control
from mesoslip.explorer.elements import Elements
from mesoslip.explorer.figures import (
    LIMIT,
    PINNED,
    THIS,
    TITLES,
    LatticeView,
    MotionView,
    TheoryView,
)
from mesoslip.explorer.knobs import Knob
from mesoslip.explorer.links import presets, stem_of
from mesoslip.explorer.live_run import Pace, explored, run_live, runnable
from mesoslip.explorer.movies import movie_of
from mesoslip.explorer.pictures import Measured, Motion, Theories, Theory, motion
from mesoslip.explorer.session import Session
from mesoslip.explorer.stages import EXAMPLE
from mesoslip.output.writing import write_results
from mesoslip.simulation.run_realizations import Results

# Time between the picture of a change and the theory, in case of another change [s].
REST = 0.15
# Part of the run that is drawn, if the run is refused.
REFUSED = -1
# Maximum number of keys in the label of a pinned run.
MAX_KEYS = 3
# Titles of the figures, for those who do not see them.
FIGURES = {
    "force": "Force",
    "interface": "Stress over strength along the interface",
    "lattice": "Load of the contacts: force over threshold",
    **{name: title for name, (title, _) in TITLES.items()},
    "curve": "F(X) of slow sliding",
}

# Reports that a picture was drawn, which figures do in the next frame of the browser.
ACKNOWLEDGE = """
requestAnimationFrame(() => requestAnimationFrame(() => { drawn.tags = [...cb_obj.tags] }))
"""
# Shows a message when the connection to the program is lost, and hides it afterwards.
LOST = "document.body.classList.add('lost')"
FOUND = "document.body.classList.remove('lost')"


class Page:
    """The page of one tab, with its own changes and runs, which may start from a link."""

    def __init__(
        self,
        document: Document,
        start: Config,
        source: str,
        trace: Measured | None = None,
        query: Sequence[tuple[str, str]] = (),
    ) -> None:
        self._document, self._trace = document, trace
        self.session = Session(start, source)
        self._link_error = ""
        if query:
            try:
                self.session.follow(query)
            except MesoslipError as error:
                self._link_error = f"The link was not followed: {error}. This is the default."
        self._results: Results | None = None
        # The runs that are drawn: of the knobs, of the limit, and the pinned one.
        self._run: Motion | None = None
        self._others: dict[str, Motion] = {}
        self._pinned_config: Config | None = None
        self._shown_config = self.session.config
        self._compares = False
        # Numbers of changes: the last one, the last that could be run, the one that is shown, and
        # the one for which theory was started.
        self._change_count = self._turn = self._shown = self._explained = 0
        self._is_closed = self._is_together = False
        # Time of the last change by the user [s].
        self.last_change = time.monotonic()
        self._workers = {
            "run": NewestJob(),
            "limit": NewestJob(),
            "theory": NewestJob(REST),
            "movie": NewestJob(),
        }
        self._paces = {"run": Pace(), "limit": Pace()}
        self._theories = Theories()
        self.elements = Elements(self._asked)
        self._knobs = {key: Knob(control, self.session) for key, control in BY_KEY.items()}
        self._actions: dict[str, Callable[[str, Any], None]] = {
            "set": self._change,
            "move": self._move,
            "preset": lambda _key, name: self._begin(str(name)),
            "undo": lambda *_: self._went(self.session.undo()),
            "redo": lambda *_: self._went(self.session.redo()),
            "reset": lambda *_: self._went(self.session.reset()),
            "pin": lambda *_: self._pin(),
            "compare": lambda *_: self._compare(),
            "save": lambda *_: self._save(),
            "download": lambda *_: self._download(),
            "movie": lambda *_: self._make_movie(),
            "play": lambda *_: self._lattice.play(not self._lattice.is_playing),
            "snapshot": lambda _key, number: self._lattice.draw(int(number)),
        }
        self._files = ColumnDataSource({"content": []}, name="files", tags=[""])
        self._files.js_on_change(
            *("data", CustomJS(code="explorer.save(cb_obj.tags[0], cb_obj.data.content)"))
        )
        # Numbers of pictures that were sent, and drawn, with the kind of their run.
        sent = ColumnDataSource(name="sent", tags=[0, "run"])
        drawn = ColumnDataSource(name="drawn", tags=[0, "run"])
        sent.js_on_change("tags", CustomJS(args={"drawn": drawn}, code=ACKNOWLEDGE))
        drawn.on_change("tags", self._was_drawn)
        self._sent = sent
        self._motion = MotionView(self.elements)
        self._theory = TheoryView(self.elements)
        self._lattice = LatticeView(self.elements, document, self._motion.now)
        # These models have no place on the page, but belong to its document.
        held = {"files": self._files, "sent": sent, "state": self.elements.state}
        held["requests"] = self.elements.requests
        self._motion.roots[0].js_on_change("tags", CustomJS(args=held, code=""))
        # The models of a document are collected once, not for each piece of the page.
        with document.models.freeze():
            for view in (self._motion, self._theory, self._lattice):
                for root in view.roots:
                    document.add_root(root)
        groups: dict[str, list[Control]] = {}
        for control in BY_KEY.values():
            groups.setdefault(control.group, []).append(control)
        self._presets = {"": f"{start.title or source} (given)"} | presets()
        document.template_variables.update(
            heading=self._heading,
            knobs=groups,
            steps=STEPS,
            example=EXAMPLE,
            figures=FIGURES,
            presets=self._presets,
        )
        document.title = f"mesoslip explore: {self._heading}"
        self._home = start, source
        document.js_on_event("connection_lost", CustomJS(code=LOST))
        document.js_on_event("client_reconnected", CustomJS(code=FOUND))
        document.on_event("document_ready", lambda _event: self._update())
        document.on_session_destroyed(lambda _context: self.close())

    def close(self) -> None:
        """End the runs of the page."""
        self._is_closed = True
        self._results = None
        for worker in self._workers.values():
            worker.close()

    @property
    def _heading(self) -> str:
        start = self.session.start
        heading = start.title or self.session.source
        if start.run.realizations > 1:
            heading += f" (the first of {start.run.realizations} realizations)"
        return heading

    @property
    def _stem(self) -> str:
        return stem_of(self.session.source) or "run"

    @contextmanager
    def _together(self) -> Iterator[None]:
        """Send all changes as one message."""
        if self._is_together:
            yield
            return
        self._is_together = True
        self._document.hold("combine")
        try:
            yield
            self.elements.send()
        finally:
            self._is_together = False
            self._document.unhold()

    def _asked(self, action: str, name: str, value: Any) -> None:
        """Do what the user of the page asks for."""
        self.last_change = time.monotonic()
        with self._together():
            self._actions[action](name, value)

    def _change(self, key: str, text: Any) -> None:
        self._link_error = ""
        self.session.change(key, str(text))
        self._update()

    def _move(self, key: str, position: Any) -> None:
        self._change(key, self._knobs[key].text_at(int(position)))

    def _went(self, _is_runnable: bool) -> None:
        """Show a setting of the history, or the one at the start."""
        self._link_error = ""
        self._begin_knobs()
        self._update()

    def _begin(self, name: str) -> None:
        """Start from a ready run, or from the configuration that was given."""
        start, source = (example_config(name), f"{name}.toml") if name else self._home
        self._went(self.session.begin(start, source))

    def _begin_knobs(self) -> None:
        for knob in self._knobs.values():
            knob.begin()

    def _show_controls(self) -> None:
        session, show = self.session, self.elements.show
        for key, knob in self._knobs.items():
            show(key, **knob.state)
        show("error", text=session.problems.get("", "") or self._link_error)
        show("command", text=session.command)
        show("undo", disabled=not session.can_undo)
        show("redo", disabled=not session.can_redo)
        show("reset", disabled=not (session.changes or session.problems))
        show("compare", pressed=self._compares)
        show("heading", text=self._heading)
        show("page", address=session.link, title=f"mesoslip explore: {self._heading}")
        name = "" if session.start is self._home[0] else self._stem
        show("preset", value=name if name in self._presets else "")
        config = session.config
        notes = [config.continued_drive, config.unreached_drive, config.unreachable_stop]
        show("notes", text="; ".join([one for one in notes if one] + config.notes))
        self._show_pinned()

    def _update(self, is_back: bool = False) -> None:
        """Show the controls, and run the configuration if it can be run; otherwise the run that is
        shown continues. `is_back` means that the last change was taken back, as its run failed."""
        self._change_count += 1
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
        self._workers["limit"].cancel()
        self._others.pop(LIMIT, None)
        if self._compares:
            try:
                self._start("limit", runnable(config.replace({"run.engine": "me"})))
            except ConfigError as error:
                message = "N → ∞: " + "; ".join(one.message for one in error.problems)
        self.elements.show("limit", text=message)

    def _compare(self) -> None:
        self._compares = not self._compares
        self._update()
        self._draw()

    def _pin(self) -> None:
        """Keep the run that is shown beside the next ones, or let it go."""
        if PINNED in self._others:
            del self._others[PINNED]
        elif self._run is not None:
            self._others[PINNED] = self._run
            self._pinned_config = self._shown_config
        self._show_pinned()
        self._draw()

    def _show_pinned(self) -> None:
        """Name the keys in which the pinned run differs."""
        is_pinned = PINNED in self._others
        label = "release the pinned curve" if is_pinned else "pin this curve"
        self.elements.show("pin", text=label, pressed=is_pinned)
        text = ""
        if is_pinned and self._pinned_config is not None:
            found = differences([self._pinned_config, self.session.config])
            found = [one for one in found if not is_bookkeeping(one.key)] or found
            given = [f"{key} = {pinned}" for key, (pinned, _) in found if pinned != MISSING]
            more = f" and {len(given) - MAX_KEYS} more" if len(given) > MAX_KEYS else ""
            told = ", ".join(given[:MAX_KEYS]) or "the same configuration"
            verdict = self._others[PINNED].regime
            text = f"pinned: {told}{more}" + (f"; {verdict}" if verdict else "")
        self.elements.show("pinned", text=text)

    def _start(self, name: str, config: Config) -> None:
        turn, pace = self._turn, self._paces[name]
        show = self._show_motion if name == "run" else self._show_limit

        def job(stop: Stop) -> None:
            def look(results: Results) -> None:
                shown = motion(results, self._trace), results if results.complete else None
                pace.wait()
                pace.sent()
                self._publish(show, turn, shown)

            try:
                run_live(config, stop, look)
            except MesoslipError as error:
                self._publish(self._fail, turn, str(error))
            except Exception as error:
                self._publish(self._fail, turn, f"internal error: {error!r}")
                raise

        self._workers[name].submit(job)

    def _was_drawn(self, _attribute: str, _old: Any, tags: list[Any]) -> None:
        """The browser has drawn a picture: the next may come, and the theory of the first."""
        name = str(tags[1])
        self._paces[name].drawn()
        if name == "run":
            self._explain()

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

    def _report(self, text: str, **further: Any) -> None:
        self.elements.show("status", text=text, **{"class": ""}, **further)

    def _refuse(self, message: str) -> None:
        """Report why the configuration is not run."""
        further = {"class": "error", "turn": self._change_count, "part": REFUSED}
        self.elements.show("status", text=message, **further)

    def _fail(self, turn: int, message: str) -> None:
        if turn != self._turn:
            return
        if self.session.take_back(message):
            self._begin_knobs()
            self._update(is_back=True)
        else:
            self._refuse(message)

    def _show_motion(self, turn: int, shown: tuple[Motion, Results | None]) -> None:
        self._shown = turn
        drawn, results = shown
        self._run = drawn
        self._lattice.show(drawn.lattice)
        self._draw()
        self._acknowledge("run")
        if turn < self._turn:
            return
        self._shown_config = self.session.config
        self._results = results
        if turn == self._change_count:
            # Tests wait for turn and part.
            self._report(drawn.progress, turn=turn, part=drawn.part_done)

    def _show_limit(self, turn: int, shown: tuple[Motion, Results | None]) -> None:
        if turn == self._turn and self._compares:
            self._others[LIMIT] = shown[0]
            self._draw()
        self._acknowledge("limit")

    def _acknowledge(self, name: str) -> None:
        """Ask the browser to report when it has drawn the picture."""
        self._sent.tags = [int(self._sent.tags[0]) + 1, name]

    def _draw(self) -> None:
        """Draw the run and those over it, and their results as text."""
        shown = self._run
        if shown is None:
            return
        self._motion.show(shown, self._others)
        verdict = shown.regime or "the regime is known at the end of the run"
        kind = "verdict" if shown.is_judged else "verdict quiet"
        self.elements.show("verdict", text=verdict, **{"class": kind})
        runs = {THIS: shown} | self._others
        columns = [dict(one.numbers) for one in runs.values()]
        names = dict.fromkeys(name for column in columns for name in column)
        rows = [[name, *(column.get(name, "") for column in columns)] for name in names]
        self.elements.show("results", rows=rows)
        self.elements.show("results:head", heads=["", *runs])

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
