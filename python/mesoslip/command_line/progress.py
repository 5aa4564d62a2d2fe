"""How far a run has come."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

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
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("", total=1.0)
        yield lambda part: bar.update(task, completed=part)


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
            typer.echo(f"{10 * told} % after {passed:.0f} s, {left:.0f} s left", err=True)

    return tell
