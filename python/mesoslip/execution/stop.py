"""A request to stop soon: of a signal, of Ctrl-C, or of whoever started the work."""

from __future__ import annotations

import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Protocol

from mesoslip.errors import MesoslipError

# Exit status of a program that a signal has ended, less the number of the signal.
SIGNALLED = 128
STOPPING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
# How often a waiting thread checks for a stop [s].
CHECK_SECONDS = 0.05


class StoppedError(MesoslipError):
    """Work was stopped before it was complete."""

    exit_status = SIGNALLED + signal.SIGINT


class StopRequest(Protocol):
    """Anything that says whether to stop, such as a `Stop` or a `threading.Event`."""

    def is_set(self) -> bool:
        """Whether to stop."""
        ...


class Stop:
    """A request to stop soon. Unlike an event, it may be set by a signal handler.

    Parameters
    ----------
    outer
        Another request, which holds for this one too.

    Attributes
    ----------
    signal
        The signal that made the request, if one did.
    """

    def __init__(self, outer: StopRequest | None = None) -> None:
        self._is_set = False
        self._outer = outer
        self.signal: signal.Signals | None = None

    def set(self) -> None:
        """Request a stop."""
        self._is_set = True

    def is_set(self) -> bool:
        """Whether a stop is requested."""
        return self._is_set or (self._outer is not None and self._outer.is_set())

    def wait(self, seconds: float) -> bool:
        """Wait for a request, for a limited time; returns whether there is one."""
        end = time.monotonic() + seconds
        while not self.is_set() and (left := end - time.monotonic()) > 0:
            time.sleep(min(left, CHECK_SECONDS))
        return self.is_set()

    @property
    def exit_status(self) -> int:
        """Exit status of a command that was stopped."""
        return SIGNALLED + (self.signal or signal.SIGINT)

    @contextmanager
    def on_interrupt(self) -> Iterator[None]:
        """Take Ctrl-C, where no handler of signals does, as a request to stop."""
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
    """A stop that Ctrl-C, SIGTERM and SIGHUP request, so that files are still written whole."""
    stop = Stop()
    before = {number: signal.getsignal(number) for number in STOPPING}
    # A program that was started with nohup does not end at SIGHUP.
    handled = [number for number in STOPPING if before[number] is not signal.SIG_IGN]
    for number in handled:
        signal.signal(number, stop._receive)
    try:
        yield stop
    finally:
        for number in handled:
            signal.signal(number, before[number])
