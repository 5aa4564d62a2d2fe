"""``mesoslip explore``."""

from __future__ import annotations

import shlex
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

import typer

from mesoslip.command_line.options import SetOption, load, option
from mesoslip.errors import FileError

EXAMPLE = "klein"
MISSING = (
    "the page needs Bokeh, which is not installed: python -m pip install "
    "'mesoslip[explore]', or python -m pip install bokeh"
)


def explore(
    config: Annotated[
        str | None,
        typer.Argument(
            help="TOML file or output to start from; the example klein by default", metavar="CONFIG"
        ),
    ] = None,
    changes: SetOption = None,
    trace: Annotated[
        Path | None,
        option("Measured trace, an output of mesoslip trace, to draw beside the model", "TRACE.nc"),
    ] = None,
    port: Annotated[
        int,
        option(
            "Port; if it is in use the next free one; 0: any free port", "PORT", min=0, max=65535
        ),
    ] = 5006,
    browser: Annotated[
        bool, typer.Option("--browser/--no-browser", help="Open the page in a browser")
    ] = True,
) -> None:
    """Open an interactive page with knobs and the motion.

    Ctrl-C ends the program.

    The page is served on the loopback address of this machine only, and loads nothing from
    elsewhere.
    """
    from mesoslip.examples import example

    if find_spec("bokeh") is None:
        raise FileError(MISSING)
    if config is None:
        from tempfile import TemporaryDirectory

        with TemporaryDirectory() as folder:
            path = Path(folder) / f"{EXAMPLE}.toml"
            example(EXAMPLE, path)
            start = load(str(path), changes)
        source = f"{EXAMPLE}.toml"
    else:
        start = load(config, changes)
        source = config
    from mesoslip.explorer.pictures import Measured
    from mesoslip.explorer.server import serve

    source = shlex.join([source, *(word for one in changes or () for word in ("--set", one))])
    measured = None if trace is None else Measured(trace)

    def report(address: str) -> None:
        typer.echo(f"mesoslip explore: {address} (Ctrl-C ends it)")

    with suppress(KeyboardInterrupt):
        serve(start, source, trace=measured, port=port, opens=browser, report=report)
