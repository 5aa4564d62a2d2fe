"""``mesoslip response``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from mesoslip.command_line.options import (
    JsonOption,
    QuietOption,
    TableOption,
    format_option,
    interruptible,
    option,
    output_option,
    positive_or_none,
    print_json,
    print_table,
    write_table,
)
from mesoslip.errors import ConfigError, FileError, Problem

if TYPE_CHECKING:
    from mesoslip.array_types import DataTree


def response(
    outputs: Annotated[
        list[Path], typer.Argument(help="Outputs of mesoslip run or trace", metavar="OUT.nc...")
    ],
    table: TableOption = None,
    as_json: JsonOption = False,
    normal_force: Annotated[
        str | None, option("Normal force for friction coefficients, such as '10 mN'", "FORCE")
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
        bool, format_option("--latex", "Print rate-and-state parameters as a LaTeX table")
    ] = False,
    as_markdown: Annotated[
        bool, format_option("--markdown", "Print rate-and-state parameters as a Markdown table")
    ] = False,
    posterior: Annotated[
        bool,
        typer.Option(
            "--posterior",
            help="Draw rate-and-state parameters and the noise from their posterior, and print "
            "only these, of one output",
        ),
    ] = False,
    output: Annotated[
        Path | None,
        output_option("File of the posterior; out/<stem>.rates.nc by default", "RATES.nc"),
    ] = None,
    law: Annotated[
        list[str] | None,
        option("Law of the posterior, such as slip or 'slip, two states'; may be repeated", "LAW"),
    ] = None,
    samples: Annotated[
        int | None, option("Draws of the posterior of each law; 4000 by default", "NUMBER")
    ] = None,
    seed: Annotated[int | None, option("Seed of the posterior; 1 by default", "NUMBER")] = None,
    quiet: QuietOption = False,
) -> None:
    """Print velocity steps, holds, steady forces, rate and state."""
    from mesoslip.analysis.response.dataset import response_arrays, rows_of, scalars_of, write_csv
    from mesoslip.analysis.response.tables import force_scale, tables
    from mesoslip.output import targets
    from mesoslip.output.table_files import latex, markdown

    scale = positive_or_none(normal_force, "--normal-force", "N", "10 mN")
    targets.check_writable(table, outputs)
    own = {"--output": output, "--law": law, "--samples": samples, "--seed": seed}
    others = {"--normal-force": normal_force, "--no-fit": None if fit else True}
    _check_options(others if posterior else own, posterior=posterior)
    if posterior:
        path = output or Path("out") / f"{outputs[0].stem}.rates.nc"
        own = {"laws": law, "samples": samples, "seed": seed, "free_stiffness": free_stiffness}
        options = {name: value for name, value in own.items() if value is not None}
        sampled = _sampled(outputs, path, quiet, **options)
        _print_posterior(sampled, table, as_json, as_latex, as_markdown)
        return
    tree = response_arrays(outputs, normal_force=scale, with_fit=fit, free_stiffness=free_stiffness)
    write_table(table, lambda: tables(tree), lambda file: write_csv(tree, file))
    if as_json:
        groups = {str(name): rows_of(tree, str(name)) for name in tree.children}
        scalars = {key: value for group in groups for key, value in scalars_of(tree, group).items()}
        names = {one: tree.attrs[one] for one in ("outputs", "normal_force") if one in tree.attrs}
        print_json(names | groups | scalars)
        return
    if as_latex or as_markdown:
        # Without fits, or with nothing that they could fit, the table before.
        filled = [one for one in tables(tree) if any(set("".join(row)) - {"-"} for row in one.rows)]
        chosen = next(reversed(filled), None)
        if chosen is not None:
            typer.echo((latex if as_latex else markdown)(chosen))
        return
    typer.echo(force_scale(tree))
    for one in tables(tree):
        typer.echo(f"\n{one.title}")
        print_table((one.head, *one.rows), ("", *one.notes))
        if one.line:
            typer.echo(one.line)


def _check_options(refused: Mapping[str, object], *, posterior: bool) -> None:
    """Refuse options that were given, as they need --posterior or do not go with it."""
    message = "does not go with --posterior" if posterior else "needs --posterior"
    problems = [
        Problem("", name, message, value) for name, value in refused.items() if value is not None
    ]
    if problems:
        raise ConfigError(problems)


def _sampled(outputs: Sequence[Path], path: Path, quiet: bool, **options: Any) -> DataTree:
    """The posterior of an output, also written to a file."""
    from mesoslip.inference.rate_tree import response_posterior
    from mesoslip.output import targets, writing

    if len(outputs) > 1:
        raise FileError("--posterior is for one output at a time")
    targets.check_output(path, outputs)
    with interruptible(path, quiet, what="sampling") as work:
        tree = response_posterior(outputs[0], **work._asdict(), **options)
    writing.write(tree, path)
    return tree


def _print_posterior(
    tree: DataTree, table: Path | None, as_json: bool, as_latex: bool, as_markdown: bool
) -> None:
    """Print the table of a posterior, assessments of the laws, and warnings."""
    from mesoslip.inference.rate_tree import rate_table, remarks, rows_of_posterior, write_csv
    from mesoslip.output.table_files import latex, markdown

    printed, found = rate_table(tree), remarks(tree)
    write_table(table, lambda: [printed], lambda file: write_csv(tree, file))
    if as_json:
        print_json({"rate_and_state_posterior": rows_of_posterior(tree)} | found)
        return
    if as_latex or as_markdown:
        typer.echo((latex if as_latex else markdown)(printed))
        return
    print_table((printed.head, *printed.rows))
    for one in (*found["assessments"], *found["notes"]):
        typer.echo(one)
    for one in found["warnings"]:
        typer.echo(f"warning: {one}")
