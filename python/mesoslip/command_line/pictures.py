"""``mesoslip plot`` and ``mesoslip figures``."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from mesoslip.command_line.options import OutputArgument


class View(StrEnum):
    """Pictures of a run."""

    RUN = "run"
    AVALANCHES = "avalanches"
    LATTICE = "lattice"
    RESPONSE = "response"


def plot(
    output: OutputArgument,
    figure: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            help="Picture; beside the output by default; a .gif shows the lattice in motion",
            metavar="FIG",
        ),
    ] = None,
    view: Annotated[
        View | None,
        typer.Option(
            help="Of a run: what happened, sizes of avalanches, contacts on their lattice, "
            "steady forces, steps and holds"
        ),
    ] = None,
    snapshot: Annotated[
        int | None,
        typer.Option(
            min=0,
            help="Which snapshot of the lattice; that after the largest avalanche by default",
            metavar="NUMBER",
        ),
    ] = None,
) -> None:
    """Draw an output."""
    from mesoslip import api
    from mesoslip.output import files

    path = figure or output.parent / f"{output.stem or 'output'}.png"
    if output.is_file():
        files.check_writable(path, [output])
    api.plot(output, path, view=view.value if view is not None else None, snapshot=snapshot)
    typer.echo(str(path), err=True)


def figures(
    names: Annotated[
        list[str] | None, typer.Argument(help="Such as S20; all by default", metavar="[NAME]...")
    ] = None,
    folder: Annotated[
        Path, typer.Option("-o", "--output", help="Folder of the pictures", metavar="DIR")
    ] = Path("out/figures"),
    outputs: Annotated[
        Path, typer.Option("--from", help="Folder of the outputs of the runs", metavar="DIR")
    ] = Path("out"),
) -> None:
    """Draw the figures of the source from the outputs of their runs."""
    from mesoslip.plots import source_figures

    for path in source_figures.draw(names or (), outputs, folder):
        typer.echo(str(path), err=True)
