"""The program: ``mesoslip`` and ``python -m mesoslip`` are the command line."""

import signal
import sys

from mesoslip._start import INTERRUPTED, catches_interrupts, is_interrupt
from mesoslip.command_line.main import main

__all__ = ["start"]


def start() -> None:
    """Run the command line and exit."""
    try:
        if catches_interrupts:
            signal.signal(signal.SIGINT, signal.default_int_handler)
        main()
    except (Exception, KeyboardInterrupt) as error:
        if not is_interrupt(error):
            raise
        sys.exit(INTERRUPTED)


if __name__ == "__main__":
    start()
