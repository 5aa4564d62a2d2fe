"""Progress and messages on the terminal."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

import typer

from mesoslip.errors import printable

# Time after which progress is printed where there is no terminal [s].
PATIENCE = 2.0


@contextmanager
def progress_shown(quiet: bool, what: str = "simulating") -> Iterator[Callable[[float], None]]:
    """A progress bar on a terminal; elsewhere a line for each 10 % of work that takes a while."""
    if quiet:
        yield lambda _: None
        return
    if not sys.stderr.isatty():
        yield _lines(what)
        return
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        Progress,
        TaskProgressColumn,
        TextColumn,
        TimeRemainingColumn,
    )

    columns = (TextColumn(what), BarColumn(), TaskProgressColumn(), TimeRemainingColumn())
    bar = Progress(*columns, console=Console(stderr=True), transient=True)
    task = bar.add_task("", total=1.0)

    def update(part: float) -> None:
        with suppress(OSError):
            bar.update(task, completed=part)

    with suppress(OSError):
        bar.start()
    try:
        yield update
    finally:
        with suppress(OSError):
            bar.stop()


def say(text: str) -> None:
    """Print a message on stderr; a run continues if its terminal is gone."""
    with suppress(OSError):
        typer.echo("\n".join(map(printable, text.split("\n"))), err=True)


@contextmanager
def steps_shown(start: float) -> Iterator[Callable[[str], None]]:
    """Reports the steps of work without known lengths: on a terminal as they begin, elsewhere as
    lines once the work, which started at a time of `time.monotonic`, takes a while."""
    if sys.stderr.isatty():
        from rich.console import Console

        with Console(stderr=True).status("") as status:
            yield lambda step: status.update(step)
        return

    def report(step: str) -> None:
        passed = time.monotonic() - start
        if passed > PATIENCE:
            say(f"after {passed:.0f} s: {step}")

    yield report


def _lines(what: str) -> Callable[[float], None]:
    start = time.monotonic()
    reported = 0

    def update(part: float) -> None:
        nonlocal reported
        passed = time.monotonic() - start
        if int(10 * part) > reported and passed > PATIENCE:
            reported = int(10 * part)
            left = f", {passed * (1 - part) / part:.0f} s left" if part < 1 else ""
            say(f"{what}: {10 * reported} % after {passed:.0f} s{left}")

    return update
