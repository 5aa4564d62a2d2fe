"""How far a run has come."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

import typer


@contextmanager
def progress_shown(quiet: bool) -> Iterator[Callable[[float], None]]:
    """A progress bar on a terminal, otherwise a line for each tenth."""
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

    def tell(part: float) -> None:
        with suppress(OSError):
            bar.update(task, completed=part)

    with suppress(OSError):
        bar.start()
    try:
        yield tell
    finally:
        with suppress(OSError):
            bar.stop()


def say(text: str) -> None:
    """Tell the user, if there still is a terminal: a run does not end because nobody listens."""
    with suppress(OSError):
        typer.echo(text, err=True)


def _lines() -> Callable[[float], None]:
    start = time.monotonic()
    told = 0

    def tell(part: float) -> None:
        nonlocal told
        passed = time.monotonic() - start
        # Runs that are over in a moment need no lines.
        if int(10 * part) > told and passed > 2:
            told = int(10 * part)
            left = passed * (1 - part) / part
            say(f"{10 * told} % after {passed:.0f} s, {left:.0f} s left")

    return tell
