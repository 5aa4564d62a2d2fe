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
    from mesoslip.output import store
    from mesoslip.simulation.engine import ENDINGS

    checked = api.as_config(config, changes or ())
    path = output or Path("out") / f"{Path(config).stem}.nc"
    store.check_writable(path)
    with progress_shown(quiet) as progress:
        tree = api.run(checked, workers=workers, progress=progress)
    if tree.attrs["complete"] == "false":
        partial = path.with_name(f"{path.stem}.partial{path.suffix}")
        store.write(tree, partial)
        typer.echo(f"{tree.attrs['comment']}; what there is, is in {partial}", err=True)
        raise typer.Exit(INTERRUPTED)
    store.write(tree, path)
    if not quiet:
        found = f"{tree['slips'].sizes['slip']} slips"
        if "avalanche_count" in tree.data_vars:
            found = f"{int(tree.to_dataset()['avalanche_count'].sum())} avalanches, {found}"
        typer.echo(
            f"{path}: {tree.attrs['break_count']:.0f} breaks, {found}, "
            f"energy balance to {abs(tree.attrs['energy_residual']):.0e}, "
            f"{tree.attrs['wall_seconds']:.2f} s",
            err=True,
        )
        if tree.attrs["ending"] != ENDINGS[1]:
            typer.echo(f"{path}: the run ended as follows: {tree.attrs['ending']}", err=True)
