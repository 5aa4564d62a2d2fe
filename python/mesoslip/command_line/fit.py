"""``mesoslip fit``."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from mesoslip.command_line.options import JsonOption, OutputArgument, SetOption, print_json
from mesoslip.command_line.progress import progress_shown, say
from mesoslip.execution.stop import StoppedError, stopped_by_signals

# Units in which parameters are shown, by their SI unit: scales from the greatest to the least.
SCALES = ((1e9, "G"), (1e6, "M"), (1e3, "k"), (1.0, ""), (1e-3, "m"), (1e-6, "u"), (1e-9, "n"))
# What prefixes go with.
PREFIXED = {"N", "N/m", "s", "m", "m/s", "Pa"}


def fit(
    output: OutputArgument,
    config: Annotated[
        str,
        typer.Argument(
            help="TOML file of what is known, with a table [fit.free]", metavar="CONFIG"
        ),
    ],
    posterior: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            help="Posterior; out/<stem>.posterior.nc by default",
            metavar="POSTERIOR.nc",
        ),
    ] = None,
    changes: SetOption = None,
    workers: Annotated[
        int | None,
        typer.Option(min=1, help="Simulations at the same time; as many as processors by default"),
    ] = None,
    quiet: Annotated[bool, typer.Option("--quiet", help="Show no progress")] = False,
    as_json: JsonOption = False,
) -> None:
    """Fit parameters of the model to a trace, with their uncertainty.

    Simulations are kept beside the posterior, in NAME.simulations, until the fit is done: the
    same command goes on after it was stopped.
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
            say(f"{path}: interrupted; the same command goes on from {store}")
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
                        "informed_by": row.informed_by,
                    }
                    for row in rows
                },
                "agreement_probability": tree.attrs["agreement_probability"],
                "warnings": notes,
            }
        )
        return
    _show(rows, tree.attrs)
    for one in notes:
        typer.echo(f"warning: {one}")


def _show(rows: list[Any], told: Mapping[Any, Any]) -> None:
    width = max(len("parameter"), *(len(row.key) for row in rows))
    typer.echo(
        f"{'parameter':{width}} {'value':>9}  {'50 % interval':>19}  {'90 % interval':>19} "
        f"{'unit':6} {'verdict':15} shrinkage  told most by"
    )
    for row in rows:
        scale, unit = _scale(row.percentiles[2], row.unit)
        digits = row.digits
        low, lower, middle, upper, high = (f"{one / scale:.{digits}g}" for one in row.percentiles)
        typer.echo(
            f"{row.key:{width}} {middle:>9}  {lower + ' - ' + upper:>19}  {low + ' - ' + high:>19} "
            f"{unit:6} {row.verdict:15} {row.shrinkage:9.2f}  {row.informed_by}"
        )
    typer.echo(
        f"noise {1e6 * told['noise']:.3g} uN; {told['simulation_count']} simulations; agreement of "
        f"the model with the trace p = {told['agreement_probability']:.2g}"
    )


def _scale(value: float, unit: str) -> tuple[float, str]:
    """A factor, and the unit with the prefix of it, in which a value is easily read."""
    if unit not in PREFIXED or value == 0:
        return 1.0, "" if unit == "1" else unit
    # Spring constants are given in N/m.
    if unit == "N/m":
        return 1.0, unit
    for scale, prefix in SCALES:
        if abs(value) >= scale:
            return scale, prefix + unit
    exponent = 3 * math.floor(math.log10(abs(value)) / 3)
    return 10.0**exponent, f"1e{exponent} {unit}"
