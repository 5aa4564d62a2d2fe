"""The wish that a run stops soon."""

from __future__ import annotations


class StopFlag:
    """Whether a run is to stop soon. Unlike an event it may be set by a signal handler."""

    def __init__(self) -> None:
        self._is_set = False

    def set(self) -> None:
        """Have the run stop between two segments."""
        self._is_set = True

    def is_set(self) -> bool:
        """Whether the run is to stop."""
        return self._is_set
