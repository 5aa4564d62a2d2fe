"""``mesoslip strokes``."""

from __future__ import annotations

from typing import Annotated, Literal

import typer

from mesoslip.command_line.options import (
    JsonOption,
    OutputArgument,
    TableOption,
    print_json,
    print_tables,
    quantity_or_none,
    share,
    write_table,
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
    from mesoslip.output import files, targets
    from mesoslip.output.table_files import latex

    part = share(middle, "--middle")
    time: float | Literal["auto"] | None = "auto"
    if period != "auto":
        time = quantity_or_none(period, "--period", "s", "0.92 s", positive=True)
    if table is not None:
        targets.check_writable(table, [output])
    with files.opened_arrays(output) as tree:
        found = analysis.strokes_of(tree, part, str(output), period=time)
    write_table(table, lambda: found.tables, found.write_csv)
    if as_json:
        print_json(found.to_json())
        return
    if as_latex:
        typer.echo(latex(found.tables[-1]))
        return
    for note in found.notes:
        typer.echo(note)
    print_tables(found.tables)
