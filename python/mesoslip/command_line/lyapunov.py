"""``mesoslip lyapunov``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from mesoslip.command_line.options import (
    ConfigArgument,
    JsonOption,
    QuietOption,
    SetOption,
    load,
    option,
    output_option,
    positive_or_none,
    print_json,
    show_all,
)
from mesoslip.command_line.progress import progress_shown


def lyapunov(
    config: ConfigArgument,
    output: Annotated[Path | None, output_option("Write distances and peaks")] = None,
    changes: SetOption = None,
    twins: Annotated[int, typer.Option(help="Number of twins")] = 8,
    follow: Annotated[
        str | None, option("Time for which each twin is followed, such as '2 s'", "TIME")
    ] = None,
    workers: Annotated[int | None, typer.Option(help="Twins at the same time")] = None,
    as_json: JsonOption = False,
    quiet: QuietOption = False,
) -> None:
    """Estimate the largest Lyapunov exponent, the mark of chaos.

    Twins of the run start a small distance away, with the same random numbers.
    """
    from mesoslip.analysis.lyapunov import SUMMARY, lyapunov, summary
    from mesoslip.output import targets, writing

    checked = load(config, changes)
    targets.check_output(output, [config])
    duration = positive_or_none(follow, "--follow", "s", "2 s")
    with progress_shown(quiet) as progress:
        tree = lyapunov(
            checked, twins=twins, duration=duration, executor=workers, progress=progress
        )
    if output is not None:
        writing.write(tree, output)
    values = {name: float(tree[name]) for name in SUMMARY}
    if as_json:
        print_json(values)
        return
    show_all(values, SUMMARY)
    typer.echo(summary(tree))
