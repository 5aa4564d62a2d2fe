"""``mesoslip run``."""

from __future__ import annotations

import math
import os
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mesoslip.command_line.options import (
    ConfigArgument,
    SavedOption,
    SchedulerOption,
    SetOption,
    counted,
    executor_of,
    load,
    option,
    quantity,
    workers_option,
)
from mesoslip.command_line.progress import progress_shown, say
from mesoslip.errors import FileError, MesoslipError, NoMemoryError
from mesoslip.execution.stop import Stop, stopped_by_signals

if TYPE_CHECKING:
    from mesoslip.configuration.config import Config
    from mesoslip.simulation.checkpoint import Checkpoint
    from mesoslip.simulation.run_realizations import Results

# Exit status after Ctrl-C.
INTERRUPTED = 130
# Expected size of an output that is reported before the run [bytes].
LARGE = 5e8
# Expected time of changes of the load that is reported before the run [s].
LONG = 60.0
# Rows of the trace that are read at once.
MAX_ROWS = 400_000


def run(
    config: ConfigArgument,
    output: SavedOption = None,
    changes: SetOption = None,
    resume: Annotated[
        bool,
        typer.Option(
            "--resume", help="Continue a stopped run from its checkpoint, with identical results"
        ),
    ] = False,
    checkpoint_interval: Annotated[
        str,
        option(
            "Wall time between checkpoints, such as '30 s'; 0: a checkpoint only when the run "
            "is stopped",
            "TIME",
        ),
    ] = "60 s",
    workers: Annotated[int | None, workers_option("realizations")] = None,
    scheduler: SchedulerOption = None,
    quiet: Annotated[
        bool, typer.Option("--quiet", help="Print neither progress nor results")
    ] = False,
) -> None:
    """Simulate, and write an output file.

    A checkpoint is written beside the output, as NAME.checkpoint, every minute and when the run is
    stopped by Ctrl-C, SIGTERM or SIGHUP. The same command with --resume continues from it.
    """
    from mesoslip.configuration.contacts.base import LOAD_CHANGE_SECONDS
    from mesoslip.output import files, targets, writing
    from mesoslip.simulation.checkpoint import Checkpoint, checkpoint_folder
    from mesoslip.simulation.memory import check_memory, output_bytes
    from mesoslip.simulation.run_realizations import run_realizations

    checked = load(config, changes)
    interval = quantity(checkpoint_interval, "--checkpoint-interval", "s", "30 s", negative=False)
    path = output or Path("out") / f"{Path(config).stem}.nc"
    targets.check_output(path, [config])
    if scheduler is None:
        check_memory(checked)

    def report(text: str) -> None:
        say(f"{path}: {text}")

    if not quiet and files.is_of_another(path, checked):
        report(
            "the output of another configuration will be replaced at the end; -o gives another name"
        )
    expected = output_bytes(checked)
    if not quiet and expected > LARGE:
        report(
            f"the output will take about {expected / 1e9:.2g} GB; output.interval and "
            "output.slip_interval set how fine it is"
        )
    touches = checked.run.realizations * checked.contact_kind.load_changes(checked)
    if not quiet and touches * LOAD_CHANGE_SECONDS > LONG:
        report(
            f"contacts will touch or separate about {touches:.1g} times as the load changes, which "
            f"takes some {touches * LOAD_CHANGE_SECONDS:.1g} s of processor time"
        )
    folder = checkpoint_folder(path)
    with (
        Checkpoint(folder, checked, interval=interval, resume=resume, report=report) as checkpoint,
        stopped_by_signals() as stop,
    ):
        try:
            with progress_shown(quiet) as progress:
                results = run_realizations(
                    checked,
                    executor=executor_of(workers, scheduler),
                    progress=progress,
                    stop=stop,
                    checkpoint=checkpoint,
                )
        except NoMemoryError as error:
            if not checkpoint.is_written:
                raise
            raise NoMemoryError(
                f"{error}; the results so far are in {folder}: with more memory, the same command "
                "with --resume continues"
            ) from error
        if not results.complete:
            raise typer.Exit(_keep(results, path, stop, checkpoint))
        try:
            threads = workers or os.cpu_count() or 1
            with progress_shown(quiet, "writing") as progress:
                writing.write_results(results, path, threads=threads, progress=progress)
        except (MesoslipError, MemoryError) as error:
            if checkpoint.write(results.realizations):
                reason = str(error) or "there is not enough memory"
                raise FileError(
                    f"{reason}; the results are in {checkpoint.folder}: the same command with "
                    "--resume writes the output"
                ) from error
            raise
        if not quiet:
            _report_results(results, checked, path, stop)
        files.remove_partial(_partial(path))
        checkpoint.remove()


def _partial(path: Path) -> Path:
    return path.with_name(f"{path.stem}.partial{path.suffix}")


def _keep(results: Results, path: Path, stop: Stop, checkpoint: Checkpoint) -> int:
    """Keep the results of a stopped run, and report where; returns the exit status."""
    import signal

    from mesoslip.output import layout, writing

    message = layout.interruption(results.realizations)
    is_kept = checkpoint.saved_time is not None
    if is_kept:
        message += "; the same command with --resume continues from the checkpoint"
    # At a shutdown there is no time for a file, and the checkpoint has the results.
    if stop.signal in {None, signal.SIGINT} or not is_kept:
        try:
            writing.write_results(results, _partial(path))
            message += f"; the results so far are in {_partial(path)}"
        except FileError as error:
            message += f"; {error}"
    say(f"{path}: {message}")
    return stop.exit_status


