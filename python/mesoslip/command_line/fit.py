"""``mesoslip fit``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from mesoslip.command_line.options import (
    JsonOption,
    OutputArgument,
    SetOption,
    print_json,
    print_table,
)
from mesoslip.command_line.progress import progress_shown, say
from mesoslip.execution.stop import StoppedError, stopped_by_signals

if TYPE_CHECKING:
    from mesoslip.inference.posterior import Row


def fit(
    output: OutputArgument,
    config: Annotated[
        str,
        typer.Argument(
            help="TOML file with the known parameters, and a table [fit.free] of free ones",
            metavar="CONFIG",
        ),
    ],
    posterior: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            help="Posterior file; out/<stem>.posterior.nc by default",
            metavar="POSTERIOR.nc",
        ),
    ] = None,
    changes: SetOption = None,
    workers: Annotated[
        int | None,
        typer.Option(min=1, help="Parallel simulations; the number of processors by default"),
    ] = None,
    quiet: Annotated[bool, typer.Option("--quiet", help="Print no progress")] = False,
    as_json: JsonOption = False,
) -> None:
    """Fit parameters of the model to a trace, with their uncertainty.

    Simulations are stored beside the posterior, in NAME.simulations, until the fit is done. After
    an interruption the same command continues.
    """
    from mesoslip.errors import FileError
    from mesoslip.execution.store import Store
    from mesoslip.inference.fit_trace import fit as fit_trace
    from mesoslip.inference.plan import Plan
    from mesoslip.inference.posterior import table
    from mesoslip.output import files, targets, writing

    if Path(config).suffix == ".nc":
        raise FileError(f"{config}: is an output; a fit needs a TOML file with a table [fit.free]")
    plan = Plan.load(config, changes or ())
    path = posterior or Path("out") / f"{output.stem}.posterior.nc"
    targets.check_output(path, [output, config])
    store = path.with_name(f"{path.stem}.simulations")
    trace = files.read_run(output)
    with stopped_by_signals() as stop:
        try:
            with progress_shown(quiet) as progress:
                tree = fit_trace(
                    trace, plan, store=store, executor=workers, progress=progress, stop=stop
                )
        except StoppedError:
            say(f"{path}: interrupted; the same command continues from {store}")
            raise typer.Exit(stop.exit_status) from None
    writing.write(tree, path)
    Store(store, "simulations").remove()
    rows = table(tree)
    notes = [one for one in str(tree.attrs["warnings"]).split("\n") if one]
    if as_json:
        print_json(
            {
                "parameters": {
                    row.key: {
                        "unit": row.unit,
                        "median": row.percentiles[2],
                        "interval_50": [row.percentiles[1], row.percentiles[3]],
                        "interval_90": [row.percentiles[0], row.percentiles[4]],
                        "shrinkage": row.shrinkage,
                        "verdict": row.verdict,
                        "most_informative": row.most_informative,
                    }
                    for row in rows
                },
                "agreement_probability": tree.attrs["agreement_probability"],
                "warnings": notes,
            }
        )
        return
    _print_rows(rows, tree.attrs)
    for one in notes:
        typer.echo(f"warning: {one}")


def _print_rows(rows: Sequence[Row], attributes: Mapping[Any, Any]) -> None:
    """A line for each parameter, in a unit that suits its median."""
    from mesoslip.quantities import scale_for, with_unit

    cells = [
        [
            "parameter",
            "median",
            "50 % interval",
            "90 % interval",
            "unit",
            "verdict",
            "shrinkage",
            "most informative feature",
        ]
    ]
    for row in rows:
        scale = scale_for(row.percentiles[2], row.unit)
        low, lower, middle, upper, high = (
            f"{one / scale.size:.{row.digits}g}" for one in row.percentiles
        )
        cells.append(
            [
                row.key,
                middle,
                f"{lower} to {upper}",
                f"{low} to {high}",
                scale.name,
                row.verdict,
                f"{row.shrinkage:.2f}",
                row.most_informative,
            ]
        )
    print_table(cells)
    typer.echo(
        f"noise {with_unit(attributes['noise'], 'N', 3)}; {attributes['simulation_count']} "
        "simulations; agreement of model and trace: "
        f"p = {attributes['agreement_probability']:.2g}"
    )
