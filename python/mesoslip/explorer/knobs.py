"""The knobs of the page: what the field, the slider and the message of each control show."""

from __future__ import annotations

import html
import re
from typing import Any

from mesoslip.explorer.controls import NONE, Control
from mesoslip.explorer.session import Session

# A symbol with an index, such as τ_d.
INDEXED = re.compile(r"\b(Δ?\w)_(\w+)\b")


def with_indices(text: str) -> str:
    """A text as HTML, with indices set below the line."""
    return INDEXED.sub(r"\1<sub>\2</sub>", html.escape(text))


class Knob:
    """A control on the page: a slider or a choice, the value as text, and its error."""

    def __init__(self, control: Control, session: Session) -> None:
        self.control, self._session = control, session
        self.begin()

    def begin(self) -> None:
        """Center the range of the slider on the value at the start of the session."""
        control = self.control
        value = self._session.values.get(control.key)
        has_range = not control.choices and not control.is_text
        self._scale = control.scale(value) if has_range else None
        self._is_centered = value is not None
        # The position where the user left the slider; the text of its value is rounded.
        self._position = 0

    def text_at(self, position: int) -> str:
        """The value at a position, to which the user has moved the slider."""
        assert self._scale is not None
        self._position = position
        return self.control.text(self._scale.value(position))

    @property
    def state(self) -> dict[str, Any]:
        """What the page shows: the value, whether it was changed, and its error or a note."""
        session, control = self._session, self.control
        key = control.key
        problem = session.problems.get(key, "")
        was = f"● was {session.start_text(key) or 'not given'}" if session.is_changed(key) else ""
        shown: dict[str, Any] = {
            "hidden": key not in session.shown,
            "value": session.text(key),
            "was": was,
            "message": problem or session.notes.get(key, ""),
            "isError": bool(problem),
        }
        if control.choices:
            # Tables that the start has can only be omitted by a switch.
            may_lack = control.is_switch or session.start_text(key) == NONE
            shown["omitted"] = "" if may_lack else NONE
        value = session.values.get(key)
        if self._scale is not None:
            if isinstance(value, int | float):
                if not self._is_centered:
                    # A key that came with a choice.
                    self._scale, self._is_centered = control.scale(value), True
                is_there = self.control.text(self._scale.value(self._position)) == shown["value"]
                if not is_there:
                    self._position = self._scale.position(float(value))
            shown["position"] = self._position
        return shown
