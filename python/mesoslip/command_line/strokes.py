"""``mesoslip strokes``."""

from __future__ import annotations

from functools import partial
from typing import Annotated, Literal

import typer

from mesoslip.command_line.options import (
    JsonOption,
    OutputArgument,
    TableOption,
    quantity_or_none,
    share,
    show_catalogue,
)


def strokes(
    output: OutputArgument,
    table: TableOption = None,
    as_json: JsonOption = False,
    as_latex: Annotated[
        bool, typer.Option("--latex", help="Print the means over cycles as a LaTeX table")
    ] = False,
    middle: Annotated[
        str,
        typer.Option(
            help="Share of a stroke over which friction is averaged, in its middle",
            metavar="SHARE",
        ),
    ] = "80%",
    period: Annotated[
        str | None,
        typer.Option(
            help="Time of a revolution of a disc, such as '0.92 s', or auto", metavar="TIME"
        ),
    ] = None,
) -> None:
    """Print strokes, cycles and revolutions of a reciprocating record.

    The record goes back and forth, or is that of a disc.
    """
    from mesoslip.analysis import strokes as analysis

    part = share(middle, "--middle")
    time: float | Literal["auto"] | None = "auto"
    if period != "auto":
        time = quantity_or_none(period, "--period", "s", "0.92 s", positive=True)
    find = partial(analysis.strokes_of, middle=part, name=str(output), period=time)
    show_catalogue(output, find, table, as_json=as_json, as_latex=as_latex, latex_table=-1)
