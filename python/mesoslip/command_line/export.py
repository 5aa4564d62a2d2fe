"""``mesoslip export``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from mesoslip.command_line.options import OutputArgument


def export(
    output: OutputArgument,
    file: Annotated[
        Path,
        typer.Option(
            "-o",
            "--output",
            help="Folder NAME.zarr for the whole output, or NAME.xml for slips as QuakeML",
            metavar="FILE",
        ),
    ],
) -> None:
    """Write an output in the format of another program: Zarr, or slips as QuakeML."""
    from mesoslip.analysis.export import export as write

    write(output, file)
    typer.echo(str(file), err=True)
