"""``mesoslip trace``."""

from __future__ import annotations

import math
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from mesoslip.command_line.options import SavedOption, counted, option, workers_option
from mesoslip.command_line.progress import progress_shown, say, steps_shown
from mesoslip.errors import ConfigError, FileError

if TYPE_CHECKING:
    from mesoslip.array_types import DataTree

# Maximum number of files whose errors are printed.
MAX_REPORTED = 5
# Options that do not describe the measurement.
NOT_DESCRIBING = {"files", "output", "batch", "workers", "dry_run", "verbose"}


def trace(
    files: Annotated[
        list[Path],
        typer.Argument(
            help="File of the measurement, or an EXPERIMENT.toml that names it; several files are "
            "parts of one test",
            metavar="FILE...",
        ),
    ],
    output: SavedOption = None,
    config: Annotated[
        str | None,
        option(
            "Configuration of a model of the experiment, which `fit` needs", "CONFIG", "--config"
        ),
    ] = None,
    columns: Annotated[
        str | None,
        option(
            "Headers that replace those of the file, such as 'time [s], force [uN], -'", "HEADERS"
        ),
    ] = None,
    decimal: Annotated[str | None, option("Decimal sign, if the file allows two", "','")] = None,
    dates: Annotated[
        str | None,
        option("Order of day, month, year in dates such as 04/03/2026: dmy, mdy, ymd", "ORDER"),
    ] = None,
    missing: Annotated[
        str | None,
        option(
            "Numbers that stand for missing ones, or none; those such as -9999 that lie far "
            "from all others by default",
            "NUMBERS",
        ),
    ] = None,
    sheet: Annotated[
        str | None, option("Sheet of a workbook; that with the most numbers by default", "NAME")
    ] = None,
    rate: Annotated[
        str | None,
        option(
            "Sampling rate, if the file has no times; else samples are thinned to it", "'1 kHz'"
        ),
    ] = None,
    velocity: Annotated[
        str | None,
        option(
            "Velocity of the drive, without a column of the load point or of times", "'42 um/s'"
        ),
    ] = None,
    stiffness: Annotated[
        str | None,
        option("Spring constant; of friction coefficients as in '1.6e-3 1/um'", "'1002 N/m'"),
    ] = None,
    radius: Annotated[
        str | None,
        option("Radius of the track: torques become forces, rotations speeds", "'30 mm'"),
    ] = None,
    viscosity: Annotated[
        str | None, option("Viscosity of a lubricant, for Stribeck curves", "'90 mPa*s'")
    ] = None,
    motion: Annotated[
        str | None,
        option(
            "Whether the drive goes back and forth: strokes, one-way; found by default", "MOTION"
        ),
    ] = None,
    force_direction: Annotated[
        str | None,
        option(
            "Direction of the force in strokes: along, against the motion; found by default",
            "DIRECTION",
        ),
    ] = None,
    normal_force: Annotated[
        str | None, option("Normal force; friction coefficients become forces", "'301 mN'")
    ] = None,
    normal_stress: Annotated[str | None, option("Normal stress, with --area", "'20 MPa'")] = None,
    area: Annotated[str | None, option("Area by which stresses become forces", "'25 cm^2'")] = None,
    start: Annotated[str | None, option("Time from which samples are used", "'100 s'")] = None,
    end: Annotated[str | None, option("Time until which samples are used", "'160 s'")] = None,
    hum: Annotated[str | None, option("Frequency of mains hum to remove", "'50 Hz'")] = None,
    trend: Annotated[
        str | None,
        option(
            "Trend of the friction with displacement, for rates and states: none, linear", "TREND"
        ),
    ] = None,
    noise: Annotated[
        str | None, option("Standard deviation of the noise; estimated by default", "'0.1 uN'")
    ] = None,
    min_fall: Annotated[
        str | None, option("Minimum fall of a slip; from the noise by default", "'6 mN'")
    ] = None,
    period: Annotated[str | None, option("Period of the setup, if it is known", "'25 ms'")] = None,
    part: Annotated[
        int | None,
        option(
            "Which part of a file whose clock restarts; the longest by default", "NUMBER", min=1
        ),
    ] = None,
    batch: Annotated[
        Path | None,
        option(
            "Read each file by itself, into a folder (-o; out by default), and write a table "
            "with a row for each; an EXPERIMENT.toml before the files describes all",
            "TABLE.csv",
            "--batch",
        ),
    ] = None,
    workers: Annotated[int | None, workers_option("files with --batch")] = None,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Print what is understood, and write nothing")
    ] = False,
    verbose: Annotated[
        bool, typer.Option("--verbose", help="Print each sampling rate, with its noise")
    ] = False,
) -> None:
    """Read a measured trace, and write it as an output.

    The file is read as the laboratory wrote it; the output is like that of a run.
    """
    options: dict[str, Any] = {k: one for k, one in locals().items() if k not in NOT_DESCRIBING}
    options["headers"] = options.pop("columns")
    from mesoslip.measured.batch import output_name
    from mesoslip.measured.trace import trace_of
    from mesoslip.measured.understanding import understand
    from mesoslip.output import targets, writing

    if batch is not None:
        raise typer.Exit(_read_each(files, output or Path("out"), batch, options, workers, dry_run))
    path = output or Path("out") / output_name(files[0])
    if not dry_run:
        targets.check_output(path, [*files, *([] if config is None else [config])])
    began = time.monotonic()
    with steps_shown(began) as step:
        step("reading")
        understood = understand(files, **options)
        step("estimating the noise")
        report = understood.report if verbose else understood.summary
    for line in report:
        typer.echo(line)
    if dry_run:
        return
    targets.check_output(path, understood.paths)
    with steps_shown(began) as step:
        step("looking for slips")
        tree = trace_of(understood)
        step("writing")
        writing.write(tree, path)
    typer.echo(f"{path}: {', '.join(_summary(tree))}", err=True)
    if tree.attrs.get("comment"):
        typer.echo(f"{path}: {tree.attrs['comment']}", err=True)


