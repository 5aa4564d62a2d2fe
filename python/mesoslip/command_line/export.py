"""``mesoslip export``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from mesoslip.command_line.options import OutputArgument, output_option


def export(
    output: OutputArgument,
    file: Annotated[
        Path,
        output_option(
            "Folder NAME.zarr for the whole output, or NAME.xml for slips as QuakeML", "FILE"
        ),
    ],
) -> None:
    """Write an output as Zarr, or its slips as QuakeML."""
    from mesoslip.analysis.export import export as write

    write(output, file)
    typer.echo(str(file), err=True)
