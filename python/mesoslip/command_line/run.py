"""``mesoslip run``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mesoslip.command_line.options import (
    ConfigArgument,
    SchedulerOption,
    SetOption,
    executor_of,
    load,
    quantity,
)
from mesoslip.command_line.progress import progress_shown, say
from mesoslip.errors import FileError
from mesoslip.execution.stop import Stop, stopped_by_signals

if TYPE_CHECKING:
    from mesoslip.configuration.config import Config
    from mesoslip.simulation.checkpoint import Checkpoint
    from mesoslip.simulation.runner import Results

# Exit status after Ctrl-C.
INTERRUPTED = 130


def run(
    config: ConfigArgument,
    output: Annotated[
        Path | None,
        typer.Option(
            "-o", "--output", help="Output file; out/<stem>.nc by default", metavar="OUT.nc"
        ),
    ] = None,
    changes: SetOption = None,
    resume: Annotated[
        bool,
        typer.Option(
            "--resume", help="Go on from the checkpoint of a run that was stopped, to the bit"
        ),
    ] = False,
    checkpoint_interval: Annotated[
        str,
        typer.Option(
            help="Wall time between checkpoints, such as '30 s'; 0 for one only when the run is "
            "stopped",
            metavar="TIME",
        ),
    ] = "60 s",
    workers: Annotated[
        int | None,
        typer.Option(min=1, help="Realizations at the same time; as many as processors by default"),
    ] = None,
    scheduler: SchedulerOption = None,
    quiet: Annotated[
        bool, typer.Option("--quiet", help="Show neither progress nor what came of it")
    ] = False,
) -> None:
    """Simulate, and write an output file.

    A checkpoint beside the output, NAME.checkpoint, is kept every minute, and when the run is
    stopped by Ctrl-C, SIGTERM or SIGHUP; the same command with --resume goes on from it.
    """
    from mesoslip.output import files, targets, writing
    from mesoslip.simulation.checkpoint import Checkpoint, checkpoint_folder
    from mesoslip.simulation.memory import check_memory
    from mesoslip.simulation.runner import run_realizations

    checked = load(config, changes)
    interval = quantity(checkpoint_interval, "--checkpoint-interval", "s", "30 s", negative=False)
    path = output or Path("out") / f"{Path(config).stem}.nc"
    targets.check_output(path, [config])
    if scheduler is None:
        check_memory(checked)

    def report(text: str) -> None:
        say(f"{path}: {text}")

    if not quiet and files.is_of_another(path, checked):
        report("replaces the output of another configuration at the end; -o gives other names")
    with (
        Checkpoint(
            checkpoint_folder(path),
            checked,
            interval=interval,
            resume=resume,
            report=report,
        ) as checkpoint,
        stopped_by_signals() as stop,
    ):
        with progress_shown(quiet) as progress:
            results = run_realizations(
                checked,
                executor=executor_of(workers, scheduler),
                progress=progress,
                stop=stop,
                checkpoint=checkpoint,
            )
        if not results.complete:
            raise typer.Exit(_keep(results, path, stop, checkpoint))
        try:
            writing.write_results(results, path)
        except FileError as error:
            if checkpoint.write(results.realizations):
                raise FileError(
                    f"{error}; the results are kept in {checkpoint.folder}: the same command with "
                    "--resume writes them"
                ) from error
            raise
        if not quiet:
            _report_results(results, checked, path)
        files.remove_partial(_partial(path))
        checkpoint.remove()


def _partial(path: Path) -> Path:
    return path.with_name(f"{path.stem}.partial{path.suffix}")


def _keep(results: Results, path: Path, stop: Stop, checkpoint: Checkpoint) -> int:
    """Tell what is kept of a run that was stopped; the exit status."""
    import signal

    from mesoslip.output import layout, writing

    told = str(layout.attributes(results)["comment"])
    is_kept = checkpoint.saved_time is not None
    if is_kept:
        told += "; the same command with --resume goes on from there"
    # Who is being shut down has no time for a file that the checkpoint makes superfluous.
    if stop.signal in {None, signal.SIGINT} or not is_kept:
        try:
            writing.write_results(results, _partial(path))
            told += f"; what there is, is in {_partial(path)}"
        except FileError as error:
            told += f"; {error}"
    say(f"{path}: {told}")
    return stop.exit_status


def _report_results(results: Results, config: Config, path: Path) -> None:
    from mesoslip.analysis import regime
    from mesoslip.output import layout
    from mesoslip.simulation.realization import ENDINGS

    told = layout.attributes(results)
    slips = sum(len(one.rows("slips")) for one in results.realizations)
    found = f"{slips} slip{'s' if slips != 1 else ''}"
    if config.has_avalanches:
        count = sum(one.avalanche_count for one in results.realizations)
        found = f"{count} avalanches, {found}"
    say(
        f"{path}: {told['break_count']:.0f} breaks, {found}, "
        f"energy balance to {abs(told['energy_residual']):.0e}, "
        f"{told['wall_seconds']:.2f} s",
    )
    say(f"{path}: {regime.summary(list(regime.regimes_of_results(results)))}")
    if told["break_count"] == 0:
        say(f"{path}: no contact broke: the drive did not come far enough in this time")
    if told["audit"] != "passed":
        say(f"{path}: warning: {told['audit']}")
    if config.unreached_drive is not None:
        say(f"{path}: warning: {config.unreached_drive}")
    if told["ending"] != ENDINGS["drive"]:
        say(f"{path}: the run ended as follows: {told['ending']}")
