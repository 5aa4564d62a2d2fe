"""The command line."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mesoslip.errors import MesoslipError

if TYPE_CHECKING:
    from mesoslip.configuration.config import Config

INTERRUPTED = 130


class View(StrEnum):
    """Pictures of a run."""

    RUN = "run"
    AVALANCHES = "avalanches"
    LATTICE = "lattice"


app = typer.Typer(
    name="mesoslip",
    help="Stick-slip friction of a multicontact interface.",
    add_completion=False,
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)

ConfigArgument = Annotated[
    str, typer.Argument(help="TOML file, or an output to run again", metavar="CONFIG")
]
OutputArgument = Annotated[Path, typer.Argument(help="Output of mesoslip", metavar="OUT.nc")]
SetOption = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        help="Change one key, as in contacts.delay=1ms; may be repeated",
        metavar="KEY=VALUE",
    ),
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print JSON, with values in SI")]


def _version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        typer.echo(f"mesoslip {version('mesoslip')}")
        raise typer.Exit


@app.callback()
def _common(
    _: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version")
    ] = False,
) -> None:
    pass


@app.command()
def run(
    config: ConfigArgument,
    output: Annotated[
        Path | None,
        typer.Option(
            "-o", "--output", help="Output file; out/<stem>.nc by default", metavar="OUT.nc"
        ),
    ] = None,
    changes: SetOption = None,
    workers: Annotated[
        int | None,
        typer.Option(min=1, help="Realizations at the same time; as many as processors by default"),
    ] = None,
    quiet: Annotated[bool, typer.Option("--quiet", help="Show no progress")] = False,
) -> None:
    """Simulate, and write an output file."""
    from mesoslip import api
    from mesoslip.output import store
    from mesoslip.simulation.engine import ENDINGS

    checked = api.as_config(config, changes or ())
    path = output or Path("out") / f"{Path(config).stem}.nc"
    store.check_writable(path)
    with _progress(quiet) as progress:
        tree = api.run(checked, workers=workers, progress=progress)
    if tree.attrs["complete"] == "false":
        partial = path.with_name(f"{path.stem}.partial{path.suffix}")
        store.write(tree, partial)
        typer.echo(f"{tree.attrs['comment']}; what there is, is in {partial}", err=True)
        raise typer.Exit(INTERRUPTED)
    store.write(tree, path)
    if not quiet:
        found = f"{tree['slips'].sizes['slip']} slips"
        if "avalanche_count" in tree.data_vars:
            found = f"{int(tree.to_dataset()['avalanche_count'].sum())} avalanches, {found}"
        typer.echo(
            f"{path}: {tree.attrs['break_count']:.0f} breaks, {found}, "
            f"energy balance to {abs(tree.attrs['energy_residual']):.0e}, "
            f"{tree.attrs['wall_seconds']:.2f} s",
            err=True,
        )
        if tree.attrs["ending"] != ENDINGS[1]:
            typer.echo(f"{path}: the run ended as follows: {tree.attrs['ending']}", err=True)


@app.command()
def info(config: ConfigArgument, changes: SetOption = None, as_json: JsonOption = False) -> None:
    """Show derived quantities."""
    from mesoslip.configuration.config import Config
    from mesoslip.theory.derived import derived_quantities

    if Path(config).suffix == ".nc":
        from mesoslip.output import store

        checked = store.configuration(Path(config), changes or ())
    else:
        checked = Config.load(config, changes or ())
    quantities = derived_quantities(checked)
    if as_json:
        typer.echo(json.dumps({name: one.value for name, one in quantities.items()}, indent=2))
        return
    for name, one in quantities.items():
        _show(name, one.value, one.unit, one.meaning)


def _show(name: str, value: float | bool | None, unit: str, meaning: str) -> None:
    """A line for a quantity."""
    if isinstance(value, bool) or value is None:
        shown = {True: "yes", False: "no", None: "none"}[value]
    else:
        shown = f"{value:.6g}" + ("" if unit == "1" else f" {unit}")
    typer.echo(f"{name:22} {shown:20} {meaning}")


@app.command()
def curve(
    config: ConfigArgument,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="Write the curve to a file", metavar="OUT.nc"),
    ] = None,
    changes: SetOption = None,
    as_json: JsonOption = False,
) -> None:
    """Force curve of the master equation, and its elastic instability."""
    from mesoslip import api
    from mesoslip.output import store
    from mesoslip.theory.force_curve import SUMMARY, ForceCurve

    checked = api.as_config(config, changes or ())
    if output is not None:
        store.check_writable(output)
    _tell_without_interaction(checked)
    force_curve = ForceCurve(checked)
    if output is not None:
        store.write(force_curve.to_tree(), output)
    summary = force_curve.summary()
    if as_json:
        typer.echo(json.dumps(summary, indent=2))
    else:
        for name, value in summary.items():
            _show(name, value, *SUMMARY[name])
    if force_curve.error > checked.curve.tolerance:
        typer.echo(
            f"the force has {force_curve.digits} digits; more would take too much work, as its "
            "law is not smooth, or too narrow for this length (curve.length, curve.tolerance)",
            err=True,
        )


@app.command()
def onset(
    config: ConfigArgument,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="Write the solutions to a file", metavar="OUT.nc"),
    ] = None,
    changes: SetOption = None,
    as_json: JsonOption = False,
) -> None:
    """Onset of slip, contacts breaking one after another (S46) or a film melting at once (S47)."""
    from mesoslip import api
    from mesoslip.output import store
    from mesoslip.theory.slip_onset import SUMMARY

    checked = api.as_config(config, changes or ())
    if output is not None:
        store.check_writable(output)
    _tell_without_interaction(checked)
    tree = api.onset(checked)
    if output is not None:
        store.write(tree, output)
    summary = {name: tree.attrs[name] for name in SUMMARY if name in tree.attrs}
    summary["stable"] = tree.attrs["stable"] == "true"
    if as_json:
        typer.echo(json.dumps(summary, indent=2))
        return
    for name, value in summary.items():
        _show(name, value, *SUMMARY[name])
    typer.echo(tree.attrs["comment"])


def _tell_without_interaction(config: Config) -> None:
    """The master equation has no neighbours: say so to who asks for some."""
    if config.interaction is not None and config.interaction.strength > 0:
        typer.echo("this is without [interaction], which the master equation cannot have", err=True)


@app.command()
def slips(
    output: OutputArgument,
    table: Annotated[
        Path | None, typer.Option("--csv", help="Write the catalogue as a table", metavar="FILE")
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Show the catalogue of slips, with statistics."""
    from mesoslip.analysis import slips as catalogue
    from mesoslip.output import store

    tree = store.read_run(output)
    if table is not None:
        catalogue.write_csv(tree, table)
    rows, statistics = catalogue.rows(tree), catalogue.statistics(tree)
    if as_json:
        typer.echo(json.dumps({"slips": rows, "statistics": statistics}, indent=2))
        return
    typer.echo(
        "  realization    start s   duration ms   before uN   after uN   drop uN   peak um/s"
        "   breaks"
    )
    for row in rows:
        typer.echo(
            f"{row['realization']:13d} {row['start_time']:10.4f} "
            f"{1e3 * (row['end_time'] - row['start_time']):13.3f} "
            f"{1e6 * row['force_before']:11.4f} "
            f"{1e6 * row['force_after']:10.4f} {1e6 * row['force_drop']:9.4f} "
            f"{1e6 * row['peak_velocity']:11.4f} {row['contacts_broken']:8.0f}"
        )
    typer.echo(f"{len(rows)} slips")
    for name, values in statistics.items():
        if name != "slips":
            typer.echo(
                f"{name:16} mean {values['mean']:.5g}, standard deviation "
                f"{values['standard_deviation']:.2g}, from {values['minimum']:.5g} "
                f"to {values['maximum']:.5g}  (SI)"
            )


