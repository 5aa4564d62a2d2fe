"""``mesoslip fronts``."""

from __future__ import annotations

from typing import Annotated

import typer

from mesoslip.command_line.options import (
    JsonOption,
    OutputArgument,
    TableOption,
    print_json,
    print_table,
    write_table,
)

# Rows of a table that are printed.
MAX_ROWS = 20


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
    from mesoslip.output import files, targets
    from mesoslip.output.table_files import latex

    if table is not None:
        targets.check_writable(table, [output])
    with files.opened_arrays(output) as tree:
        found = fronts_of(tree, str(output))
    write_table(table, lambda: found.tables, found.write_csv)
    if as_json:
        print_json(found.to_json())
        return
    tables = found.tables
    if as_latex:
        typer.echo(latex(tables[0]))
        return
    for one in tables:
        typer.echo(f"\n{one.title}")
        print_table((one.head, *one.rows[:MAX_ROWS]))
        if len(one.rows) > MAX_ROWS:
            typer.echo(f"the first {MAX_ROWS} of {len(one.rows)}; all with --csv FILE")
    sentence = found.size_sentence()
    if sentence is not None:
        typer.echo(f"\n{sentence}")
