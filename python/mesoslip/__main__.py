"""The program: ``mesoslip`` and ``python -m mesoslip`` are the command line."""

import os
import signal
import sys
from typing import Any

__all__ = ["start"]

INTERRUPTED = 128 + signal.SIGINT


def _leave(*_: Any) -> None:
    os._exit(INTERRUPTED)


# Imports take most of the start, and what they raise when interrupted may be any exception. An
# ignored signal (nohup) stays ignored.
_catches = signal.getsignal(signal.SIGINT) is signal.default_int_handler
if _catches:
    signal.signal(signal.SIGINT, _leave)

from mesoslip.command_line.main import main  # noqa: E402


def start() -> None:
    """Run the command line and exit."""
    try:
        if _catches:
            signal.signal(signal.SIGINT, signal.default_int_handler)
        main()
    except KeyboardInterrupt:
        sys.exit(INTERRUPTED)


if __name__ == "__main__":
    start()