@app.command()
def avalanches(
    output: OutputArgument,
    table: Annotated[
        Path | None, typer.Option("--csv", help="Write the catalogue as a table", metavar="FILE")
    ] = None,
    as_json: JsonOption = False,
    smallest: Annotated[
        int | None,
        typer.Option(min=1, help="Least size for the fit; chosen by default", metavar="SIZE"),
    ] = None,
    after: Annotated[
        str, typer.Option(help="Only those after a time, such as '2 s'", metavar="TIME")
    ] = "0 s",
    force_above: Annotated[
        float | None,
        typer.Option(
            min=0,
            max=1,
            help="Only those before the greatest contact force, at more than this part of it",
            metavar="PART",
        ),
    ] = None,
) -> None:
    """Show sizes of avalanches: their distribution, and the law that fits it."""
    from mesoslip.analysis import avalanches as avalanche_catalogue
    from mesoslip.analysis.avalanche_statistics import ccdf, logarithmic_bins
    from mesoslip.output import store

    tree = store.read_run(output)
    start = _time(after, "--after")
    data = avalanche_catalogue.avalanches(tree, after=start, force_above=force_above)
    if table is not None:
        avalanche_catalogue.write_csv(data, table)
    statistics = avalanche_catalogue.statistics(
        tree, after=start, force_above=force_above, smallest=smallest
    )
    bins = logarithmic_bins(data["size"].values)
    columns = (bins.edges[:, 0] + 0.5, bins.edges[:, 1] - 0.5, bins.count)
    distribution = [
        {"from": int(low), "to": int(high), "count": int(count), "density": density, "error": error}
        for low, high, count, density, error in zip(
            *columns, bins.density.tolist(), bins.density_error.tolist(), strict=True
        )
    ]
    if as_json:
        sizes, part = ccdf(data["size"].values)
        cumulative = {"size": sizes.tolist(), "part_at_least": part.tolist()}
        answer = {"statistics": statistics, "distribution": distribution, "ccdf": cumulative}
        typer.echo(json.dumps(answer, indent=2))
        return
    typer.echo("       from         to      count        P(s)       error")
    for one in distribution:
        typer.echo(
            f"{one['from']:11d}{one['to']:11d}{one['count']:11d}{one['density']:12.4g}"
            f"{one['error']:12.2g}"
        )
    for name, value in statistics.items():
        _show(name, value, *avalanche_catalogue.SUMMARY[name])
    warning = avalanche_catalogue.warning(statistics)
    if warning is not None:
        typer.echo(f"warning: {warning}")


