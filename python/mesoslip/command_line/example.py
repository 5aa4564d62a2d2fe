"""``mesoslip example``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from mesoslip.command_line.options import output_option


def example(
    name: Annotated[
        str | None,
        typer.Argument(
            help="Name, such as klein; without it all examples are listed", metavar="[NAME]"
        ),
    ] = None,
    file: Annotated[
        Path | None, output_option("File; by default NAME.toml in this folder", "FILE")
    ] = None,
) -> None:
    """List the example configurations, or write one to start from."""
    from mesoslip import examples

    if name is None:
        for known, title in examples.examples().items():
            typer.echo(f"{known:14} {title}")
        return
    for written in examples.example(name, file):
        typer.echo(str(written), err=True)