def _report_results(results: Results, config: Config, path: Path, stop: Stop) -> None:
    from mesoslip.output import layout
    from mesoslip.simulation.realization import ENDINGS

    known = layout.attributes(results)
    counts = [counted(known["break_count"], "break")]
    if config.has_avalanches:
        counts.append(
            counted(sum(one.avalanche_count for one in results.realizations), "avalanche")
        )
    counts.append(counted(sum(len(one.rows("slips")) for one in results.realizations), "slip"))
    say(
        f"{path}: {', '.join(counts)}; relative energy residual "
        f"{abs(known['energy_residual']):.0e}; {known['wall_seconds']:.2f} s"
    )
    if config.drive.is_force:
        say(f"{path}: {_mean_velocity(results, config)}")
    else:
        say(f"{path}: {_regimes(results, config, path, stop)}")
    if known["break_count"] == 0:
        say(f"{path}: no contact broke: {_short_drive(config)}")
    if known["audit"] != "passed":
        say(f"{path}: warning: {known['audit']}")
    if config.contacts.weak_track is not None:
        say(f"{path}: warning: {config.contacts.weak_track}")
    if config.unreached_drive is not None:
        say(f"{path}: warning: {config.unreached_drive}")
    unreached = _unreached_conditions(results, config)
    if unreached:
        say(f"{path}: warning: {unreached}")
    for note in config.notes:
        say(f"{path}: {note}")
    if config.continued_drive is not None and known["ending"] == ENDINGS["drive"]:
        say(f"{path}: {config.continued_drive}")
    if known["ending"] != ENDINGS["drive"]:
        say(f"{path}: end of the run: {known['ending']}")


def _short_drive(config: Config) -> str:
    """Why no contact broke: how far the drive moved, and how far it loads the spring to F_s."""
    from mesoslip.quantities import with_unit

    if not 0 < config.spring_stiffness < math.inf:
        return "the drive did not move far enough"
    lengths = (
        math.fsum(part.path_length for part in config.drive_parts),
        config.contacts.static_force / config.spring_stiffness,
    )
    path_length, needed = (with_unit(one, "m") for one in lengths)
    return f"the path of the drive is {path_length}, and F_s/K is {needed}"


def _regimes(results: Results, config: Config, path: Path, stop: Stop) -> str:
    """The regimes of all realizations, which may take longer than short runs; after an interrupt,
    or of strokes, the command that evaluates them."""
    from mesoslip.analysis.regime import outputs, result

    if config.drive.cycle is not None:
        return f"the drive goes back and forth; 'mesoslip strokes {path}' evaluates its strokes"
    found: list[result.RegimeResult] = []
    count = len(results.realizations)
    with progress_shown(count == 1, "regimes") as progress:
        for one in outputs.regimes_of_results(results):
            if stop.is_set():
                return f"complete; 'mesoslip regime {path}' prints the regime"
            found.append(one)
            if len(found) % max(1, count // 100) == 0:
                progress(len(found) / count)
    return result.summary(found)


def _mean_velocity(results: Results, config: Config) -> str:
    """The mean velocity in the last stage of a drive by force, over all realizations."""
    import numpy as np

    from mesoslip.quantities import with_unit
    from mesoslip.simulation.recorded_tables import TRACE_COLUMNS

    wanted = [TRACE_COLUMNS.index(name) for name in ("time", "displacement")]
    velocities = []
    for one in results.realizations:
        start, begin = 0.0, 0.0
        for before, part in pairwise(config.drive_parts):
            start += before.duration
            if part.stage > before.stage and start < one.time:
                begin = start
        blocks = [block[:, wanted] for block in one.rows("trace").blocks(MAX_ROWS)]
        time, displacement = np.concatenate(blocks).T
        moved = displacement[-1] - np.interp(begin, time, displacement)
        velocities.append(moved / (time[-1] - begin) if time[-1] > begin else 0.0)
    return f"mean velocity in the last stage: {with_unit(float(np.mean(velocities)), 'm/s', 3)}"


def _unreached_conditions(results: Results, config: Config) -> str:
    """A message about conditions that did not end the run before its drive ended; empty if one of
    them ended every realization."""
    from mesoslip.quantities import with_unit
    from mesoslip.simulation.realization import ENDINGS

    stops = config.run.stops
    given = {
        "run.avalanches": config.run.avalanches,
        "run.stop.slips": stops.slips,
        "run.stop.displacement": stops.displacement,
        "run.stop.steady": stops.steady,
    }
    names = [name for name, value in given.items() if value is not None]
    cut = [one for one in results.realizations if one.ending == ENDINGS["drive"]]
    if not names or not cut:
        return ""
    where = "" if len(results.realizations) == 1 else f" in {counted(len(cut), 'realization')}"
    message = f"the drive ended before {' or '.join(names)} was reached{where}"
    if stops.displacement is None:
        return message
    largest = max((one.displacement for one in cut), key=abs)
    target = with_unit(stops.displacement, "m")
    return f"{message}: the slider was at {with_unit(largest, 'm')} of {target}"
