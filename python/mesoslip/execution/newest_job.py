"""A thread for jobs of which only the newest counts."""

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
    """A thread for jobs, each of which stops or replaces the one before, after ``delay`` [s]
    without a newer one."""

    def __init__(self, delay: float = 0.0) -> None:
        self._delay = delay
        self._lock = threading.Lock()
        self._stop = Stop()
        self._closed = Stop()
        self._pool = LocalPool(1, self._closed, float("inf"))

    def submit(self, job: Job) -> None:
        """Run a job instead of the earlier ones."""
        with self._lock:
            self._stop.set()
            if not self._closed.is_set():
                self._stop = Stop(self._closed)
                self._pool.submit(self._run, (job, self._stop))

    def cancel(self) -> None:
        """Stop the present job."""
        with self._lock:
            self._stop.set()

    def close(self) -> None:
        """End the thread when the present job checks its stop."""
        with self._lock:
            self._pool.close(0.0)

    @property
    def is_alive(self) -> bool:
        """Whether the thread has not ended."""
        return self._pool.is_alive

    def _run(self, piece: tuple[Job, Stop], _: Stop) -> None:
        job, stop = piece
        if stop.wait(self._delay):
            return
        try:
            job(stop)
        except Exception:
            # Printed like the uncaught exception of any thread.
            threading.excepthook(
                threading.ExceptHookArgs((*sys.exc_info(), threading.current_thread()))
            )
        del piece, job
        _return_memory()


def _return_memory() -> None:
    """Free the memory of a job, and return it to the system where the C library can.

    Trees of data refer to themselves, so only the garbage collector frees them. The C library would
    keep their memory for each thread, several times that of the largest run.
    """
    gc.collect()
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None) if os.name == "posix" else None
    if trim is not None:
        trim(0)
