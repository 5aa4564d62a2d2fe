"""The command line: its commands, and what becomes of errors."""

from __future__ import annotations

import sys
from typing import Annotated

import typer

from mesoslip.command_line import catalogues, pictures, run, theory
from mesoslip.errors import MesoslipError

COMMANDS = (
    run.run,
    theory.info,
    theory.curve,
    theory.onset,
    catalogues.slips,
    catalogues.avalanches,
    pictures.plot,
    pictures.figures,
)

app = typer.Typer(
    name="mesoslip",
    help="Stick-slip friction of a multicontact interface.",
    add_completion=False,
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)


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


for _command in COMMANDS:
    app.command()(_command)


def main() -> None:
    """Run the command line and exit."""
    try:
        app()
    except MesoslipError as error:
        typer.echo(f"mesoslip: {error}", err=True)
        sys.exit(error.exit_status)
    except KeyboardInterrupt:
        sys.exit(run.INTERRUPTED)
