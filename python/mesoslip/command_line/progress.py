"""Progress and messages on the terminal."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

import typer

from mesoslip.errors import printable


@contextmanager
def progress_shown(quiet: bool) -> Iterator[Callable[[float], None]]:
    """A progress bar on a terminal; elsewhere a line for each 10 %."""
    if quiet:
        yield lambda _: None
        return
    if not sys.stderr.isatty():
        yield _lines()
        return
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        Progress,
        TaskProgressColumn,
        TextColumn,
        TimeRemainingColumn,
    )

    columns = (TextColumn("simulating"), BarColumn(), TaskProgressColumn(), TimeRemainingColumn())
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


def _lines() -> Callable[[float], None]:
    start = time.monotonic()
    reported = 0

    def update(part: float) -> None:
        nonlocal reported
        passed = time.monotonic() - start
        # Short runs need no lines.
        if int(10 * part) > reported and passed > 2:
            reported = int(10 * part)
            left = passed * (1 - part) / part
            say(f"{10 * reported} % after {passed:.0f} s, {left:.0f} s left")

    return update
