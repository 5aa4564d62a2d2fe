"""``mesoslip response``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from mesoslip.command_line.options import (
    JsonOption,
    TableOption,
    print_json,
    print_table,
    quantity_or_none,
    write_table,
)


def response(
    outputs: Annotated[
        list[Path], typer.Argument(help="Outputs of mesoslip run or trace", metavar="OUT.nc...")
    ],
    table: TableOption = None,
    as_json: JsonOption = False,
    normal_force: Annotated[
        str | None,
        typer.Option(
            help="Normal force for friction coefficients, such as '10 mN'", metavar="FORCE"
        ),
    ] = None,
    fit: Annotated[bool, typer.Option(help="Fit rate-and-state parameters")] = True,
    free_stiffness: Annotated[
        bool,
        typer.Option(
            "--free-stiffness",
            help="Fit the stiffness of the spring too (prescribed slider: of the contacts)",
        ),
    ] = False,
    as_latex: Annotated[
        bool, typer.Option("--latex", help="Print rate-and-state parameters as a LaTeX table")
    ] = False,
    as_markdown: Annotated[
        bool, typer.Option("--markdown", help="Print rate-and-state parameters as a Markdown table")
    ] = False,
) -> None:
    """Print velocity steps, holds, steady forces, rate and state."""
    from mesoslip.analysis.response import (
        force_scale,
        response_arrays,
        rows_of,
        scalars_of,
        tables,
        write_csv,
    )
    from mesoslip.output import targets
    from mesoslip.output.table_files import latex, markdown

    scale = quantity_or_none(normal_force, "--normal-force", "N", "10 mN", positive=True)
    if table is not None:
        targets.check_writable(table, outputs)
    tree = response_arrays(outputs, normal_force=scale, with_fit=fit, free_stiffness=free_stiffness)
    write_table(table, lambda: tables(tree), lambda file: write_csv(tree, file))
    if as_json:
        groups = {str(name): rows_of(tree, str(name)) for name in tree.children}
        scalars = {key: value for group in groups for key, value in scalars_of(tree, group).items()}
        names = {one: tree.attrs[one] for one in ("outputs", "normal_force") if one in tree.attrs}
        print_json(names | groups | scalars)
        return
    if as_latex or as_markdown:
        # Without fits, the table of steady forces.
        chosen = next(iter(reversed(tables(tree))), None)
        if chosen is not None:
            typer.echo((latex if as_latex else markdown)(chosen))
        return
    typer.echo(force_scale(tree))
    for one in tables(tree):
        typer.echo(f"\n{one.title}")
        print_table((one.head, *one.rows), ("", *one.notes))
        if one.line:
            typer.echo(one.line)
