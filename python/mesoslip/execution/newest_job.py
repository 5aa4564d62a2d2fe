"""The newest of several jobs: each one replaces the job before it."""

from __future__ import annotations

import ctypes
import gc
import os
import sys
import threading
from collections.abc import Callable

from mesoslip.execution.local import LocalPool
from mesoslip.execution.stop import Stop

Job = Callable[[Stop], None]


class NewestJob:
    """A thread that does the newest of the jobs that it is given.

    Each job requests that the one before it stops; of those that have not begun only the newest is
    done. A job that fails does not end the thread.

    Parameters
    ----------
    delay
        How long a job waits for a newer one [s].
    """

    def __init__(self, delay: float = 0.0) -> None:
        self._delay = delay
        self._lock = threading.Lock()
        self._stop = Stop()
        self._closed = Stop()
        self._pool = LocalPool(1, self._closed, float("inf"))

    def submit(self, job: Job) -> None:
        """Do a job instead of those before it."""
        with self._lock:
            self._stop.set()
            if not self._closed.is_set():
                self._stop = Stop(self._closed)
                self._pool.submit(self._do, (job, self._stop))

    def cancel(self) -> None:
        """Do nothing until the next job."""
        with self._lock:
            self._stop.set()

    def close(self) -> None:
        """End the thread, as soon as the job under way checks its stop."""
        with self._lock:
            self._pool.close(0.0)

    @property
    def is_alive(self) -> bool:
        """Whether the thread has not ended."""
        return self._pool.is_alive

    def _do(self, piece: tuple[Job, Stop], _: Stop) -> None:
        job, stop = piece
        if stop.wait(self._delay):
            return
        try:
            job(stop)
        except Exception:
            # Reported where the program was started, as for any thread.
            threading.excepthook(
                threading.ExceptHookArgs((*sys.exc_info(), threading.current_thread()))
            )
        del piece, job
        _return_memory()


def _return_memory() -> None:
    """Free what is left of a job, and return it to the system where the C library can.

    Trees of data refer to themselves, so they wait for the collector of garbage. The C library
    keeps what it gets back otherwise, for each thread: after many runs as much as the largest of
    them took, several times.
    """
    gc.collect()
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None) if os.name == "posix" else None
    if trim is not None:
        trim(0)
