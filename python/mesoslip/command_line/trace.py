"""``mesoslip trace``."""

from __future__ import annotations

import math
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mesoslip.command_line.options import SavedOption, counted
from mesoslip.command_line.progress import steps_shown

if TYPE_CHECKING:
    import xarray as xr


def _option(help_text: str, example: str, name: str | None = None) -> typer.models.OptionInfo:
    names = () if name is None else (name,)
    option: typer.models.OptionInfo = typer.Option(*names, help=help_text, metavar=f"'{example}'")
    return option


def trace(
    file: Annotated[
        Path,
        typer.Argument(
            help="File of the measurement, or an EXPERIMENT.toml that names it", metavar="FILE"
        ),
    ],
    output: SavedOption = None,
    config: Annotated[
        str | None,
        typer.Option(
            "--config",
            help="Configuration of a model of the experiment, which `fit` needs",
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
    decimal: Annotated[
        str | None, typer.Option(help="Decimal sign, if the file allows two", metavar="','")
    ] = None,
    sheet: Annotated[
        str | None,
        typer.Option(
            help="Sheet of a workbook; that with the most numbers by default", metavar="NAME"
        ),
    ] = None,
    rate: Annotated[str | None, _option("Sampling rate, if the file has no times", "1 kHz")] = None,
    velocity: Annotated[
        str | None, _option("Velocity of the drive, if no load point was recorded", "42 um/s")
    ] = None,
    stiffness: Annotated[
        str | None,
        _option("Spring constant; of friction coefficients as in '1.6e-3 1/um'", "1002 N/m"),
    ] = None,
    normal_force: Annotated[
        str | None, _option("Normal force; friction coefficients become forces", "301 mN")
    ] = None,
    normal_stress: Annotated[str | None, _option("Normal stress, with --area", "20 MPa")] = None,
    area: Annotated[str | None, _option("Area by which stresses become forces", "25 cm^2")] = None,
    start: Annotated[str | None, _option("Time from which samples are used", "100 s")] = None,
    end: Annotated[str | None, _option("Time until which samples are used", "160 s")] = None,
    hum: Annotated[str | None, _option("Frequency of a hum to take off", "50 Hz")] = None,
    trend: Annotated[
        str | None,
        typer.Option(
            help="Trend of the friction with displacement, for rates and states: none, linear",
            metavar="TREND",
        ),
    ] = None,
    noise: Annotated[
        str | None, _option("Standard deviation of the noise; estimated by default", "0.1 uN")
    ] = None,
    min_fall: Annotated[
        str | None, _option("Minimum fall of a slip; from the noise by default", "6 mN")
    ] = None,
    period: Annotated[str | None, _option("Period of the setup, if it is known", "25 ms")] = None,
    part: Annotated[
        int | None,
        typer.Option(
            min=1,
            help="Which part of a file whose clock restarts; the longest by default",
            metavar="NUMBER",
        ),
    ] = None,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Print what is understood, and write nothing")
    ] = False,
    verbose: Annotated[
        bool, typer.Option("--verbose", help="Print each sampling rate, with its noise")
    ] = False,
) -> None:
    """Read a measured trace as the laboratory wrote it, and write an output like that of a run."""
    from mesoslip.measured.trace import trace_of, understand
    from mesoslip.output import targets, writing

    is_packed = file.suffix in {".gz", ".bz2", ".xz", ".zip"}
    path = output or Path("out") / f"{Path(file.stem).stem if is_packed else file.stem}.nc"
    if not dry_run:
        targets.check_output(path, [file, *([] if config is None else [config])])
    began = time.monotonic()
    with steps_shown(began) as step:
        step("reading")
        understood = understand(
            file,
            config=config,
            headers=columns,
            decimal=decimal,
            sheet=sheet,
            rate=rate,
            velocity=velocity,
            stiffness=stiffness,
            normal_force=normal_force,
            normal_stress=normal_stress,
            area=area,
            start=start,
            end=end,
            hum=hum,
            trend=trend,
            noise=noise,
            period=period,
            part=part,
            min_fall=min_fall,
        )
        step("estimating the noise")
        report = understood.report if verbose else understood.summary
    for line in report:
        typer.echo(line)
    if dry_run:
        return
    targets.check_output(path, [understood.path])
    with steps_shown(began) as step:
        step("looking for slips")
        tree = trace_of(understood)
        step("writing")
        writing.write(tree, path)
    typer.echo(f"{path}: {', '.join(_summary(tree))}", err=True)
    if tree.attrs.get("comment"):
        typer.echo(f"{path}: {tree.attrs['comment']}", err=True)


def _summary(tree: xr.DataTree) -> list[str]:
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
