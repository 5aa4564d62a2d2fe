"""``mesoslip trace``."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

import typer

from mesoslip.command_line.options import quantity_or_none


def trace(
    table: Annotated[
        Path,
        typer.Argument(
            help="Table with units in its header, such as 'time [s], force [uN]'",
            metavar="FILE.csv",
        ),
    ],
    output: Annotated[
        Path | None,
        typer.Option(
            "-o", "--output", help="Output file; out/<stem>.nc by default", metavar="OUT.nc"
        ),
    ] = None,
    config: Annotated[
        str | None,
        typer.Option(
            "--config",
            help="Configuration of the experiment, which some commands need",
            metavar="CONFIG",
        ),
    ] = None,
    columns: Annotated[
        str | None,
        typer.Option(
            help="Headers that replace those of the file, such as 'time [s], force [uN], -'",
            metavar="HEADERS",
        ),
    ] = None,
    rate: Annotated[
        str | None, typer.Option(help="Sampling rate, if the table has no times", metavar="1 kHz")
    ] = None,
    velocity: Annotated[
        str | None, typer.Option(help="Velocity of the drive", metavar="'0.1 um/s'")
    ] = None,
    stiffness: Annotated[
        str | None, typer.Option(help="Spring constant", metavar="'97 N/m'")
    ] = None,
    noise: Annotated[
        str | None,
        typer.Option(
            help="Standard deviation of the noise; estimated by default", metavar="'0.1 uN'"
        ),
    ] = None,
    period: Annotated[
        str | None,
        typer.Option(
            help="Period of the setup; by default from --config, or estimated", metavar="'25 ms'"
        ),
    ] = None,
    max_gap: Annotated[
        str | None,
        typer.Option(
            help="Maximum duration of gaps that are filled by straight lines", metavar="'10 ms'"
        ),
    ] = None,
) -> None:
    """Read a measured trace, find its slips, and write an output like that of a run."""
    from mesoslip.measured.trace import read_trace
    from mesoslip.output import targets, writing
    from mesoslip.quantities import with_unit

    path = output or Path("out") / f"{table.stem}.nc"
    targets.check_output(path, [table, *([] if config is None else [config])])
    tree = read_trace(
        table,
        columns=columns,
        rate=quantity_or_none(rate, "--rate", "1/s", "1 kHz", positive=True),
        max_gap=quantity_or_none(max_gap, "--max-gap", "s", "10 ms", positive=True),
        drive_velocity=quantity_or_none(velocity, "--velocity", "m/s", "0.1 um/s"),
        stiffness=quantity_or_none(stiffness, "--stiffness", "N/m", "97 N/m", positive=True),
        config=config,
        noise=quantity_or_none(noise, "--noise", "N", "0.1 uN"),
        period=quantity_or_none(period, "--period", "s", "25 ms", positive=True),
    )
    writing.write(tree, path)
    time, known = tree.to_dataset()["time"].values, tree.attrs
    report = [
        f"{time.size} samples",
        with_unit(time[-1] - time[0], "s", 6),
        f"noise {with_unit(known['noise'], 'N', 3)}",
        f"{tree['slips'].sizes['slip']} slips",
    ]
    if math.isfinite(known["setup_period"]):
        period = with_unit(known["setup_period"], "s", 3)
        report.insert(3, f"period of the setup {period} ({known['setup_period_origin']})")
    typer.echo(f"{path}: {', '.join(report)}", err=True)
    if known["comment"]:
        typer.echo(f"{path}: {known['comment']}", err=True)
