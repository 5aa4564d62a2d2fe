"""A process that computes pieces for its parent process, and ends with it."""

from __future__ import annotations

import os
import pickle
import signal
import threading
from multiprocessing.connection import Connection
from queue import SimpleQueue

from mesoslip.array_packages import import_xarray
from mesoslip.execution.local import pickled_error


def main(number: int) -> None:
    """Compute the pieces received from a pipe, given by its file number, and send the results."""
    # The parent process handles Ctrl-C.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    connection = Connection(number)
    calls: SimpleQueue[bytes] = SimpleQueue()
    threading.Thread(target=_receive, args=(connection, calls), daemon=True).start()
    import_xarray()
    while True:
        try:
            function, arguments = pickle.loads(calls.get())
            answer = pickle.dumps((True, function(*arguments)))
        except BaseException as error:
            answer = pickle.dumps((False, pickled_error(error)))
        try:
            connection.send_bytes(answer)
        except OSError:
            os._exit(1)


def _receive(connection: Connection, calls: SimpleQueue[bytes]) -> None:
    """Receive calls, and end the process at once when the parent has ended."""
    while True:
        try:
            calls.put(connection.recv_bytes())
        except (EOFError, OSError):
            os._exit(0)