def _time(text: str, option: str) -> float:
    """A time given to an option [s]."""
    from mesoslip.configuration.units import to_si
    from mesoslip.errors import ConfigError, Problem

    try:
        return to_si(text, "s", "2 s")
    except ValueError as error:
        raise ConfigError([Problem("", option, str(error), text)]) from None


@app.command()
def plot(
    output: OutputArgument,
    figure: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            help="Picture; beside the output by default; a .gif shows the lattice in motion",
            metavar="FIG",
        ),
    ] = None,
    view: Annotated[
        View | None,
        typer.Option(
            help="Of a run: what happened, sizes of avalanches, contacts on their lattice"
        ),
    ] = None,
    snapshot: Annotated[
        int | None,
        typer.Option(
            min=0,
            help="Which snapshot of the lattice; that after the largest avalanche by default",
            metavar="NUMBER",
        ),
    ] = None,
) -> None:
    """Draw an output."""
    from mesoslip import api

    path = figure or output.with_suffix(".png")
    api.plot(output, path, view=view.value if view is not None else None, snapshot=snapshot)
    typer.echo(str(path), err=True)


@app.command()
def figures(
    names: Annotated[
        list[str] | None, typer.Argument(help="Such as S20; all by default", metavar="[NAME]...")
    ] = None,
    folder: Annotated[
        Path, typer.Option("-o", "--output", help="Folder of the pictures", metavar="DIR")
    ] = Path("out/figures"),
    outputs: Annotated[
        Path, typer.Option("--from", help="Folder of the outputs of the runs", metavar="DIR")
    ] = Path("out"),
) -> None:
    """Draw the figures of the source from the outputs of their runs."""
    from mesoslip.plots import source_figures

    for path in source_figures.draw(names or (), outputs, folder):
        typer.echo(str(path), err=True)


@contextmanager
def _progress(quiet: bool) -> Iterator[Callable[[float], None]]:
    """A progress bar on a terminal, otherwise a line for each tenth."""
    if quiet:
        yield lambda _: None
        return
    if not sys.stderr.isatty():
        yield _plain_progress()
        return
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        Progress,
        TaskProgressColumn,
        TextColumn,
        TimeRemainingColumn,
    )

    columns = (TextColumn("simulating"), BarColumn(), TaskProgressColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("", total=1.0)
        yield lambda part: bar.update(task, completed=part)


def _plain_progress() -> Callable[[float], None]:
    start = time.monotonic()
    told = 0

    def tell(part: float) -> None:
        nonlocal told
        passed = time.monotonic() - start
        # Runs that are over in a moment need no lines.
        if int(10 * part) > told and passed > 2:
            told = int(10 * part)
            left = passed * (1 - part) / part
            typer.echo(f"{10 * told} % after {passed:.0f} s, {left:.0f} s left", err=True)

    return tell


def main() -> None:
    """Run the command line and exit."""
    try:
        app()
    except MesoslipError as error:
        typer.echo(f"mesoslip: {error}", err=True)
        sys.exit(error.exit_status)
    except KeyboardInterrupt:
        sys.exit(INTERRUPTED)
