"""Signals that stop a run: it stops between two segments, and nothing is lost."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

from mesoslip.simulation.stop import StopFlag

# Exit status of a program that a signal has ended, less the number of the signal.
SIGNALLED = 128

STOPPING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class Stop(StopFlag):
    """Set by the first signal that stops a run; later ones find that it is on its way."""

    def __init__(self) -> None:
        super().__init__()
        self.signal: signal.Signals | None = None

    @property
    def exit_status(self) -> int:
        return SIGNALLED + (self.signal or signal.SIGINT)

    def receive(self, number: int, _: FrameType | None) -> None:
        """What happens at a signal: files that are being written become whole all the same."""
        if self.signal is None:
            self.signal = signal.Signals(number)
        self.set()


@contextmanager
def stopped_by_signals() -> Iterator[Stop]:
    """Have Ctrl-C, SIGTERM and SIGHUP set an event instead of cutting off what is under way."""
    stop = Stop()
    before = {number: signal.getsignal(number) for number in STOPPING}
    # Who runs a program with nohup does not want to have it ended so.
    heard = [number for number in STOPPING if before[number] is not signal.SIG_IGN]
    for number in heard:
        signal.signal(number, stop.receive)
    try:
        yield stop
    finally:
        for number in heard:
            signal.signal(number, before[number])
