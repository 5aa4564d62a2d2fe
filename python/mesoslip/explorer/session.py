"""The changes that were made on the page, and their errors."""

from __future__ import annotations

import shlex
import time
from collections.abc import Mapping, Sequence
from typing import Any

from mesoslip.configuration.arguments import check_choice
from mesoslip.configuration.config import Config
from mesoslip.configuration.contacts.tables.interaction import LATTICES
from mesoslip.configuration.differences import text_of
from mesoslip.configuration.sliders import SLIDERS
from mesoslip.errors import ConfigError, FileError, MesoslipError, Problem
from mesoslip.explorer.controls import (
    BY_KEY,
    LATTICE_SIZE,
    NONE,
    SWITCHES,
    TABLE_CONTROLS,
    Control,
    derived_value,
    lattice_size,
    values,
)
from mesoslip.explorer.links import MAX_LINK, Setting, link_of, setting_of
from mesoslip.explorer.live_run import runnable
from mesoslip.explorer.stages import EXAMPLE, read_stages, write_stages

# Changes of one key within this time are undone together [s].
ONE_MOVE = 1.0


class Session:
    """A configuration with changes; one with errors is taken back, unless there was nothing yet
    that can be run."""

    def __init__(self, start: Config, source: str) -> None:
        self._home = Setting(start, source, {})
        self._history: list[Setting] = []
        # The setting that is shown, the key that was changed last, and when.
        self._now, self._recorded_key, self._recorded = -1, "", 0.0
        self._begin(start, source)
        self._restored({})

    def _begin(self, start: Config, source: str) -> None:
        self.start, self.source = start, source
        # The latest configuration that can be run, and values of the controls that apply to it.
        self.config = start
        self.values = self._at_start = values(start)
        # Text of each key that was changed, as for ``--set``.
        self.changes: dict[str, str] = {}
        # Errors and other consequences of the last change, by the key of the control that shows
        # them.
        self.problems: dict[str, str] = {}
        self.notes: dict[str, str] = {}
        self._before: dict[str, str] = {}
        self._last = ""

    def begin(self, start: Config, source: str, changes: Mapping[str, str] | None = None) -> bool:
        """Start from another configuration; returns whether it can be run."""
        self._begin(start, source)
        return self._restored(changes or {})

    def _restored(self, changes: Mapping[str, str], is_new: bool = True) -> bool:
        """Take changes from the history, or as a new setting."""
        self.changes = dict(changes)
        self._before, self._last, self.notes = dict(changes), "", {}
        self.is_runnable = self._check("")
        if is_new:
            self._record("")
        return self.is_runnable

    def _record(self, key: str) -> None:
        """Add the setting to the history, or replace the last one of the same move of a knob."""
        setting = Setting(self.start, self.source, dict(self.changes))
        now = time.monotonic()
        if key and key == self._recorded_key and now - self._recorded < ONE_MOVE:
            self._history[self._now] = setting
        else:
            self._now += 1
            self._history[self._now :] = [setting]
        self._recorded_key, self._recorded = key, now

    @property
    def can_undo(self) -> bool:
        """Whether there is an earlier setting."""
        return self._now > 0

    @property
    def can_redo(self) -> bool:
        """Whether a setting was undone."""
        return self._now + 1 < len(self._history)

    def undo(self) -> bool:
        """Return to the setting before; returns whether it can be run."""
        return self._go(-1) if self.can_undo else self.is_runnable

    def redo(self) -> bool:
        """Return to the setting that was undone; returns whether it can be run."""
        return self._go(1) if self.can_redo else self.is_runnable

    def _go(self, step: int) -> bool:
        self._now += step
        self._recorded_key = ""
        start, source, changes = self._history[self._now]
        if start is not self.start:
            self._begin(start, source)
        return self._restored(changes, is_new=False)

    def change(self, key: str, text: str) -> bool:
        """Change a key as for ``--set``, or back to its value at the start; whether the
        configuration can be run with all changes."""
        control = BY_KEY[key]
        self._before, self._last = dict(self.changes), key
        self.notes = {}
        text = " ".join(text.split())
        try:
            self._lay_over(control, text)
        except MesoslipError as error:
            self.problems = {key: str(error)}
            self.changes = dict(self._before)
            return False
        is_right = self._check(key)
        if is_right or not self.is_runnable:
            self.is_runnable = is_right
            self._record(key)
        else:
            self.changes = dict(self._before)
            self.notes = {}
            if key in self.problems and not control.is_text:
                # The field shows the value before the change.
                self.problems[key] = f"“{text}” refused: {self.problems[key]}"
        return is_right

    def take_back(self, message: str) -> bool:
        """Take back the last change, as its run failed with a message; returns whether there was
        one."""
        if self.changes == self._before:
            return False
        last = self._last
        self._history[self._now :] = []
        self._now -= 1
        self._restored(self._before, is_new=self._now < 0)
        self.problems = {last: message}
        return True

    def reset(self) -> bool:
        """Remove all changes; returns whether the configuration at the start can be run."""
        return self._restored({})

    @property
    def link(self) -> str:
        """The query of an address that gives this setting; empty for that of the program, and for
        one that is too long.

        It names a ready run, or has the whole configuration at the start, and the changes.
        """
        if not self.changes and self.start == self._home.start:
            return ""
        query = link_of(Setting(self.start, self.source, self.changes))
        return query if len(query) <= MAX_LINK else ""

    def follow(self, query: Sequence[tuple[str, str]]) -> None:
        """Take the setting of a link; an error if it has none that can be run."""
        setting = setting_of(query, self._home)
        if not self.begin(*setting):
            problems = [f"{key}: {text}" if key else text for key, text in self.problems.items()]
            self.begin(self._home.start, self._home.source)
            raise FileError("; ".join(problems))

    def _lay_over(self, control: Control, text: str) -> None:
        """Add a change to the others, with the keys that it requires."""
        key = control.key
        if control.is_text:
            self._set_stages(text)
            return
        if control.is_switch:
            self._switch(control, text)
            return
        if text in {self.start_text(key), NONE}:
            self.changes.pop(key, None)
        else:
            self.changes[key] = text
        if control.required:
            self._set_required(key, text)
        if key == "interaction.lattice" and text in LATTICES:
            self._fit_lattice(text)
        if key in LATTICE_SIZE:
            self._count_lattice()
        if key in {"slider.kind", "slider.blocks"}:
            self._divide_among_blocks(key)

    def _set_stages(self, text: str) -> None:
        """Change the drive to stages, or back to one velocity."""
        for one in ("drive.stage", "drive.velocity"):
            self.changes.pop(one, None)
        if text != self.start_text("drive.stage"):
            if not text:
                raise FileError(f"give at least one stage, such as: {EXAMPLE}")
            self.changes["drive.stage"] = read_stages(text)
            if self.start.drive.velocity is not None:
                self.changes["drive.velocity"] = NONE

    def _switch(self, control: Control, text: str) -> None:
        """Give a table the keys of a choice, or omit it."""
        table, needed = control.key, control.required
        check_choice(table, text, control.choices)
        every = {one for keys in needed.values() for one in keys}
        for one in (*every, table):
            if one not in self._needed_by_others(table):
                self.changes.pop(one, None)
        if text == self.start_text(table):
            return
        if text == NONE:
            self.changes[table] = NONE
            for one, value in needed.get(NONE, {}).items():
                self.changes[one] = value or derived_value(one, self.config)
            return
        for one in sorted(every):
            is_there = one in self._at_start
            if one not in needed[text]:
                if is_there:
                    self.changes[one] = NONE
            elif not one.startswith(table):
                self.changes[one] = needed[text][one]
            elif not is_there:
                self.changes[one] = needed[text][one] or derived_value(one, self.config)

    def _needed_by_others(self, table: str) -> set[str]:
        """Keys that the choices of other tables require now."""
        return {
            one
            for key in (*TABLE_CONTROLS, *SWITCHES)
            if key != table
            for one in BY_KEY[key].required.get(self.text(key), {})
        }

    def start_text(self, key: str) -> str:
        """Value of a key at the start; empty if it was not given."""
        return self._text_of(key, self._at_start[key]) if key in self._at_start else ""

    def text(self, key: str) -> str:
        """Current value of a key, valid or not."""
        if key in self.changes and not BY_KEY[key].is_text:
            return self.changes[key]
        value = self.values.get(key)
        return "" if value is None else self._text_of(key, value)

    @staticmethod
    def _text_of(key: str, value: Any) -> str:
        return write_stages(value) if BY_KEY[key].is_text else text_of(key, value)

    def is_changed(self, key: str) -> bool:
        """Whether a key differs from the start."""
        if BY_KEY[key].is_switch:
            return self.values.get(key) != self._at_start.get(key)
        return key in self.changes

    @property
    def shown(self) -> list[str]:
        """Keys of the controls that apply, and of those with errors."""
        return [key for key in BY_KEY if key in self.values or key in self.problems]

    @property
    def command(self) -> str:
        """The command that runs the configuration."""
        changes = (f"--set {shlex.quote(f'{key}={text}')}" for key, text in self.changes.items())
        return " ".join(["mesoslip run", self.source, *changes])

    def _set_required(self, key: str, text: str) -> None:
        """Add the keys that a choice requires, and remove those that it does not have."""
        needed = BY_KEY[key].required
        mine = {one for keys in needed.values() for one in keys}
        known = self._at_start
        if key in TABLE_CONTROLS:
            # Changes within a table are removed with the table, or with their choice.
            for one in mine.difference(needed.get(text, {}), self._needed_by_others(key)):
                self.changes.pop(one, None)
        else:
            kept = SLIDERS[text].model_fields if text in SLIDERS else {}
            for one in list(self.changes):
                table, _, name = one.partition(".")
                if table == "slider" and kept and name not in kept:
                    del self.changes[one]
            for one in mine:
                is_omitted = needed.get(text, {}).get(one, NONE) == NONE
                if self.changes.get(one) == NONE or (is_omitted and one not in known):
                    self.changes.pop(one, None)
        if key in self.changes:
            for one, value in needed.get(text, {}).items():
                if one in LATTICE_SIZE:
                    continue
                # Keys of a table are given only if the table is.
                is_given = one in known and (key not in TABLE_CONTROLS or known[key] != NONE)
                if value == NONE and is_given:
                    self.changes[one] = NONE
                elif value != NONE and not is_given:
                    self.changes.setdefault(one, value or derived_value(one, self.config))

    def _fit_lattice(self, lattice: str) -> None:
        """Set columns and rows to those of N contacts, unless the present ones fit."""
        sizes = [self.values.get(one) for one in LATTICE_SIZE[:2]]
        rows = sizes[1]
        if isinstance(rows, int) and not (lattice == "triangular" and rows % 2):
            return
        count = self.config.contacts.count
        columns, rows = lattice_size(count, lattice)
        for key, size in zip(LATTICE_SIZE[:2], (columns, rows), strict=True):
            self.changes[key] = str(size)
        self._count_lattice()
        sites = columns * rows
        kept = "N is kept" if sites == count else f"N is {sites}, as {count} contacts have none"
        self.notes["interaction.lattice"] = f"{columns} columns × {rows} rows: {kept}"

    def _divide_among_blocks(self, key: str) -> None:
        """Set the number of contacts to the nearest multiple of the number of blocks."""
        count = self.config.contacts.count
        try:
            blocks = int(self.text("slider.blocks") or 1)
        except ValueError:
            return
        if self.text("slider.kind") != "interface" or blocks < 1 or count % blocks == 0:
            return
        near = blocks * max(1, round(count / blocks))
        self.changes["contacts.count"] = str(near)
        self.notes[key] = f"N is {near}, a multiple of the blocks"

    def _count_lattice(self) -> None:
        """Set the number of contacts to that of the sites of the lattice."""
        try:
            sites = int(self.text("interaction.columns")) * int(self.text("interaction.rows"))
        except ValueError:
            return
        self.changes["contacts.count"] = str(sites)
        if sites == self.start.contacts.count:
            del self.changes["contacts.count"]

    def _check(self, last: str) -> bool:
        """Apply all changes to the start, and keep the result if it can be run."""
        self.problems = {}
        try:
            config = self.start.replace(*(f"{key}={text}" for key, text in self.changes.items()))
            runnable(config)
        except ConfigError as error:
            for problem in error.problems:
                key = self._control_of(problem, last)
                message = (
                    problem.message if key == problem.key else f"{problem.key} {problem.message}"
                )
                self.problems[key] = "; ".join(
                    part for part in (self.problems.get(key), message) if part
                )
        except MesoslipError as error:
            self.problems[last] = str(error)
        else:
            self.config = config
            self.values = values(config)
            # Another notation of the same value, such as 500 us for 0.5 ms, is no change.
            for key in list(self.changes):
                if key in self.values and self.values[key] == self._at_start.get(key):
                    del self.changes[key]
        return not self.problems

    def _control_of(self, problem: Problem, last: str) -> str:
        """The control that shows an error: that of its key if it is shown, or the last changed."""
        is_there = problem.key in self.values or problem.key in self.changes
        if problem.key == "contacts.count" and self.text("interaction.lattice") != NONE:
            # The number of contacts is that of the lattice, and has no control.
            is_there = False
        return problem.key if problem.key in BY_KEY and is_there else last
