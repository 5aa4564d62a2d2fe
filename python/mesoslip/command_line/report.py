"""``mesoslip report`` and ``mesoslip export``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from mesoslip.command_line.options import OutputArgument, OutputsArgument, output_option
from mesoslip.command_line.quick_matplotlib import import_matplotlib


def report(
    outputs: OutputsArgument,
    page: Annotated[
        Path | None, output_option("Page; beside the first output by default", "FILE.html")
    ] = None,
) -> None:
    """Write a self-contained page about outputs of one command."""
    from mesoslip.configuration.reading import is_file
    from mesoslip.output import targets

    import_matplotlib()
    from mesoslip.reports import report as reports

    first = outputs[0]
    path = page or first.parent / f"{first.stem or 'output'}.html"
    there = [one for one in outputs if is_file(one)]
    if there:
        targets.check_writable(path, there)
    reports.report(outputs, path)
    typer.echo(str(path), err=True)


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
