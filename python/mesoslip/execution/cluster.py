"""Workers of a Dask cluster; the package `distributed` is imported when they are used."""

from __future__ import annotations

import json
import logging
import time
import uuid
from collections.abc import Iterator
from concurrent.futures import Future
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mesoslip.errors import FileError
from mesoslip.execution.pool import Function, Pool, PoolError, Result, compute_elsewhere
from mesoslip.execution.program import program

if TYPE_CHECKING:
    from distributed import Client

# Time for a scheduler to answer [s].
ANSWER_SECONDS = 10.0
# Pieces in flight for each thread of the cluster, so that threads need not wait for pieces.
PIECES_PER_THREAD = 3
# Time between two counts of the threads of the cluster [s].
COUNT_SECONDS = 5.0
# Time without any worker after which a warning is logged [s].
ALONE_SECONDS = 3.0
GONE = "the connection to the scheduler of the cluster is lost"
# Libraries that log lost connections.
LOGGERS = ("distributed", "tornado", "asyncio")

_LOG = logging.getLogger("mesoslip")


@contextmanager
def connected(address: str) -> Iterator[Client]:
    """A client of a scheduler at an address such as "tcp://host:8786", or in a ``.json`` file that
    the scheduler wrote (``--scheduler-file``); raises a `FileError` without one."""
    try:
        from distributed import Client
        from distributed.comm.addressing import parse_address, parse_host_port
    except ImportError:
        raise FileError(
            "a cluster needs the package distributed: pip install 'mesoslip[distributed]'"
        ) from None
    with _quiet():
        try:
            given = address
            if address.endswith(".json"):
                address = str(json.loads(Path(address).read_text(encoding="utf-8"))["address"])
            # A client that finds no scheduler logs errors when deleted: try the address first.
            parse_host_port(parse_address(address)[1])
            client = Client(address, timeout=ANSWER_SECONDS, set_as_default=False)
        except (LookupError, OSError, TypeError, ValueError) as error:
            raise FileError(f"{given}: there is no Dask scheduler: {error}") from None
        try:
            yield client
        finally:
            with suppress(Exception):
                client.close(timeout=ANSWER_SECONDS)


@contextmanager
def _quiet() -> Iterator[None]:
    """Suppress what libraries log about connections, which errors of this program report."""
    names = [one for one in logging.root.manager.loggerDict if one.split(".")[0] in LOGGERS]
    loggers = [logging.getLogger(name) for name in {*names, *LOGGERS}]
    levels = [(one, one.level) for one in loggers]
    for one in loggers:
        one.setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        for one, level in levels:
            one.setLevel(level)


class ClusterPool(Pool):
    """The workers of a cluster; a piece whose worker is lost moves to another one, and fails after
    several."""

    def __init__(self, client: Client) -> None:
        self._client = client
        self._executor = client.get_executor(pure=False)
        self._threads = 0
        self._start = time.monotonic()
        self._counted = -COUNT_SECONDS
        self._is_reported = False
        self.check()

    @property
    def capacity(self) -> int:
        return PIECES_PER_THREAD * max(1, self._threads)

    def submit(self, function: Function[Any, Result], piece: object) -> Future[Result]:
        # A unique key, so that results of other clients are not mistaken for this one.
        key = f"mesoslip-{uuid.uuid4()}"
        future: Future[Result] = self._executor.submit(
            compute_elsewhere, function, piece, program(), key=key
        )
        return future

    def check(self) -> None:
        if self._client.status != "running":
            raise PoolError(GONE)
        now = time.monotonic()
        if now - self._counted < (COUNT_SECONDS if self._threads else 1.0):
            return
        self._counted = now
        try:
            self._threads = sum(self._client.nthreads().values())
        except Exception:
            if self._client.status != "running":
                raise PoolError(GONE) from None
            self._threads = 0
        if self._threads:
            self._is_reported = False
        elif not self._is_reported and now - self._start > ALONE_SECONDS:
            self._is_reported = True
            _LOG.warning("the cluster has no workers: waiting for the first one")

    def close(self, wait: float | None) -> None:  # noqa: ARG002
        with suppress(Exception):
            self._executor.shutdown(wait=False)
