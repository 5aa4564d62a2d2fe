"""``mesoslip fronts``."""

from __future__ import annotations

from functools import partial
from typing import Annotated

import typer

from mesoslip.command_line.options import JsonOption, OutputArgument, TableOption, show_catalogue


def fronts(
    output: OutputArgument,
    table: TableOption = None,
    as_json: JsonOption = False,
    as_latex: Annotated[
        bool, typer.Option("--latex", help="Print the statistics by kind as a LaTeX table")
    ] = False,
) -> None:
    """Print fronts and precursors of an interface with a length."""
    from mesoslip.analysis.fronts import fronts_of

    find = partial(fronts_of, name=str(output))
    found = show_catalogue(output, find, table, as_json=as_json, as_latex=as_latex)
    sentence = None if as_json or as_latex else found.size_sentence()
    if sentence is not None:
        typer.echo(f"\n{sentence}")