def _read_each(
    files: list[Path],
    folder: Path,
    table: Path,
    options: dict[str, Any],
    workers: int | None,
    dry_run: bool,
) -> int:
    """Read files with one description, and write their table; returns the exit status."""
    from mesoslip.execution.stop import stopped_by_signals
    from mesoslip.measured import batch
    from mesoslip.output import table_files, targets

    if dry_run:
        raise ConfigError.of("--dry-run", "prints one file; leave out --batch")
    description, measurements = batch.described(files)
    pieces = batch.pieces_of(measurements, folder, description, options)
    targets.check_writable(table, files)
    if folder == table or (folder.exists() and not folder.is_dir()):
        raise FileError(f"{folder}: is a file; outputs of a batch need the name of a folder (-o)")
    if not batch.may_be_replaced(table):
        raise FileError(
            f"{table}: exists, and is no table of a batch; --batch is followed by the name of the "
            "table, and then by the files"
        )
    with stopped_by_signals() as stop, progress_shown(False, "reading") as progress:
        rows = batch.read_pieces(pieces, stop, executor=workers, progress=progress)
    table_files.write_table(rows, batch.COLUMNS, table)
    failed = [one for one in rows if one.get("message")]
    for row in failed[:MAX_REPORTED]:
        say(row["message"])
    if len(failed) > MAX_REPORTED:
        say(f"{len(failed) - MAX_REPORTED} more could not be read: see the column message")
    missing = f", {len(pieces) - len(rows)} not read: stopped" if len(rows) < len(pieces) else ""
    say(f"{table}: {counted(len(rows) - len(failed), 'file')} read, {len(failed)} failed{missing}")
    return int(stop.exit_status if stop.is_set() else bool(failed))


def _summary(tree: DataTree) -> list[str]:
    """A short description of an output."""
    from mesoslip.quantities import with_unit

    time, known = tree.to_dataset()["time"].values, tree.attrs
    unit = "N" if "spring_force" in tree.data_vars else "1"
    report = [
        f"{time.size} samples",
        with_unit(time[-1] - time[0], "s", 6),
        f"noise {with_unit(known['noise'], unit, 3)}",
        counted(tree["slips"].sizes["slip"], "slip"),
    ]
    if math.isfinite(known["setup_period"]):
        period = with_unit(known["setup_period"], "s", 3)
        report.insert(3, f"period of the setup {period} ({known['setup_period_origin']})")
    return report
