"""Ctrl-C while the program starts, mostly in imports, ends it without a traceback."""

import os
import signal
from typing import Any

__all__ = ["INTERRUPTED", "catches_interrupts", "is_interrupt"]

INTERRUPTED = 128 + signal.SIGINT


def _leave(*_: Any) -> None:
    os._exit(INTERRUPTED)


def is_interrupt(error: BaseException | None) -> bool:
    """Whether an interrupt is behind an error, as where a class is made in an import."""
    while error is not None:
        if isinstance(error, KeyboardInterrupt):
            return True
        error = error.__cause__ or error.__context__
    return False


# An ignored signal (nohup) stays ignored.
catches_interrupts = signal.getsignal(signal.SIGINT) is signal.default_int_handler
if catches_interrupts:
    signal.signal(signal.SIGINT, _leave)
