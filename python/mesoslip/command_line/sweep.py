"""``mesoslip sweep``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mesoslip.command_line.options import (
    PoolOption,
    QuietOption,
    SavedOption,
    SchedulerOption,
    SetOption,
    counted,
    executor_of,
    stored_on_full_disk,
    workers_option,
)
from mesoslip.command_line.progress import progress_shown, say
from mesoslip.execution.stop import Stop, stopped_by_signals

if TYPE_CHECKING:
    from mesoslip.campaign.sweep import Sweep
    from mesoslip.campaign.sweep_plan import Plan

# Maximum number of failures that are printed.
MAX_REPORTED = 20
# Exit status of a sweep with failed or missing points.
FAILED = 1


def sweep(
    file: Annotated[Path, typer.Argument(help="TOML file of a sweep", metavar="SWEEP.toml")],
    output: SavedOption = None,
    changes: SetOption = None,
    workers: Annotated[int | None, workers_option("points")] = None,
    scheduler: SchedulerOption = None,
    dry_run: Annotated[
        bool,
        typer.Option("--dry-run", help="Estimate time, memory and disk space, and run nothing"),
    ] = False,
    pool: PoolOption = None,
    quiet: QuietOption = False,
) -> None:
    """Run a configuration over ranges of parameters.

    The measures of all runs are written as one dataset.

    Each finished point is stored beside the output, in NAME.points. Called again, the command
    computes the missing points. The exit status is 1 if points failed.
    """
    from mesoslip.campaign.sweep import run_sweep
    from mesoslip.campaign.sweep_plan import Plan
    from mesoslip.execution.store import Store
    from mesoslip.output import targets

    plan = Plan.load(file, changes or ())
    path = output or Path("out") / f"{file.stem}.nc"
    folder = path.with_name(f"{path.stem}.points")
    executor = executor_of(workers, scheduler, pool)
    # All combinations are checked before anything is written.
    with progress_shown(quiet, "checking") as progress:
        plan.check(progress)
    if dry_run:
        _print_estimate(plan, folder, workers)
        return
    targets.check_output(path, [file])
    with (
        stored_on_full_disk(folder, "point"),
        Store(folder, "points") as store,
        stopped_by_signals() as stop,
    ):
        with progress_shown(quiet) as progress:
            done = run_sweep(plan, store=store, executor=executor, progress=progress, stop=stop)
        status = _write(done, path, stop)
    _report(done, path, quiet)
    if status:
        raise typer.Exit(status)


def _write(done: Sweep, path: Path, stop: Stop) -> int:
    """Write the dataset, under another name if points are missing; returns the exit status."""
    import xarray as xr

    from mesoslip.output import files, writing

    partial = path.with_name(f"{path.stem}.partial{path.suffix}")
    writing.write(xr.DataTree(done.dataset), path if done.complete else partial)
    if done.complete:
        files.remove_partial(partial)
        return FAILED if done.failures else 0
    say(
        f"{path}: {done.ending}; {done.missing} of {done.dataset['status'].size} points are "
        f"missing, and the same command computes them; the others are in {partial}"
    )
    return stop.exit_status if stop.is_set() else FAILED


def _report(done: Sweep, path: Path, quiet: bool) -> None:
    for point, reason in list(done.failures.items())[:MAX_REPORTED]:
        say(f"{path}: failed: {point}: {reason}")
    if len(done.failures) > MAX_REPORTED:
        say(
            f"{path}: {len(done.failures) - MAX_REPORTED} more failed: see the attribute failures "
            "of the output"
        )
    if not quiet and done.complete:
        failed = f", {len(done.failures)} failed" if done.failures else ""
        computed = counted(done.computed, "point")
        say(f"{path}: {computed} computed, {done.stored} read from the store{failed}")


def _print_estimate(plan: Plan, folder: Path, workers: int | None) -> None:
    from mesoslip.campaign.estimate import estimate
    from mesoslip.execution.executors import checked_workers
    from mesoslip.execution.store import Pieces

    count = checked_workers(workers)
    expected = estimate(plan, Pieces(folder), count)
    axes = " x ".join(
        [f"{len(axis.rows)} {' + '.join(axis.keys)}" for axis in plan.axes]
        + [f"{plan.realizations} realization{'s' * (plan.realizations > 1)}"]
    )
    typer.echo(f"points   {expected.points} ({axes}), {expected.stored} of them done")
    typer.echo(f"time     about {_duration(expected.seconds)} with {counted(count, 'worker')}")
    typer.echo(f"memory   about {expected.memory_bytes / 1e6:.0f} MB")
    typer.echo(f"disk     about {expected.disk_bytes / 1e6:.1f} MB")


def _duration(seconds: float) -> str:
    """A time, rounded, in s, min or h."""
    if seconds < 100:
        return f"{seconds:.0f} s"
    if seconds < 6000:
        return f"{seconds / 60:.0f} min"
    return f"{seconds / 3600:.0f} h"
