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
        titles = examples.examples()
        width = max(map(len, titles))
        for known, title in titles.items():
            typer.echo(f"{known:{width}}  {title}")
        return
    for written in examples.example(name, file):
        typer.echo(str(written), err=True)
