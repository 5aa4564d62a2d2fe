"""``mesoslip fit``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from mesoslip.command_line.options import (
    JsonOption,
    QuietOption,
    SetOption,
    interruptible,
    option,
    output_option,
    print_json,
    print_table,
    stored_on_full_disk,
    workers_option,
)

if TYPE_CHECKING:
    from mesoslip.array_types import DataTree
    from mesoslip.inference.posterior import Row

HEAD = (
    *("parameter", "median", "50 % interval", "90 % interval", "unit"),
    *("verdict", "shrinkage", "follows from"),
)


def fit(
    outputs: Annotated[
        list[Path],
        typer.Argument(
            help="Outputs with the traces, then a TOML file with the known parameters and a table "
            "[fit.free] of free ones; with --predict also the posterior file of an earlier fit; "
            "with --compare posterior files",
            metavar="OUT.nc... CONFIG",
        ),
    ],
    posterior: Annotated[
        Path | None,
        output_option("Posterior file; out/<stem>.posterior.nc by default", "POSTERIOR.nc"),
    ] = None,
    changes: SetOption = None,
    predict: Annotated[
        Path | None,
        option(
            "Predict a trace that is not in the fit, into a file of its own", "OUT.nc", "--predict"
        ),
    ] = None,
    compare: Annotated[
        bool, typer.Option("--compare", help="Compare fits of the same traces by their predictions")
    ] = False,
    predictions: Annotated[
        int | None,
        option("Number of traces with --predict, at least 50; 60 by default", "NUMBER", min=50),
    ] = None,
    workers: Annotated[int | None, workers_option("simulations")] = None,
    quiet: QuietOption = False,
    as_json: JsonOption = False,
) -> None:
    """Fit parameters to measured traces, with their uncertainty.

    The traces are of one interface. Of several traces each has its own drive and spring, and all
    have the free parameters. Simulations are stored beside the posterior, in NAME.simulations,
    until the fit is done. After an interruption the same command continues.
    """
    if compare:
        _print_scores(outputs, as_json=as_json)
        return
    from mesoslip.output import targets

    *traces, config = outputs
    if predict is not None and config.suffix == ".nc" and not traces:
        target = posterior or config.with_name(f"{config.stem}.{predict.stem}.nc")
        _predict(config, predict, target, predictions, workers, quiet=quiet, as_json=as_json)
        return
    check_arguments(traces, config, predict)
    path = posterior or Path("out") / f"{traces[0].stem}.posterior.nc"
    if predict is not None:
        target = path.with_name(f"{path.stem}.{predict.stem}.nc")
        targets.check_output(target, [*traces, config, predict])
    tree = _fitted(traces, config, path, changes or (), workers, quiet=quiet)
    _print(tree, as_json=as_json and predict is None)
    if predict is not None:
        _predict(path, predict, target, predictions, workers, quiet=quiet, as_json=as_json)


def _fitted(
    traces: Sequence[Path],
    config: Path,
    path: Path,
    changes: Sequence[str],
    workers: int | None,
    *,
    quiet: bool,
) -> DataTree:
    """Fit traces, and write the posterior."""
    from mesoslip.execution.store import Store
    from mesoslip.inference.fit_trace import as_plan
    from mesoslip.inference.fit_trace import fit as fit_traces
    from mesoslip.output import files, targets, writing
    from mesoslip.output.inputs import distinct

    targets.check_output(path, [*traces, config])
    store = path.with_name(f"{path.stem}.simulations")
    trees = [files.read_run(one) for one in distinct(traces)]
    plan = as_plan(config, trees, changes)
    with stored_on_full_disk(store, "simulation"):
        with interruptible(path, quiet, f"; the same command continues from {store}") as work:
            tree = fit_traces(traces, plan, store=store, executor=workers, **work._asdict())
        writing.write(tree, path)
    Store(store, "simulations").remove()
    return tree


def _predict(
    posterior: Path,
    trace: Path,
    path: Path,
    predictions: int | None,
    workers: int | None,
    *,
    quiet: bool,
    as_json: bool,
) -> None:
    """Predict a trace by a posterior, write the predictions, and print the agreement."""
    from mesoslip.inference.predict import predict
    from mesoslip.output import targets, writing

    targets.check_output(path, [posterior, trace])
    count: dict[str, Any] = {} if predictions is None else {"predictions": predictions}
    with interruptible(path, quiet) as work:
        tree = predict(posterior, trace, **count, executor=workers, **work._asdict())
    writing.write(tree, path)
    probability = tree.attrs["agreement_probability"]
    if as_json:
        print_json({"agreement_probability": probability} | _remarks(tree))
        return
    typer.echo(f"{path}: agreement of {trace} with its prediction: p = {probability:.2g}")
    _print_remarks(tree)


def _print_scores(posteriors: Sequence[Path], *, as_json: bool) -> None:
    """Compare fits of the same traces, and print their scores."""
    from mesoslip.inference.predict import compare_fits
    from mesoslip.quantities import with_error

    scores = compare_fits(posteriors)
    if as_json:
        rows = [
            {
                "file": str(path),
                "log_density": one.log_density,
                "difference": one.difference,
                "difference_error": one.error,
            }
            for path, one in zip(posteriors, scores, strict=True)
        ]
        print_json({"fits": rows})
        return
    cells = [["fit", "log predictive density", "below the best"]]
    for path, one in zip(posteriors, scores, strict=True):
        below = with_error(one.difference, one.error) if one.difference > 0 else "best"
        cells.append([str(path), f"{one.log_density:.1f}", below])
    print_table(cells)


def _print(tree: DataTree, *, as_json: bool) -> None:
    """Print the table of a fit, its notes and its warnings."""
    from mesoslip.inference.posterior import table

    rows = table(tree)
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
                        "follows_from": row.follows_from,
                    }
                    for row in rows
                },
                "agreement_probability": tree.attrs["agreement_probability"],
            }
            | _remarks(tree)
        )
        return
    _print_rows(rows, tree.attrs)
    _print_remarks(tree)


def _remarks(tree: DataTree) -> dict[str, list[str]]:
    """Warnings and notes, a sentence each."""
    return {
        name: [one for one in str(tree.attrs[name]).split("\n") if one]
        for name in ("warnings", "notes")
    }


def _print_remarks(tree: DataTree) -> None:
    remarks = _remarks(tree)
    for one in remarks["notes"]:
        typer.echo(one)
    for one in remarks["warnings"]:
        typer.echo(f"warning: {one}")


def check_arguments(traces: Sequence[Path], config: Path, predict: Path | None = None) -> None:
    """Check that traces and a configuration are given, in this order."""
    from mesoslip.errors import FileError
    from mesoslip.output import files

    if config.suffix == ".nc":
        raise FileError(f"{config}: is an output; a fit needs a TOML file with a table [fit.free]")
    if not traces:
        raise FileError("a fit needs an output with a trace, and a TOML file with [fit.free]")
    if predict is not None:
        with files.opened(traces[0]) as tree:
            if "posterior" in tree.children:
                raise FileError(
                    f"{config}: the fit {traces[0]} has its configuration; leave this one out: "
                    f"mesoslip fit {traces[0]} --predict {predict}"
                )
        # Errors in the trace are reported before the fit.
        files.read_run(predict)


def _print_rows(rows: Sequence[Row], attributes: Mapping[Any, Any]) -> None:
    """Print a line for each parameter, in a unit that suits its median."""
    from mesoslip.quantities import scale_for, with_unit

    cells = [list(HEAD)]
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
                row.follows_from,
            ]
        )
    print_table(cells)
    typer.echo(
        f"noise {with_unit(attributes['noise'], 'N', 3)}; {attributes['simulation_count']} "
        "simulations; agreement of model and trace: "
        f"p = {attributes['agreement_probability']:.2g}"
    )
