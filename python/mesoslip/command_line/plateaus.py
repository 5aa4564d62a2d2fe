"""``mesoslip plateaus``."""

from __future__ import annotations

from functools import partial
from typing import Annotated

import typer

from mesoslip.command_line.options import (
    JsonOption,
    LatexOption,
    OutputArgument,
    TableOption,
    quantity_or_none,
    show_catalogue,
)


def plateaus(
    output: OutputArgument,
    table: TableOption = None,
    as_json: JsonOption = False,
    as_latex: LatexOption = False,
    signal: Annotated[
        str | None,
        typer.Option(
            help="Signal whose steps cut the record: speed, load or force; by default speed and "
            "load where they have steps",
            metavar="SIGNAL",
        ),
    ] = None,
    viscosity: Annotated[
        str | None,
        typer.Option(
            help="Viscosity of the lubricant, such as '90 mPa*s', for a Stribeck curve",
            metavar="VISCOSITY",
        ),
    ] = None,
) -> None:
    """Print the friction of each plateau of a record.

    Plateaus lie between steps of speed, load or force.
    """
    from mesoslip.analysis import plateaus as analysis

    analysis.check_signal("--signal", signal)
    lubricant = quantity_or_none(viscosity, "--viscosity", "Pa*s", "90 mPa*s", positive=True)
    find = partial(analysis.plateaus_of, signal=signal, viscosity=lubricant, name=str(output))
    show_catalogue(output, find, table, as_json=as_json, as_latex=as_latex)
