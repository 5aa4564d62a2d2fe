"""Points on the processors of this machine: on threads, on processes, or on one after the other.

An executor is a function that takes tasks and yields each with its outcome, in any order. It takes
no more tasks than it is about to run, so that a long list of them need not be in memory. When the
flag is set it stops soon; what was under way is lost.

Threads begin at once, and the kernel runs without Python's lock. Processes need most of a second to
begin, and then do not wait for each other, nor does one that is killed take others with it.
"""

from __future__ import annotations

import json
import multiprocessing
import signal
import subprocess
import sys
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from multiprocessing.connection import Connection
from multiprocessing.connection import wait as wait_for_any
from typing import Protocol

from mesoslip.campaign.point import Outcome, Task, compute
from mesoslip.errors import RunError
from mesoslip.simulation.stop import StopFlag

Finished = tuple[Task, Outcome]
Executor = Callable[[Iterable[Task], StopFlag], Iterator[Finished]]

# Sweeps that take longer than this are worth processes [s].
THREAD_SECONDS = 10.0
# How often the flag is looked at [s].
LOOK_SECONDS = 0.1
# Workers that a point may cost before it is given up.
MOST_DEATHS = 3
# Time in which a worker ends whose pipe is closed [s].
PATIENCE = 5.0

# What a process runs: it finds the modules of this one, whatever this one has been started as.
PROCESS = (
    "import json, sys; sys.path[:] = json.loads(sys.argv[2]); "
    "from mesoslip.campaign.worker import main; main(int(sys.argv[1]))"
)


class Worker(Protocol):
    """What computes one point at a time.

    Attributes
    ----------
    connection
        Where its outcomes come from; at its end when the worker has died.
    """

    connection: Connection

    def give(self, task: Task) -> None:
        """Have it compute a point."""
        ...

    def end(self) -> None:
        """End it, and give up what is under way."""
        ...

    def ending(self) -> str:
        """How it has died, after its connection came to its end."""
        ...


class ThreadWorker:
    """A thread that computes points."""

    def __init__(self) -> None:
        self.connection, theirs = multiprocessing.Pipe()
        self._halt = StopFlag()
        self._thread = threading.Thread(target=self._serve, args=(theirs,), daemon=True)
        self._thread.start()

    def _serve(self, connection: Connection) -> None:
        with connection, suppress(EOFError, OSError):
            while True:
                connection.send(compute(connection.recv(), self._halt))

    def give(self, task: Task) -> None:
        with suppress(OSError):
            self.connection.send(task)

    def end(self) -> None:
        self._halt.set()
        self.connection.close()
        # Who wrote a measure that takes forever shall be able to stop it.
        self._thread.join(PATIENCE)

    def ending(self) -> str:
        return "ended by itself"


class ProcessWorker:
    """A process that computes points."""

    def __init__(self) -> None:
        self.connection, theirs = multiprocessing.Pipe()
        number = theirs.fileno()
        # Ctrl-C is for the whole group of processes, and this one decides what becomes of it. What
        # arrives meanwhile is not lost.
        blocked = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            self._process = subprocess.Popen(
                [sys.executable, "-c", PROCESS, str(number), json.dumps(sys.path)],
                pass_fds=[number],
                stdin=subprocess.DEVNULL,
                stdout=2,
            )
        except OSError as error:
            self.connection.close()
            raise RunError(f"a worker cannot be started: {error.strerror}") from None
        finally:
            theirs.close()
            signal.pthread_sigmask(signal.SIG_SETMASK, blocked)

    def give(self, task: Task) -> None:
        # One that is dead is found when it is listened to.
        with suppress(OSError):
            self.connection.send(task)

    def end(self) -> None:
        self._process.kill()
        self._process.wait()
        self.connection.close()

    def ending(self) -> str:
        # It is on its way out, with a status of its own.
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(PATIENCE)
        status = self._process.returncode
        if status is None:
            return "closed its connection"
        return f"was ended by signal {-status}" if status < 0 else f"ended with status {status}"


# Whom to employ, given the time since the start of the sweep [s].
Employ = Callable[[float], type[ThreadWorker] | type[ProcessWorker]]
POOLS: Mapping[str, Employ] = {
    "threads": lambda _: ThreadWorker,
    "processes": lambda _: ProcessWorker,
    "both": lambda passed: ThreadWorker if passed < THREAD_SECONDS else ProcessWorker,
}


def on_this_machine(workers: int, pool: str = "both") -> Executor:
    """Run points on threads or processes.

    Processes end when this one does, whatever ends it. One that is killed is replaced, and its
    point computed anew; a point that has cost several of them, as one that needs more memory than
    there is, fails.

    Parameters
    ----------
    workers
        How many.
    pool
        "threads", "processes", or "both": threads first, and processes in a sweep that takes long.
    """
    employ = POOLS[pool]

    def execute(tasks: Iterable[Task], stop: StopFlag) -> Iterator[Finished]:
        return _Crew(workers, employ, tasks).work(stop)

    return execute


class _Crew:
    """Workers and their tasks."""

    def __init__(self, most: int, employ: Employ, tasks: Iterable[Task]) -> None:
        self._most = most
        self._employ = employ
        self._waiting = iter(tasks)
        self._again: deque[Task] = deque()
        self._deaths: Counter[str] = Counter()
        self._at_work: dict[Connection, tuple[Worker, Task]] = {}
        self._begin = time.monotonic()
        # Deaths since an outcome has come.
        self._in_vain = 0

    def work(self, stop: StopFlag) -> Iterator[Finished]:
        """Have all tasks done.

        Raises
        ------
        RunError
            If workers cannot be started, or none of them comes to an outcome.
        """
        try:
            while not stop.is_set():
                while len(self._at_work) < self._most and (task := self._next()) is not None:
                    self._give(self._employ(self._passed)(), task)
                if not self._at_work:
                    return
                for connection in wait_for_any(list(self._at_work), LOOK_SECONDS):
                    assert isinstance(connection, Connection)
                    finished = self._listen(connection)
                    if finished is not None:
                        yield finished
        finally:
            for worker, _ in self._at_work.values():
                worker.end()

    @property
    def _passed(self) -> float:
        return time.monotonic() - self._begin

    def _next(self) -> Task | None:
        """The next task: first of those that are new."""
        task = next(self._waiting, None)
        return task if task is not None or not self._again else self._again.popleft()

    def _give(self, worker: Worker, task: Task) -> None:
        self._at_work[worker.connection] = worker, task
        worker.give(task)

    def _listen(self, connection: Connection) -> Finished | None:
        """Take an outcome, or what the death of a worker makes of its task."""
        worker, task = self._at_work.pop(connection)
        try:
            outcome: Outcome = connection.recv()
        except (EOFError, OSError):
            return self._bury(worker, task)
        self._in_vain = 0
        # It has its next task before this one is stored.
        following = self._next() if isinstance(worker, self._employ(self._passed)) else None
        if following is None:
            worker.end()
        else:
            self._give(worker, following)
        return task, outcome

    def _bury(self, worker: Worker, task: Task) -> Finished | None:
        """What becomes of the task of a worker that has died: it is done anew, or fails."""
        ending = worker.ending()
        worker.end()
        self._in_vain += 1
        if self._in_vain > MOST_DEATHS * self._most:
            raise RunError(f"workers come to nothing; the last one {ending}")
        self._deaths[task.name] += 1
        if self._deaths[task.name] < MOST_DEATHS:
            self._again.append(task)
            return None
        failure = f"cost {MOST_DEATHS} workers, of which the last {ending}; is memory too little?"
        return task, Outcome({}, failure=failure)
