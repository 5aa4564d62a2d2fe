"""Workers on this machine: threads, each of which may use a process.

Threads start at once, and the kernel runs without Python's lock. Processes need most of a second to
start, and then do not wait for each other. If one is killed, its piece is computed again.
"""

from __future__ import annotations

import json
import multiprocessing
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import Future
from contextlib import suppress
from pathlib import Path
from queue import SimpleQueue
from typing import Any

from mesoslip.errors import RunError
from mesoslip.execution.pool import (
    Function,
    Pool,
    PoolError,
    Result,
    WorkerLostError,
    compute_elsewhere,
)
from mesoslip.execution.program import program
from mesoslip.execution.stop import Stop

# Number of times that a piece is computed if its worker dies.
MAX_ATTEMPTS = 3
# Time for a process to end after its pipe was closed [s].
EXIT_SECONDS = 5.0

# Program of a worker process, with the module path of this process after its own; with -P, files of
# the current folder are not imported as modules.
PROCESS = (
    "import json, sys; sys.path += [one for one in json.loads(sys.argv[2]) if one not in sys.path];"
    "from mesoslip.execution.worker import main; main(int(sys.argv[1]))"
)


class WorkerProcess:
    """A process that computes one piece at a time, and ends when this one does."""

    def __init__(self) -> None:
        self._connection, theirs = multiprocessing.Pipe()
        number = theirs.fileno()
        # Ctrl-C reaches the whole group of processes; only this one handles it.
        blocked = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-c", PROCESS, str(number), json.dumps(search_path())],
                pass_fds=[number],
                stdin=subprocess.DEVNULL,
                stdout=2,
            )
        except OSError as error:
            self._connection.close()
            raise PoolError(f"a worker cannot be started: {error.strerror}") from None
        finally:
            theirs.close()
            signal.pthread_sigmask(signal.SIG_SETMASK, blocked)

    def compute(self, function: Function[Any, Any], piece: object) -> tuple[bool, Any]:
        """Compute a piece: whether that succeeded, and the result or the error; an `OSError` or
        `EOFError` if the process has died."""
        self._connection.send((compute_elsewhere, (function, piece, program())))
        answer: tuple[bool, Any] = self._connection.recv()
        return answer

    def kill(self) -> None:
        """End the process, also while it computes."""
        self._process.kill()

    def close(self) -> None:
        """End the process, and wait for it."""
        self._process.kill()
        self._process.wait()
        self._connection.close()

    def ending(self) -> str:
        """How the process has died, as the end of a sentence."""
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(EXIT_SECONDS)
        status = self._process.returncode
        if status is None:
            return "closed its connection"
        return f"was ended by signal {-status}" if status < 0 else f"ended with status {status}"


def search_path() -> list[str]:
    """The module path of this process, without the current folder."""
    here = Path.cwd()
    return [one for one in sys.path if one and Path(one).is_absolute() and Path(one) != here]


class LocalPool(Pool):
    """Threads and processes of this machine; threads compute what starts in the first
    ``thread_seconds`` [s]."""

    def __init__(self, workers: int, stop: Stop, thread_seconds: float) -> None:
        self._workers = workers
        self._stop = stop
        self._thread_seconds = thread_seconds
        self._start = time.monotonic()
        self._queue: SimpleQueue[tuple[Future[Any], Function[Any, Any], object] | None] = (
            SimpleQueue()
        )
        self._threads: list[threading.Thread] = []
        self._processes: set[WorkerProcess] = set()
        self._lock = threading.Lock()
        # Processes that died since the last completed piece.
        self._deaths = 0

    @property
    def capacity(self) -> int:
        # Each worker has its next piece while the caller stores the last one.
        return 2 * self._workers

    def submit(self, function: Function[Any, Result], piece: object) -> Future[Result]:
        if len(self._threads) < self._workers:
            self._start_thread()
        future: Future[Result] = Future()
        self._queue.put((future, function, piece))
        return future

    def _start_thread(self) -> None:
        """Start one more thread; the first one must start."""
        # Unlike those of ThreadPoolExecutor, it does not keep the interpreter from exiting.
        thread = threading.Thread(target=self._serve, daemon=True)
        try:
            thread.start()
        # Python has no error of its own for this.
        except (MemoryError, RuntimeError):
            if not self._threads:
                raise PoolError("a worker cannot be started: is there enough memory?") from None
        else:
            self._threads.append(thread)

    def check(self) -> None:
        """Nothing to check: a process that cannot be started fails its piece with a `PoolError`."""

    @property
    def is_alive(self) -> bool:
        """Whether there is a thread."""
        return any(thread.is_alive() for thread in self._threads)

    def close(self, wait: float | None) -> None:
        self._stop.set()
        for _ in self._threads:
            self._queue.put(None)
        with self._lock:
            for process in self._processes:
                process.kill()
        end = None if wait is None else time.monotonic() + wait
        for thread in self._threads:
            thread.join(None if end is None else max(0.0, end - time.monotonic()))

    def _serve(self) -> None:
        """Compute piece after piece on a thread, and after some time in a process."""
        process: WorkerProcess | None = None
        while (item := self._queue.get()) is not None:
            future, function, piece = item
            if self._stop.is_set() or not future.set_running_or_notify_cancel():
                continue
            try:
                if time.monotonic() - self._start < self._thread_seconds:
                    result = function(piece, self._stop)
                else:
                    process, succeeded, result = self._compute_in_process(process, function, piece)
                    if not succeeded:
                        raise result
            except BaseException as error:
                future.set_exception(error)
                if isinstance(error, WorkerLostError | PoolError):
                    process = None
            else:
                future.set_result(result)
                del result
            # Free the memory of the piece while the thread waits for the next one.
            del item, future, piece
        if process is not None:
            self._forget(process)

    def _compute_in_process(
        self, process: WorkerProcess | None, function: Function[Any, Any], piece: object
    ) -> tuple[WorkerProcess, bool, Any]:
        """Compute a piece in a process, which is replaced if it dies.

        Returns the process, whether the piece succeeded, and its result or error. Raises a
        `WorkerLostError` if all attempts failed, a `PoolError` if processes die with every piece.
        """
        for _ in range(MAX_ATTEMPTS):
            process = process or self._new_process()
            try:
                succeeded, result = process.compute(function, piece)
            except (EOFError, OSError):
                ending = process.ending()
                self._forget(process)
                process = None
                self._deaths += 1
                if self._deaths > MAX_ATTEMPTS * self._workers:
                    raise PoolError(f"all workers failed; the last one {ending}") from None
                continue
            self._deaths = 0
            return process, succeeded, result
        raise WorkerLostError(
            f"{MAX_ATTEMPTS} workers died; the last one {ending}; is there enough memory?"
        )

    def _new_process(self) -> WorkerProcess:
        with self._lock:
            if self._stop.is_set():
                raise PoolError("the pool is closed")
            process = WorkerProcess()
            self._processes.add(process)
        return process

    def _forget(self, process: WorkerProcess) -> None:
        with self._lock:
            self._processes.discard(process)
        process.close()


def pickled_error(error: BaseException) -> BaseException:
    """An error that another process can raise: itself, or a `RunError` with the same message."""
    import pickle

    try:
        copy = pickle.loads(pickle.dumps(error))
    except Exception:
        copy = None
    if type(copy) is type(error) and str(copy) == str(error):
        return error
    return RunError(f"{type(error).__name__}: {error}")
