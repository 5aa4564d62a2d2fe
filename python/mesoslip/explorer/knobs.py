"""The knobs of the page: a field, a slider, and the error of a value."""

from __future__ import annotations

import html
from collections.abc import Callable
from typing import Any

from bokeh.layouts import column, row
from bokeh.models.ui import UIElement
from bokeh.models.widgets import Div, Select, Slider, TextInput

from mesoslip.explorer.controls import NONE, STEPS, Control
from mesoslip.explorer.session import Session
from mesoslip.explorer.stages import EXAMPLE

# Widths of a knob, and of its field [px].
WIDTH, FIELD_WIDTH = 260, 104
# Low fields, whose titles may be longer.
FLAT = """
.bk-input { height: 26px; min-height: 26px; padding: 0 6px; }
label, .bk-input-group > label { white-space: nowrap; overflow: visible; }
"""
CHANGED: dict[str, str | None] = {"background-color": "#fff3cd", "border-radius": "4px"}
REFUSED: dict[str, str | None] = {"background-color": "#fde8ea", "border-radius": "4px"}
# A style that is omitted stays in the browser.
UNCHANGED: dict[str, str | None] = {"background-color": "transparent", "border-radius": "4px"}
RED: dict[str, str | None] = {"color": "#b00020"}
PLAIN: dict[str, str | None] = {"color": "inherit"}


def set_changed(model: Any, **properties: Any) -> None:
    """Set the properties of a model that differ: the browser draws again for each that is set."""
    for name, value in properties.items():
        if getattr(model, name) != value:
            setattr(model, name, value)


class ControlView:
    """A control on the page: a slider or a choice, the value as text, and its error."""

    def __init__(self, control: Control, session: Session, change: Callable[[str, str], None]):
        self.control, self._session, self._change = control, session, change
        # Values that the page sets itself, to tell them from changes by the user.
        self._text, self._position = "", 0.0
        has_range = not control.choices and not control.is_text
        self._scale = control.scale(_number(session, control.key)) if has_range else None
        self.message = Div(
            visible=False, styles=RED, name=f"{control.key}:message", width=WIDTH - 10
        )
        self._field: Select | TextInput
        self._slider: Slider | None = None
        parts: list[UIElement]
        look: dict[str, Any] = {"name": control.key, "margin": 0, "stylesheets": [FLAT]}
        if control.choices:
            options: list[Any] = [
                (one, control.choice_labels.get(one, one))
                for one in control.choices
                if one != NONE or self._may_lack
            ]
            self._field = Select(options=options, width=WIDTH, **look)
            parts = [self._field]
        elif self._scale is None:
            self._field = TextInput(placeholder=EXAMPLE, width=WIDTH, **look)
            parts = [self._field]
        else:
            self._field = TextInput(width=FIELD_WIDTH, **look)
            self._slider = Slider(
                start=0,
                end=STEPS,
                step=1,
                value=0,
                show_value=False,
                title="",
                name=f"{control.key}:slider",
                width=WIDTH - FIELD_WIDTH - 22,
                # Beside the field, which has a title above it.
                margin=(22, 8, 0, 14),
            )
            self._slider.on_change("value", self._moved)
            parts = [row(self._field, self._slider)]
        self._field.on_change("value", self._typed)
        self.layout = column(*parts, self.message, name=f"{control.key}:control", width=WIDTH)
        self.show()

    @property
    def _may_lack(self) -> bool:
        return self.control.is_switch or self._session.start_text(self.control.key) == NONE

    def _moved(self, _attribute: str, _old: Any, position: float) -> None:
        if position != self._position and self._scale is not None:
            self._change(self.control.key, self.control.text(self._scale.value(position)))

    def _typed(self, _attribute: str, _old: Any, text: str) -> None:
        if text != self._text:
            self._change(self.control.key, text)

    def show(self) -> None:
        """Show the value, whether it was changed, and its error or a note on it."""
        session, key = self._session, self.control.key
        is_changed = session.is_changed(key)
        before = session.start_text(key) or "not given"
        self._text = session.text(key)
        set_changed(self._field, title=self.control.label + (f" ● was {before}" * is_changed))
        set_changed(self._field, value=self._text)
        style = CHANGED if is_changed else UNCHANGED
        set_changed(self.layout, styles=REFUSED if key in session.problems else style)
        value = _number(session, key)
        if self._slider is not None and self._scale is not None:
            if isinstance(value, int | float):
                # A slider stays where the user moved it; the text is rounded.
                moved = self._slider.value
                is_there = self.control.text(self._scale.value(moved)) == self._text
                self._position = moved if is_there else self._scale.position(float(value))
            # Without a value, as the key no longer applies, it returns to its position.
            set_changed(self._slider, value=self._position)
        problem = session.problems.get(key, "")
        message = problem or session.notes.get(key, "")
        set_changed(self.message, text=html.escape(message), visible=bool(message))
        set_changed(self.message, styles=RED if problem else PLAIN)
        set_changed(self.layout, visible=key in session.shown)


def _number(session: Session, key: str) -> object:
    return session.values.get(key)
