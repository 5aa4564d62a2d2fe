"""``mesoslip events``."""

from __future__ import annotations

from functools import partial
from typing import Annotated

import typer

from mesoslip.command_line.options import (
    JsonOption,
    LatexOption,
    OutputArgument,
    TableOption,
    show_catalogue,
)


def events(
    output: OutputArgument,
    table: TableOption = None,
    as_json: JsonOption = False,
    as_latex: LatexOption = False,
    catalogue: Annotated[
        str | None,
        typer.Option(
            "--of",
            help="Catalogue: slips, avalanches, or channel, the last of these by default",
            metavar="CATALOGUE",
        ),
    ] = None,
    threshold: Annotated[
        float | None,
        typer.Option(
            min=0,
            help="Minimum amplitude of an event of the channel; from its noise by default",
            metavar="NUMBER",
        ),
    ] = None,
    completeness: Annotated[
        float | None,
        typer.Option(help="Minimum log10(size) of the b-value; found by default", metavar="NUMBER"),
    ] = None,
    main_size: Annotated[
        float | None,
        typer.Option(
            min=0, help="Minimum size of main events; the largest 5 % by default", metavar="SIZE"
        ),
    ] = None,
) -> None:
    """Print b-value and Omori decay of events, and acoustic emission.

    Acoustic emission is compared with the slips of a trace.
    """
    from mesoslip.analysis import events as analysis

    analysis.check_catalogue("--of", catalogue)
    find = partial(
        analysis.events_of,
        catalogue=catalogue,
        threshold=threshold,
        completeness=completeness,
        main_size=main_size,
        name=str(output),
    )
    show_catalogue(output, find, table, as_json=as_json, as_latex=as_latex)
