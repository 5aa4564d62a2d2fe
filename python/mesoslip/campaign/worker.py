"""A process that computes points for another one, and ends with it."""

from __future__ import annotations

import os
import signal
import threading
from multiprocessing.connection import Connection
from queue import SimpleQueue

from mesoslip.campaign.point import Task, compute


def main(number: int) -> None:
    """Compute the points that come through a pipe, and send back what comes out.

    Parameters
    ----------
    number
        Number of the pipe's end.
    """
    # Ctrl-C is for who has started this process.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    connection = Connection(number)
    tasks: SimpleQueue[Task] = SimpleQueue()
    threading.Thread(target=_listen, args=(connection, tasks), daemon=True).start()
    while True:
        outcome = compute(tasks.get())
        try:
            connection.send(outcome)
        except OSError:
            os._exit(1)


def _listen(connection: Connection, tasks: SimpleQueue[Task]) -> None:
    """Take tasks, and end the process at once when nobody is there to give them."""
    while True:
        try:
            tasks.put(connection.recv())
        except (EOFError, OSError):
            os._exit(0)
