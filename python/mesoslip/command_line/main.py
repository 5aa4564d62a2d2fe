"""The command line: its commands, and the reporting of errors."""

from __future__ import annotations

import errno
import functools
import io
import os
import shlex
import sys
import warnings
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from mmap import mmap
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from mesoslip.array_packages import import_xarray
from mesoslip.command_line import (
    catalogues,
    cycle,
    example,
    explore,
    fit,
    lyapunov,
    mean_field,
    pictures,
    report,
    response,
    run,
    sweep,
    theory,
    trace,
)
from mesoslip.errors import MesoslipError
from mesoslip.memory_limit import RESERVE, is_memory_short, spare_memory
from mesoslip.output.provenance import COMMAND_LINE

# Commands in the order and the groups of the help.
GROUPS = {
    "Simulate": (run.run, explore.explore, example.example),
    "Measure": (
        trace.trace,
        catalogues.slips,
        catalogues.regime,
        catalogues.avalanches,
        catalogues.events,
        response.response,
        catalogues.strokes,
        catalogues.plateaus,
        catalogues.fronts,
    ),
    "Theory": (theory.info, theory.curve, theory.onset, cycle.cycle),
    "Many runs": (sweep.sweep, fit.fit, lyapunov.lyapunov, mean_field.mean_field),
    "Show": (pictures.plot, report.report, report.export),
}
COMMANDS = tuple(command for group in GROUPS.values() for command in group)

# Commands that import xarray only for outputs that need it.
WITHOUT_XARRAY = {
    run.run,
    theory.curve,
    theory.info,
    mean_field.mean_field,
    explore.explore,
    example.example,
    catalogues.slips,
    catalogues.regime,
    pictures.plot,
    report.report,
    response.response,
    catalogues.strokes,
    catalogues.plateaus,
    catalogues.fronts,
}

# How to install the libraries that the kernels are linked to.
LIBRARIES = "Debian, Ubuntu: apt-get install gfortran libsundials-dev"
NO_MEMORY = "mesoslip: there is not enough memory for this"
# Memory that every command takes at least [bytes], with the libraries that it imports.
NEEDED = 2**28
# How the system says that there is no memory for a library.
NOT_MAPPED = ("failed to map segment", "annot allocate memory")


def _version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        typer.echo(f"mesoslip {version('mesoslip')}")
        raise typer.Exit


def _common(
    _: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version")
    ] = False,
) -> None:
    pass


def _with_numpy_only(command: Callable[..., None]) -> Callable[..., None]:
    """A command with xarray imported without packages of other arrays."""

    @functools.wraps(command)
    def run(*arguments: Any, **options: Any) -> None:
        import_xarray()
        command(*arguments, **options)

    return run


class GroupedHelp(TyperGroup):
    """The command line, whose help lists its commands in groups and cuts no description."""

    def format_commands(self, ctx: Any, formatter: Any) -> None:  # noqa: ARG002
        width = max(map(len, self.commands))
        for title, group in GROUPS.items():
            names = [_name(one) for one in group]
            rows = [
                (name.ljust(width), self.commands[name].get_short_help_str(sys.maxsize))
                for name in names
                if name in self.commands
            ]
            if rows:
                with formatter.section(title):
                    formatter.write_dl(rows)


def _name(command: Callable[..., None]) -> str:
    """A command as it is typed."""
    return command.__name__.replace("_", "-")


def application(commands: Iterable[Callable[..., None]]) -> typer.Typer:
    """The command line with some of its commands."""
    made = typer.Typer(
        name="mesoslip",
        cls=GroupedHelp,
        help="Stick-slip friction of a multicontact interface.",
        add_completion=False,
        no_args_is_help=True,
        rich_markup_mode=None,
        pretty_exceptions_enable=False,
        context_settings={"help_option_names": ["-h", "--help"]},
    )
    made.callback()(_common)
    for command in commands:
        made.command(cls=pictures.PlotCommand if command is pictures.plot else None)(
            command if command in WITHOUT_XARRAY else _with_numpy_only(command)
        )
    return made


app = application(COMMANDS)


def _asked(arguments: Sequence[str]) -> typer.Typer:
    """The command line with only the command that is asked for, which is quicker to build."""
    named = [one for one in COMMANDS if _name(one) in arguments[:1]]
    return application(named) if named else app


def main() -> None:
    """Run the command line and exit."""
    _open_streams()
    if is_memory_short(NEEDED):
        typer.echo(NO_MEMORY, err=True)
        sys.exit(1)
    spare = spare_memory()
    # A character that no font has is drawn as a box.
    warnings.filterwarnings("ignore", r"Glyph \d+ .*missing from", UserWarning)
    typed = shlex.join(["mesoslip", *sys.argv[1:]])
    # Outputs contain the command line, and take UTF-8 only.
    token = COMMAND_LINE.set(typed.encode("utf-8", "backslashreplace").decode())
    status: object = 0
    try:
        _asked(sys.argv[1:])()
    except SystemExit as end:
        status = end.code
    except MesoslipError as error:
        typer.echo(f"mesoslip: {error}", err=True)
        status = error.exit_status
    except KeyboardInterrupt:
        status = run.INTERRUPTED
    except ImportError as error:
        # The kernels lack a shared library; other missing modules are bugs.
        if any(one in str(error) for one in NOT_MAPPED) or is_memory_short(RESERVE):
            status = _without_memory(spare)
        elif "shared object" in str(error) or "Library not loaded" in str(error):
            typer.echo(f"mesoslip: a library is missing: {error}; {LIBRARIES}", err=True)
            status = 1
        else:
            raise
    except MemoryError:
        status = _without_memory(spare)
    except OSError as error:
        is_memory = error.errno == errno.ENOMEM
        status = _without_memory(spare) if is_memory else _output_failed(error)
    except Exception:
        # Libraries that are imported without enough memory fail in ways of their own.
        if not is_memory_short(RESERVE):
            raise
        status = _without_memory(spare)
    finally:
        COMMAND_LINE.reset(token)
    try:
        sys.stdout.flush()
    except OSError as error:
        status = _output_failed(error)
    sys.exit(status)  # type: ignore[arg-type]


def _open_streams() -> None:
    """Open standard streams that are closed, and let stdout print all file names."""
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        if getattr(sys, name) is None:
            # The lowest free descriptor, which is used, is that of the stream.
            os.open(os.devnull, os.O_RDWR)
            setattr(sys, name, os.fdopen(number, "w" if number else "r", closefd=False))
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")


def _without_memory(spare: mmap | None) -> int:
    """Report that memory is short; the spare memory is freed first, for destructors."""
    if spare is not None:
        spare.close()
    typer.echo(NO_MEMORY, err=True)
    return 1


def _output_failed(error: OSError) -> int:
    """Report that stdout cannot be written, and discard the rest."""
    typer.echo(f"mesoslip: the output cannot be written: {error.strerror or error}", err=True)
    with suppress(OSError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    return 1
