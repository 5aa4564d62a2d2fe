"""Points on the processors of this machine: on threads, or on processes.

An executor is a function that takes tasks and yields each with its outcome, in any order. It takes
no more tasks than it is about to run, so that a long list of them need not be in memory. When the
flag is set it stops soon; what was under way is lost.
"""

from __future__ import annotations

import json
import multiprocessing
import signal
import subprocess
import sys
from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import suppress
from multiprocessing.connection import Connection
from multiprocessing.connection import wait as wait_for_any

from mesoslip.campaign.point import Outcome, Task, compute
from mesoslip.errors import RunError
from mesoslip.simulation.stop import StopFlag

Finished = tuple[Task, Outcome]
Executor = Callable[[Iterable[Task], StopFlag], Iterator[Finished]]

# How often the flag is looked at [s].
LOOK_SECONDS = 0.1
# Workers that a point may cost before it is given up.
MOST_DEATHS = 3
# Time in which a process ends whose pipe is closed [s].
PATIENCE = 5.0

# What a worker runs: it has the modules of this process, whatever this process has been started as.
WORKER = (
    "import json, sys; sys.path[:] = json.loads(sys.argv[2]); "
    "from mesoslip.campaign.worker import main; main(int(sys.argv[1]))"
)


def on_threads(workers: int) -> Executor:
    """Run points on threads of this process."""

    def execute(tasks: Iterable[Task], stop: StopFlag) -> Iterator[Finished]:
        waiting = iter(tasks)
        with ThreadPoolExecutor(workers) as pool:
            running: dict[Future[Outcome], Task] = {}
            # Whatever ends the sweep ends the points that are under way.
            halt = StopFlag()
            try:
                while not stop.is_set():
                    while len(running) < workers and (task := next(waiting, None)) is not None:
                        running[pool.submit(compute, task, halt)] = task
                    if not running:
                        return
                    done, _ = wait(running, LOOK_SECONDS, return_when=FIRST_COMPLETED)
                    for future in done:
                        yield running.pop(future), future.result()
            finally:
                halt.set()

    return execute


class _Worker:
    """A process that computes points, and the task that it has."""

    def __init__(self) -> None:
        self.connection, theirs = multiprocessing.Pipe()
        number = theirs.fileno()
        # Ctrl-C is for the whole group of processes, and this one decides what becomes of it. What
        # arrives meanwhile is not lost.
        blocked = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            self.process = subprocess.Popen(
                [sys.executable, "-c", WORKER, str(number), json.dumps(sys.path)],
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
        self.task: Task | None = None
        self.has_begun = False

    def give(self, task: Task) -> None:
        """Have it compute a point; a worker that is dead is found when it is listened to."""
        self.task = task
        with suppress(OSError):
            self.connection.send(task)

    def end(self) -> None:
        """End it, at once."""
        self.process.kill()
        self.process.wait()
        self.connection.close()


def on_processes(workers: int) -> Executor:
    """Run points on processes, which end when this one does, whatever ends it.

    A process that is killed is replaced, and its point computed anew; a point that has cost
    several processes, as one that needs more memory than there is, fails.
    """

    def execute(tasks: Iterable[Task], stop: StopFlag) -> Iterator[Finished]:
        waiting = iter(tasks)
        again: deque[Task] = deque()
        deaths: Counter[str] = Counter()
        crew: dict[Connection, _Worker] = {}
        failed_starts = 0

        def next_task() -> Task | None:
            task = next(waiting, None)
            return task if task is not None or not again else again.popleft()

        try:
            while not stop.is_set():
                while len(crew) < workers and (task := next_task()) is not None:
                    worker = _Worker()
                    crew[worker.connection] = worker
                    worker.give(task)
                if not crew:
                    return
                for connection in wait_for_any(list(crew), LOOK_SECONDS):
                    worker = crew[connection]  # type: ignore[index]
                    try:
                        outcome = worker.connection.recv()
                    except (EOFError, OSError):
                        outcome = None
                    task = worker.task
                    if outcome is not None:
                        worker.has_begun = True
                        following = next_task()
                        if following is not None:
                            worker.give(following)
                        else:
                            del crew[worker.connection]
                            worker.end()
                    else:
                        del crew[worker.connection]
                        # It is on its way out, with a status of its own.
                        with suppress(subprocess.TimeoutExpired):
                            worker.process.wait(PATIENCE)
                        worker.end()
                        failed_starts = 0 if worker.has_begun else failed_starts + 1
                        outcome = _after_death(task, worker, deaths, again)
                    if task is not None and outcome is not None:
                        yield task, outcome
                if failed_starts > MOST_DEATHS * workers:
                    raise RunError("workers end before they have computed anything")
        finally:
            for worker in crew.values():
                worker.end()

    return execute


def _after_death(
    task: Task | None, worker: _Worker, deaths: Counter[str], again: deque[Task]
) -> Outcome | None:
    """What becomes of the point of a worker that has died: it is computed anew, or fails."""
    if task is None:
        return None
    deaths[task.name] += 1
    if deaths[task.name] < MOST_DEATHS:
        again.append(task)
        return None
    status = worker.process.returncode
    reason = f"by signal {-status}" if status < 0 else f"with exit status {status}"
    return Outcome(
        {}, failure=f"ended {MOST_DEATHS} workers, the last {reason}; is there too little memory?"
    )
