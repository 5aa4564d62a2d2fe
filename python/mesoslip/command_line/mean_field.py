"""``mesoslip mean-field``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from mesoslip.command_line.options import (
    ConfigArgument,
    JsonOption,
    SetOption,
    load,
    output_option,
    print_json,
    show,
)
from mesoslip.command_line.progress import progress_shown


def mean_field(
    config: ConfigArgument,
    output: Annotated[
        Path | None,
        output_option(
            "Write a configuration of the master equation, and its table beside it as CSV",
            "OUT.toml",
        ),
    ] = None,
    first: Annotated[
        bool,
        typer.Option("--first", help="Tables of the first loading, not of steady sliding"),
    ] = False,
    changes: SetOption = None,
    as_json: JsonOption = False,
) -> None:
    """Measure the mean field of a lattice, for the master equation.

    It is given by the stretches at which contacts break and attach.
    """
    from mesoslip.campaign.mean_field import FIRST, STEADY
    from mesoslip.campaign.mean_field import mean_field as measure
    from mesoslip.errors import FileError

    checked = load(config, changes)
    if output is not None and output.resolve() == Path(config).resolve():
        raise FileError(f"{output}: is read by the command; give another name")
    with progress_shown(quiet=False) as progress:
        field = measure(checked, progress=progress)
    written = () if output is None else field.write(output, FIRST if first else STEADY)
    if as_json:
        print_json({name: value for name, (value, *_) in field.summary.items()})
        return
    for name, (value, unit, meaning) in field.summary.items():
        show(name, value, unit, meaning, digits=4)
    for path in written:
        typer.echo(str(path), err=True)
