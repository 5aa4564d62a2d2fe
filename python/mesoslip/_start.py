"""Ctrl-C while the program starts: its end, without a traceback.

Imports take most of the start, and what they raise when interrupted may be any exception. So this
module imports only what the interpreter has at its start; ``signal`` needs ``enum`` and others.
"""

import _signal as signal  # type: ignore[import-not-found]
import os

__all__ = ["INTERRUPTED", "catches_interrupts", "is_interrupt"]

INTERRUPTED = 128 + signal.SIGINT


def _leave(*_: object) -> None:
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
