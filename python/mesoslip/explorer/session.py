"""What a person has changed on the page, and what is wrong with it."""

from __future__ import annotations

import shlex

from mesoslip.configuration.config import Config
from mesoslip.configuration.differences import text_of
from mesoslip.configuration.sliders import SLIDERS
from mesoslip.errors import ConfigError, MesoslipError, Problem
from mesoslip.explorer.controls import BY_KEY, COUNTED, FOR_TABLES, NONE, values
from mesoslip.explorer.following import runnable


class Session:
    """A configuration with changes to it.

    Attributes
    ----------
    start
        The configuration without them.
    source
        What the command line calls it.
    changes
        Text of each key that was changed, as for ``--set``.
    config
        The latest configuration that can be run; all changes are in it unless there are problems.
    problems
        What is wrong, by the key of the control that it is shown at.
    values
        Values of the controls that have a meaning in ``config``, in SI, by key.
    """

    def __init__(self, start: Config, source: str) -> None:
        self.start = self.config = start
        self.source = source
        self.changes: dict[str, str] = {}
        self.problems: dict[str, str] = {}
        self.values = self._at_start = values(start)
        self._check("")

    def change(self, key: str, text: str) -> bool:
        """Change a key; returns whether the configuration can be run with all changes.

        Parameters
        ----------
        key
            Key of a control.
        text
            Its value as for ``--set``; with that of the start it is not changed any more.

        Raises
        ------
        KeyError
            If there is no such control.
        """
        control = BY_KEY[key]
        text = " ".join(text.split())
        if text in {self.start_text(key), NONE}:
            self.changes.pop(key, None)
        else:
            self.changes[key] = text
        if control.beside:
            self._lay_beside(key, text)
        if key in COUNTED:
            self._count_lattice()
        return self._check(key)

    def reset(self) -> bool:
        """Take back all changes."""
        self.changes.clear()
        return self._check("")

    def start_text(self, key: str) -> str:
        """Value of a key at the start; empty if it was not given."""
        return text_of(key, self._at_start[key]) if key in self._at_start else ""

    def text(self, key: str) -> str:
        """Value of a key as it is now, right or wrong."""
        if key in self.changes:
            return self.changes[key]
        value = self.values.get(key)
        return "" if value is None else text_of(key, value)

    def is_changed(self, key: str) -> bool:
        """Whether a key differs from the start."""
        return key in self.changes

    @property
    def shown(self) -> list[str]:
        """Keys of the controls that have a meaning now, and of those that are wrong."""
        return [key for key in BY_KEY if key in self.values or key in self.problems]

    @property
    def command(self) -> str:
        """The command that runs the configuration."""
        words = ["mesoslip", "run", self.source]
        for key, text in self.changes.items():
            words += ["--set", f"{key}={text}"]
        return shlex.join(words)

    def _lay_beside(self, key: str, text: str) -> None:
        """What a choice needs, and without what it does not know."""
        needed = BY_KEY[key].beside
        mine = {one for keys in needed.values() for one in keys}
        known = self._at_start
        if key in FOR_TABLES:
            # What stands in a table goes with it, and with the choice that it belongs to.
            for one in mine.difference(needed.get(text, {})):
                self.changes.pop(one, None)
        else:
            kept = SLIDERS[text].model_fields if text in SLIDERS else {}
            for one in list(self.changes):
                table, _, name = one.partition(".")
                if table == "slider" and kept and name not in kept:
                    del self.changes[one]
        if key in self.changes:
            for one, value in needed.get(text, {}).items():
                # What goes with a table is given only if the table is.
                is_given = one in known and (key not in FOR_TABLES or known[key] != NONE)
                if not is_given:
                    self.changes.setdefault(one, value)

    def _count_lattice(self) -> None:
        """The number of contacts is that of the places of their lattice."""
        try:
            places = int(self.text("interaction.columns")) * int(self.text("interaction.rows"))
        except ValueError:
            return
        self.changes["contacts.count"] = str(places)
        if places == self.start.contacts.count:
            del self.changes["contacts.count"]

    def _check(self, last: str) -> bool:
        """Lay all changes over the start, and keep the result if it can be run."""
        self.problems = {}
        try:
            config = self.start.replace(*(f"{key}={text}" for key, text in self.changes.items()))
            runnable(config)
        except ConfigError as error:
            for problem in error.problems:
                key = self._place(problem, last)
                told = problem.message if key == problem.key else f"{problem.key} {problem.message}"
                self.problems[key] = "; ".join(
                    part for part in (self.problems.get(key), told) if part
                )
        except MesoslipError as error:
            self.problems[last] = str(error)
        else:
            self.config = config
            self.values = values(config)
            # What is written otherwise, as 500 us for 0.5 ms, is not changed.
            for key in list(self.changes):
                if key in self.values and self.values[key] == self._at_start.get(key):
                    del self.changes[key]
        return not self.problems

    def _place(self, problem: Problem, last: str) -> str:
        """The control that a problem is shown at: its own, or else the one that was changed."""
        is_there = problem.key in self.values or problem.key in self.changes
        if problem.key == "contacts.count" and self.text("interaction.lattice") != NONE:
            # The number of contacts is that of the lattice, and has no control.
            is_there = False
        return problem.key if problem.key in BY_KEY and is_there else last
