"""``mesoslip run``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from mesoslip.command_line.options import ConfigArgument, SetOption
from mesoslip.command_line.progress import progress_shown

INTERRUPTED = 130


def run(
    config: ConfigArgument,
    output: Annotated[
        Path | None,
        typer.Option(
            "-o", "--output", help="Output file; out/<stem>.nc by default", metavar="OUT.nc"
        ),
    ] = None,
    changes: SetOption = None,
    workers: Annotated[
        int | None,
        typer.Option(min=1, help="Realizations at the same time; as many as processors by default"),
    ] = None,
    quiet: Annotated[bool, typer.Option("--quiet", help="Show no progress")] = False,
) -> None:
    """Simulate, and write an output file."""
    from mesoslip import api
    from mesoslip.output import files, layout
    from mesoslip.simulation.engine import ENDINGS

    checked = api.as_config(config, changes or ())
    path = output or Path("out") / f"{Path(config).stem}.nc"
    files.check_writable(path, [config])
    with progress_shown(quiet) as progress:
        results = api.simulate(checked, workers=workers, progress=progress)
    told = layout.attributes(results)
    if not results.complete:
        partial = path.with_name(f"{path.stem}.partial{path.suffix}")
        files.write_results(results, partial)
        typer.echo(f"{told['comment']}; what there is, is in {partial}", err=True)
        raise typer.Exit(INTERRUPTED)
    files.write_results(results, path)
    if not quiet:
        found = f"{sum(len(one.rows('slips')) for one in results.realizations)} slips"
        if checked.has_avalanches:
            count = sum(one.avalanche_count for one in results.realizations)
            found = f"{count} avalanches, {found}"
        typer.echo(
            f"{path}: {told['break_count']:.0f} breaks, {found}, "
            f"energy balance to {abs(told['energy_residual']):.0e}, "
            f"{told['wall_seconds']:.2f} s",
            err=True,
        )
        if told["ending"] != ENDINGS[1]:
            typer.echo(f"{path}: the run ended as follows: {told['ending']}", err=True)
