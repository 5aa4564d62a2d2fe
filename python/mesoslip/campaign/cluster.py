"""Work on a cluster: `dask.distributed`, which is imported only when it is asked for."""

from __future__ import annotations

import json
import queue
import uuid
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from mesoslip.campaign.execution import LOOK_SECONDS, Executor, Finished
from mesoslip.campaign.point import Outcome, Task, compute
from mesoslip.errors import FileError, RunError
from mesoslip.simulation.stop import StopFlag

if TYPE_CHECKING:
    from distributed import Client, Future

# Time in which a scheduler answers [s].
PATIENCE = 10.0
# Tasks for each thread of the cluster that are on their way, so that none waits for the next.
TASKS_A_THREAD = 3
# How often the cluster is asked how many threads it has [s], in looks.
LOOKS_A_COUNT = 50

Key = TypeVar("Key")
Result = TypeVar("Result")


@contextmanager
def connected(address: str) -> Iterator[Client]:
    """A client of a scheduler.

    Parameters
    ----------
    address
        Such as "tcp://host:8786", or the file with which the scheduler was started
        (``--scheduler-file``), whose name ends in ".json".

    Raises
    ------
    FileError
        If `distributed` is not installed, or no scheduler is there.
    """
    try:
        from distributed import Client
        from distributed.comm.addressing import parse_address, parse_host_port
    except ImportError:
        raise FileError(
            "--scheduler needs the package distributed: pip install 'mesoslip[distributed]'"
        ) from None
    import logging

    # What becomes of connections is told by this program.
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    try:
        if address.endswith(".json"):
            address = str(json.loads(Path(address).read_text(encoding="utf-8"))["address"])
        # A client that finds nothing complains when it is thrown away: ask before.
        parse_host_port(parse_address(address)[1])
        client = Client(address, timeout=PATIENCE, set_as_default=False)
    except (LookupError, OSError, TypeError, ValueError) as error:
        raise FileError(f"--scheduler {address}: there is no scheduler: {error}") from None
    try:
        yield client
    finally:
        with suppress(Exception):
            client.close(timeout=PATIENCE)


def on_cluster(
    client: Client,
    function: Callable[[Key], Result],
    tasks: Iterable[Key],
    stop: StopFlag,
) -> Iterator[tuple[Key, Result | Exception]]:
    """Apply a function to tasks on the workers of a cluster, and yield each with what came out.

    A worker that is lost has its tasks computed by another one. A task that has cost several
    workers comes out as the error that tells so, as does one that raises.

    Raises
    ------
    RunError
        If the scheduler is gone.
    """
    waiting = iter(tasks)
    done: queue.SimpleQueue[Future[Any]] = queue.SimpleQueue()
    running: dict[Future[Any], Key] = {}
    looks, threads = 0, 1
    try:
        while not stop.is_set():
            if looks % LOOKS_A_COUNT == 0:
                threads = max(1, _threads(client))
            looks += 1
            while len(running) < TASKS_A_THREAD * threads:
                task = next(waiting, None)
                if task is None:
                    break
                # No result of another client's is taken for it.
                future = client.submit(function, task, key=f"mesoslip-{uuid.uuid4()}", pure=False)
                running[future] = task
                future.add_done_callback(done.put)
            if not running:
                return
            try:
                future = done.get(timeout=LOOK_SECONDS)
            except queue.Empty:
                _check(client)
                continue
            result = _result(client, future)
            yield running.pop(future), result
    finally:
        with suppress(Exception):
            client.cancel(list(running))


def _threads(client: Client) -> int:
    """Threads of all workers of the cluster."""
    _check(client)
    with suppress(Exception):
        return sum(client.nthreads().values())
    _check(client)
    return 0


def _check(client: Client) -> None:
    """Make sure that the scheduler is there.

    Raises
    ------
    RunError
        If it is not.
    """
    if client.status != "running":
        raise RunError("the scheduler is gone")


def _result(client: Client, future: Future[Any]) -> Any:
    """What came out of a task; an error as such.

    Raises
    ------
    RunError
        If the scheduler is gone.
    """
    from distributed import CancelledError

    try:
        return future.result(timeout=PATIENCE)
    except CancelledError:
        raise RunError("the scheduler is gone") from None
    except Exception as error:
        _check(client)
        return error


def on_dask(client: Client) -> Executor:
    """Run points on the workers of a cluster, which need no files of this machine."""

    def execute(tasks: Iterable[Task], stop: StopFlag) -> Iterator[Finished]:
        for task, result in on_cluster(client, compute, tasks, stop):
            if isinstance(result, Exception):
                name = type(result).__name__
                yield task, Outcome({}, failure=f"its worker failed: {name}: {result}")
            else:
                yield task, result

    return execute
