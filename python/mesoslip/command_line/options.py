"""Arguments and options that commands share, and the lines and tables that they print."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, NamedTuple, Protocol, TypeVar

import typer

from mesoslip.errors import ConfigError, WriteError

if TYPE_CHECKING:
    from mesoslip.configuration.config import Config
    from mesoslip.execution.executors import ExecutorLike
    from mesoslip.execution.stop import Stop
    from mesoslip.output.arrays import Tree
    from mesoslip.output.table_files import PrintedTable


class Catalogue(Protocol):
    """A catalogue of an output: tables for print, and notes on them."""

    @property
    def tables(self) -> Sequence[PrintedTable]: ...

    @property
    def notes(self) -> Sequence[str]: ...

    def write_csv(self, path: Path) -> None: ...

    def to_json(self) -> dict[str, Any]: ...


Found = TypeVar("Found", bound=Catalogue)


class Work(NamedTuple):
    """Work that reports its progress, and that a signal stops."""

    progress: Callable[[float], None]
    stop: Stop


def option(
    help_text: str, metavar: str | None, *names: str, **limits: Any
) -> typer.models.OptionInfo:
    """An option with a value, which the metavar stands for."""
    made: typer.models.OptionInfo = typer.Option(*names, help=help_text, metavar=metavar, **limits)
    return made


def format_option(name: str, help_text: str) -> typer.models.OptionInfo:
    """A flag that has a command print another format; only one may be given."""
    made: typer.models.OptionInfo = typer.Option(name, help=help_text, callback=_only_format)
    return made


def _only_format(context: typer.Context, parameter: typer.CallbackParam, is_given: bool) -> bool:
    """Refuse a second format, whose order on the command line does not matter."""
    if is_given:
        name = parameter.opts[0]
        first = context.meta.setdefault("format", name)
        if first != name:
            raise ConfigError.of(name, f"does not go with {first}: give one format")
    return is_given


def output_option(help_text: str, metavar: str = "OUT.nc") -> typer.models.OptionInfo:
    """The option of the file that a command writes."""
    return option(help_text, metavar, "-o", "--output")


def workers_option(parallel: str) -> typer.models.OptionInfo:
    """The option of a number of workers, with the name of what they do at the same time."""
    return option(f"Parallel {parallel}; the number of processors by default", None, min=1)


ConfigArgument = Annotated[
    str, typer.Argument(help="TOML file, or an output to repeat", metavar="CONFIG")
]
OutputArgument = Annotated[Path, typer.Argument(help="Output of mesoslip", metavar="OUT.nc")]
OutputsArgument = Annotated[
    list[Path], typer.Argument(help="Outputs of mesoslip", metavar="OUT.nc...")
]
SavedOption = Annotated[Path | None, output_option("Output file; out/<stem>.nc by default")]
RevolutionOption = Annotated[
    str | None,
    option("Time of a revolution of a disc, such as '0.92 s', or auto", "TIME", "--period"),
]
SetOption = Annotated[
    list[str] | None,
    option(
        "Set a key, as in contacts.delay=1ms; KEY=none removes it; may be repeated",
        "KEY=VALUE",
        "--set",
    ),
]
SchedulerOption = Annotated[
    str | None,
    option(
        "Address or scheduler file of a Dask scheduler, whose workers compute",
        "ADDRESS",
        "--scheduler",
    ),
]
PoolOption = Annotated[
    str | None,
    option(
        "Workers: threads, processes, or both (default): threads at first, processes if the "
        "sweep takes long",
        "POOL",
        "--pool",
    ),
]
TableOption = Annotated[
    Path | None,
    option(
        "Write the table to a file: .md for Markdown, .tex for LaTeX with booktabs, otherwise "
        "comma-separated values in SI units",
        "FILE",
        "--table",
        "--csv",
    ),
]
JsonOption = Annotated[bool, format_option("--json", "Print JSON, in SI units")]
LatexOption = Annotated[bool, format_option("--latex", "Print a LaTeX table")]
# Rows of a table that are printed.
MAX_ROWS = 20
QuietOption = Annotated[bool, typer.Option("--quiet", help="Print no progress")]


def load(config: str, changes: Iterable[str] | None) -> Config:
    """A configuration with changes. Keys that its kind of slider drops are reported on stderr."""
    from mesoslip.output.inputs import as_config

    checked = as_config(config, changes or ())
    if checked.dropped:
        kind = f'slider.kind = "{checked.slider.kind}"'
        typer.echo(f"not used with {kind}: {', '.join(checked.dropped)}", err=True)
    return checked


def executor_of(
    workers: int | None, scheduler: str | None = None, pool: str | None = None
) -> ExecutorLike:
    """The executor that options name; without them the default of the command."""
    from mesoslip.configuration.arguments import check_choice
    from mesoslip.execution.executors import Dask, Processes, Threads, ThreadsThenProcesses

    pools = {"threads": Threads, "processes": Processes, "both": ThreadsThenProcesses}
    check_choice("--pool", pool, pools)
    if scheduler is not None:
        return Dask(scheduler)
    return workers if pool is None else pools[pool](workers)


def show(
    name: str,
    value: float | bool | None,
    unit: str,
    meaning: str,
    error: float | bool | None = None,
    digits: int = 6,
) -> None:
    """Print a quantity in SI in a suitable unit, with its error or a number of digits."""
    from mesoslip.quantities import with_error, with_unit

    if isinstance(value, bool) or value is None:
        shown = {True: "yes", False: "no", None: "none"}[value]
    elif math.isnan(value):
        shown = "unknown"
    elif error:
        shown = with_error(value, error, unit, digits)
    else:
        shown = with_unit(value, unit, digits)
    typer.echo(f"{name:22} {shown:20} {meaning}")


def show_all(
    values: Mapping[str, float | bool | None], meanings: Mapping[str, tuple[str, str]]
) -> None:
    """Print quantities in SI by name, with their units and meanings; the error of ``name`` is
    ``name_error``."""
    for name, value in values.items():
        if name.removesuffix("_error") != name and name.removesuffix("_error") in values:
            continue
        show(name, value, *meanings[name], values.get(f"{name}_error"))


def print_table(rows: Sequence[Sequence[str]], notes: Sequence[str] = ()) -> None:
    """Print rows of cells, right-aligned, with the note on a row below it."""
    widths = [max(map(len, cells)) for cells in zip(*rows, strict=True)]
    for row, note in zip(rows, notes or [""] * len(rows), strict=True):
        line = "  ".join(cell.rjust(width) for cell, width in zip(row, widths, strict=True))
        typer.echo(line)
        if note:
            typer.echo(f"{'':{len(line)}}{note}")


def print_tables(tables: Sequence[PrintedTable]) -> None:
    """Print tables with their titles, each up to a maximum number of rows."""
    for one in tables:
        typer.echo(f"\n{one.title}")
        print_table((one.head, *one.rows[:MAX_ROWS]))
        if len(one.rows) > MAX_ROWS:
            typer.echo(f"the first {MAX_ROWS} of {len(one.rows)}; all with --csv FILE")


def write_table(
    file: Path | None,
    printed: Callable[[], Sequence[PrintedTable]],
    write_csv: Callable[[Path], None],
) -> None:
    """Write tables to the file of a `TableOption`, as its ending says."""
    from mesoslip.output.table_files import is_printed, write_printed

    if file is not None and is_printed(file):
        write_printed(printed(), file)
    elif file is not None:
        write_csv(file)


def show_catalogue(
    output: Path,
    find: Callable[[Tree], Found],
    table: Path | None,
    *,
    as_json: bool,
    as_latex: bool,
    latex_table: int = 0,
) -> Found:
    """Print a catalogue of an output, and write it to the file of a `TableOption`."""
    from mesoslip.output import files, targets
    from mesoslip.output.table_files import latex

    targets.check_writable(table, [output])
    with files.opened_arrays(output) as tree:
        found = find(tree)
    write_table(table, lambda: found.tables, found.write_csv)
    if as_json:
        print_json(found.to_json())
    elif as_latex:
        typer.echo(latex(found.tables[latex_table]))
    else:
        for note in found.notes:
            typer.echo(note)
        print_tables(found.tables)
    return found


@contextmanager
def interruptible(
    path: Path, quiet: bool, hint: str = "", what: str = "simulating"
) -> Iterator[Work]:
    """Work on a file that a signal stops, with a message and the exit status of the signal."""
    from mesoslip.command_line.progress import progress_shown, say
    from mesoslip.execution.stop import StoppedError, stopped_by_signals

    with stopped_by_signals() as stop:
        try:
            with progress_shown(quiet, what) as progress:
                yield Work(progress, stop)
        except StoppedError:
            say(f"{path}: interrupted{hint}")
            raise typer.Exit(stop.exit_status) from None


@contextmanager
def stored_on_full_disk(store: Path, noun: str) -> Iterator[None]:
    """Add to the error of a full disk how many pieces of the work a store has."""
    from mesoslip.execution.store import Pieces

    try:
        yield
    except WriteError as error:
        kept = len(Pieces(store).names())
        if not kept:
            raise
        stored = f"{counted(kept, noun)} {'is' if kept == 1 else 'are'} stored"
        raise WriteError(f"{error}; {stored}: the same command continues") from error


def counted(count: float, noun: str) -> str:
    """A number of things: "1 slip", "2 slips"."""
    return f"{count:.0f} {noun}{'s' if count != 1 else ''}"


def print_json(value: object) -> None:
    """Print JSON, which has no numbers that are not finite: they are null."""
    typer.echo(json.dumps(_finite(value), indent=2, allow_nan=False))


def _finite(value: Any) -> Any:
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {name: _finite(one) for name, one in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(one) for one in value]
    return value


def quantity(
    text: str,
    option: str,
    unit: str,
    example: str,
    *,
    positive: bool = False,
    negative: bool = True,
) -> float:
    """The value of an option that is a quantity, in SI."""
    from mesoslip.configuration.units import text_to_si

    try:
        value = text_to_si(text, unit, example)
    except ValueError as error:
        raise ConfigError.of(option, str(error), text) from None
    if positive and value <= 0:
        raise ConfigError.of(option, "must be greater than 0", text)
    if not negative and value < 0:
        raise ConfigError.of(option, "must not be negative", text)
    return value


def positive_or_none(text: str | None, option: str, unit: str, example: str) -> float | None:
    """The value of an option that is a quantity above 0, in SI; None without it."""
    return None if text is None else quantity(text, option, unit, example, positive=True)


def revolution_of(text: str | None) -> float | Literal["auto"] | None:
    """The time of a revolution [s], or "auto"; None without it."""
    return "auto" if text == "auto" else positive_or_none(text, "--period", "s", "0.92 s")


def share(text: str, option: str) -> float:
    """The value of an option that is a share of a whole, such as "80%" or 0.8."""

    number, mark, rest = text.strip().partition("%")
    try:
        value = float(number) / (100 if mark else 1)
    except ValueError:
        value = -1.0
    if rest or not 0 < value <= 1:
        raise ConfigError.of(option, "must be a share above 0 and up to 100 %, such as '80%'", text)
    return value


def time_of(text: str, option: str) -> float:
    """The value of an option that is a time [s]."""
    return quantity(text, option, "s", "2 s")


def print_caveat(config: Config) -> None:
    """Print what theory leaves out of the contacts and the slider of a configuration."""
    from mesoslip.theory.contacts import contact_theory

    for caveat in (contact_theory(config).caveat, config.slider.caveat):
        if caveat:
            typer.echo(caveat, err=True)
