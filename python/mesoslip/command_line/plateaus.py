"""``mesoslip plateaus``."""

from __future__ import annotations

from typing import Annotated

import typer

from mesoslip.command_line.options import (
    JsonOption,
    LatexOption,
    OutputArgument,
    TableOption,
    print_json,
    print_tables,
    quantity_or_none,
    write_table,
)


def plateaus(
    output: OutputArgument,
    table: TableOption = None,
    as_json: JsonOption = False,
    as_latex: LatexOption = False,
    signal: Annotated[
        str | None,
        typer.Option(
            help="Signal whose steps cut the record: speed, load or force; by default speed and "
            "load where they have steps",
            metavar="SIGNAL",
        ),
    ] = None,
    viscosity: Annotated[
        str | None,
        typer.Option(
            help="Viscosity of the lubricant, such as '90 mPa*s', for a Stribeck curve",
            metavar="VISCOSITY",
        ),
    ] = None,
) -> None:
    """Print the friction of each plateau of a record.

    Plateaus lie between steps of speed, load or force.
    """
    from mesoslip.analysis import plateaus as analysis
    from mesoslip.output import files, targets
    from mesoslip.output.table_files import latex

    analysis.check_signal("--signal", signal)
    lubricant = quantity_or_none(viscosity, "--viscosity", "Pa*s", "90 mPa*s", positive=True)
    if table is not None:
        targets.check_writable(table, [output])
    with files.opened_arrays(output) as tree:
        found = analysis.plateaus_of(tree, signal=signal, viscosity=lubricant, name=str(output))
    write_table(table, lambda: found.tables, found.write_csv)
    if as_json:
        print_json(found.to_json())
    elif as_latex:
        typer.echo(latex(found.tables[0]))
    else:
        for note in found.notes:
            typer.echo(note)
        print_tables(found.tables)
