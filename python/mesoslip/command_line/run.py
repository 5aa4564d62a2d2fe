"""``mesoslip run``."""

from __future__ import annotations

import math
import os
import threading
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from importlib import import_module
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
    from mesoslip.analysis.regime.result import RegimeResult
    from mesoslip.configuration.config import Config
    from mesoslip.simulation.checkpoint import Checkpoint
    from mesoslip.simulation.realization import Realization
    from mesoslip.simulation.run_realizations import Results

# Exit status after Ctrl-C.
INTERRUPTED = 130
# Expected size of an output that is reported before the run [bytes].
LARGE = 5e8
# Expected time of changes of the load that is reported before the run [s].
LONG = 60.0
# Rows of the trace that are read at once.
MAX_ROWS = 400_000
# Modules that are needed after a run only, and take long to import.
LATER = ("mesoslip.output.writing", "mesoslip.output.files", "mesoslip.analysis.regime.outputs")


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
    from mesoslip.output import targets
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

    if not quiet and _is_of_another(path, checked):
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
        regimes = _Regimes(checked)
        try:
            with _imported_meanwhile(), progress_shown(quiet) as progress:
                results = run_realizations(
                    checked,
                    executor=executor_of(workers, scheduler),
                    progress=progress,
                    stop=stop,
                    checkpoint=checkpoint,
                    evaluate=None if quiet or not regimes.are_wanted else regimes.take,
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
        from mesoslip.output import files, writing

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
            _report_results(results, regimes, path, stop)
        files.remove_partial(_partial(path))
        checkpoint.remove()


def _is_of_another(path: Path, config: Config) -> bool:
    """Whether the run will replace the output of another configuration."""
    if not os.path.lexists(path):
        return False
    from mesoslip.output import files

    return files.is_of_another(path, config)


def _import(names: Iterable[str]) -> None:
    # What fails is imported once more, and fails, where it is needed.
    with suppress(Exception):
        for one in names:
            import_module(one)


@contextmanager
def _imported_meanwhile() -> Iterator[None]:
    """Import what is needed after a run on a thread of its own, while kernels run."""
    thread = threading.Thread(target=_import, args=(LATER,), daemon=True)
    try:
        thread.start()
    # Without a thread they are imported when they are needed.
    except (MemoryError, RuntimeError):
        yield
        return
    try:
        yield
    finally:
        # A run may fail at once, and the program should not end in the middle of an import.
        thread.join()


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


def _report_results(results: Results, regimes: _Regimes, path: Path, stop: Stop) -> None:
    from mesoslip.output import layout
    from mesoslip.simulation.realization import ENDINGS

    config = results.config
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
        say(f"{path}: {regimes.summary(results, path, stop)}")
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


class _Regimes:
    """The regimes of the realizations of a run, each evaluated on the thread that has run it."""

    def __init__(self, config: Config) -> None:
        self._config = config
        self._found: dict[int, RegimeResult] = {}

    @property
    def are_wanted(self) -> bool:
        """Whether a regime is that of the motion: not of strokes, nor under a force."""
        return not self._config.drive.is_force and self._config.drive.cycle is None

    def take(self, one: Realization) -> None:
        """Evaluate a realization at its end."""
        from mesoslip.analysis.regime import outputs

        # What fails is evaluated once more, and fails, after the output is written.
        with suppress(Exception):
            self._found[one.number] = outputs.regime_of_realization(self._config, one)

    def summary(self, results: Results, path: Path, stop: Stop) -> str:
        """The regimes of all realizations, which may take longer than short runs; after an
        interrupt, or of strokes, the command that evaluates them."""
        from mesoslip.analysis.regime import outputs, result

        if self._config.drive.cycle is not None:
            return f"the drive goes back and forth; 'mesoslip strokes {path}' evaluates its strokes"
        count = len(results.realizations)
        with progress_shown(count == 1, "regimes") as progress:
            for number, one in enumerate(results.realizations, 1):
                if stop.is_set():
                    return f"complete; 'mesoslip regime {path}' prints the regime"
                if one.number not in self._found:
                    self._found[one.number] = outputs.regime_of_realization(self._config, one)
                if number % max(1, count // 100) == 0:
                    progress(number / count)
        return result.summary([self._found[one.number] for one in results.realizations])


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
