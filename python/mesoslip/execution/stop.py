"""Requests to stop soon, by a signal, by Ctrl-C, or by the caller."""

from __future__ import annotations

import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Protocol

from mesoslip.errors import MesoslipError

# Exit status of a program that a signal has ended, minus the number of the signal.
SIGNALLED = 128
STOPPING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
# Time between two checks of a waiting thread [s].
CHECK_SECONDS = 0.05


class StoppedError(MesoslipError):
    """Work was stopped before it was complete."""

    exit_status = SIGNALLED + signal.SIGINT


class StopRequest(Protocol):
    """A `Stop` or a `threading.Event`."""

    def is_set(self) -> bool: ...


class Stop:
    """A request to stop soon, also set if the outer one is, and by a signal handler; ``signal`` is
    the one that set it."""

    def __init__(self, outer: StopRequest | None = None) -> None:
        self._is_set = False
        self._outer = outer
        self.signal: signal.Signals | None = None

    def set(self) -> None:
        self._is_set = True

    def is_set(self) -> bool:
        return self._is_set or (self._outer is not None and self._outer.is_set())

    def wait(self, seconds: float) -> bool:
        """Wait for a request at most some seconds; returns whether there is one."""
        end = time.monotonic() + seconds
        while not self.is_set() and (remaining := end - time.monotonic()) > 0:
            time.sleep(min(remaining, CHECK_SECONDS))
        return self.is_set()

    @property
    def exit_status(self) -> int:
        """Exit status of a command that was stopped."""
        return SIGNALLED + (self.signal or signal.SIGINT)

    @contextmanager
    def on_interrupt(self) -> Iterator[None]:
        """Make Ctrl-C a request to stop, where no signal handler does."""
        try:
            yield
        except KeyboardInterrupt:
            self.set()

    def _receive(self, number: int, _: FrameType | None) -> None:
        if self.signal is None:
            self.signal = signal.Signals(number)
        self.set()


@contextmanager
def stopped_by_signals() -> Iterator[Stop]:
    """A stop that Ctrl-C, SIGTERM and SIGHUP set, so that files are still written whole."""
    stop = Stop()
    before = {number: signal.getsignal(number) for number in STOPPING}
    # A program that was started with nohup ignores SIGHUP.
    handled = [number for number in STOPPING if before[number] is not signal.SIG_IGN]
    for number in handled:
        signal.signal(number, stop._receive)
    try:
        yield stop
    finally:
        for number in handled:
            signal.signal(number, before[number])
