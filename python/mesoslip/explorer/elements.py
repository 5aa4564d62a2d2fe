"""The elements of the page: contents sent to the browser, and requests from there.

The browser has plain HTML with labels, which `page.html` writes and `page.js` fills.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from typing import Any

from bokeh.models import ColumnDataSource, CustomJS


class Elements:
    """Contents of the elements of the page by their names, and requests of its user: action,
    element and value."""

    def __init__(self, asked: Callable[[str, str, Any], None]) -> None:
        self._shown: dict[str, Mapping[str, Any]] = {}
        self._asked = asked
        # Number of the last request: the page ignores values older than its own.
        self._answered = 0
        self.state = ColumnDataSource(name="state", tags=[])
        self.state.js_on_change("tags", CustomJS(code="explorer.show(JSON.parse(cb_obj.tags[0]))"))
        self.requests = ColumnDataSource(name="requests", tags=[])
        self.requests.on_change("tags", self._receive)

    def _receive(self, _attribute: str, _old: Any, request: list[Any]) -> None:
        number, action, name, value = request
        self._answered = int(number)
        self._asked(str(action), str(name), value)

    def show(self, name: str, **what: Any) -> None:
        """Change what an element shows; it is sent later."""
        self._shown[name] = {**self._shown.get(name, {}), **what}

    def __getitem__(self, name: str) -> Mapping[str, Any]:
        """What an element shows."""
        return self._shown[name]

    def send(self) -> None:
        """Send everything, of which the page changes what differs."""
        text = json.dumps({"answered": self._answered, "elements": self._shown})
        if self.state.tags != [text]:
            self.state.tags = [text]
