"""``mesoslip cycle``: the settled cycle of the master equation, and its branches."""

from __future__ import annotations

import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mesoslip.command_line.options import (
    ConfigArgument,
    JsonOption,
    SetOption,
    load,
    print_json,
    show,
)

if TYPE_CHECKING:
    from mesoslip.cycles.cycle import Cycle

StartOption = Annotated[
    str | None,
    typer.Option(
        "--start",
        help="Where to start: relaxed, steady, uniform, or an output of this command; by default "
        "contacts.initial",
        metavar="START",
    ),
]

# Significant digits.
DIGITS = 5
# Meanings for a motion that is irregular.
IRREGULAR = {
    "period": ("s", "mean time between passages of the section"),
    "peak_force": ("N", "mean of the maxima of the spring force"),
    "low_force": ("N", "mean of the minima of the spring force"),
}


def cycle(
    config: ConfigArgument,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="Write the cycle to a file", metavar="OUT.nc"),
    ] = None,
    start: StartOption = None,
    changes: SetOption = None,
    as_json: JsonOption = False,
) -> None:
    """Compute the settled cycle of the master equation, and which motions are possible."""
    from mesoslip.cycles.cycle import cycle as settled_cycle
    from mesoslip.output import targets, writing

    checked = load(config, changes)
    if output is not None:
        targets.check_output(output, [config, *([] if start is None else [start])])
    if checked.interaction is not None and checked.interaction.strength > 0:
        typer.echo(
            "computed without [interaction]: the master equation has no neighbours", err=True
        )
    found = settled_cycle(checked, start=start)
    if output is not None:
        writing.write(found.to_tree(), output)
    if as_json:
        print_json(found.summary())
    else:
        _print(found)


def _print(found: Cycle) -> None:
    from mesoslip.cycles.cycle import SUMMARY

    summary = found.summary()
    show_motion = found.motion
    if found.motion == "periodic" and found.multiple > 1:
        show_motion = f"periodic, {found.multiple} passages of the section in a period"
    typer.echo(f"{'motion':22} {show_motion}")
    for name, usual in SUMMARY.items():
        value = summary[name]
        if value is None or (not found.exists and name != "smooth_stable"):
            continue
        if isinstance(value, float) and math.isnan(value):
            continue
        meaning = IRREGULAR.get(name, usual) if found.motion == "irregular" else usual
        show(name, value, *meaning, digits=DIGITS)
    typer.echo(found.verdict)
    counted = f"{found.cycles} passages computed, by {found.solver}"
    error = f"; relative error of period and peaks {found.error:.1g}" if found.error > 0 else ""
    typer.echo(f"{counted}{error}", err=not sys.stdout.isatty())
