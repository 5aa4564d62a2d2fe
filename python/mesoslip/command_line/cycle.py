"""``mesoslip cycle``: the settled cycle of the master equation, and its branches."""

from __future__ import annotations

import math
import re
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mesoslip.command_line.options import (
    ConfigArgument,
    JsonOption,
    QuietOption,
    SetOption,
    load,
    option,
    output_option,
    print_caveat,
    print_json,
    print_table,
    quantity,
    show,
)
from mesoslip.command_line.progress import progress_shown

if TYPE_CHECKING:
    from mesoslip.array_types import Dataset
    from mesoslip.configuration.config import Config
    from mesoslip.cycles.cycle_result import Cycle

# Significant digits.
DIGITS = 5
# Maximum number of values of a key; each takes seconds.
MAX_POINTS = 10_000
# Meanings for a motion that is irregular.
IRREGULAR = {
    "period": ("s", "mean time between passages of the section"),
    "peak_force": ("N", "mean of the maxima of the spring force"),
    "low_force": ("N", "mean of the minima of the spring force"),
}


def cycle(
    config: ConfigArgument,
    output: Annotated[Path | None, output_option("Write the cycle to a file")] = None,
    start: Annotated[
        str | None,
        option(
            "Where to start: relaxed, steady, uniform, or an output of this command; by "
            "default contacts.initial",
            "START",
        ),
    ] = None,
    continued: Annotated[
        str | None,
        option(
            "Follow the motion over a key, up and down: KEY=FROM:TO:POINTS, logarithmically "
            "spaced, such as drive.velocity=0.1um/s:10um/s:20",
            "KEY=FROM:TO:POINTS",
            "--continue",
        ),
    ] = None,
    changes: SetOption = None,
    as_json: JsonOption = False,
    quiet: QuietOption = False,
) -> None:
    """Compute the settled cycle of the master equation.

    The result says which motions are possible, and whether they are stable.
    """
    from mesoslip.cycles.cycle import cycle as settled_cycle
    from mesoslip.output import targets, writing

    checked = load(config, changes)
    targets.check_output(output, [config, *([] if start is None else [start])])
    print_caveat(checked)
    if continued is not None:
        _follow(checked, continued, start, output, as_json=as_json, quiet=quiet)
        return
    with progress_shown(quiet) as progress:
        found = settled_cycle(checked, start=start, progress=progress)
    if output is not None:
        writing.write(found.to_tree(), output)
    if as_json:
        print_json(found.summary())
    else:
        _print(found)


def _follow(
    config: Config, text: str, start: str | None, output: Path | None, *, as_json: bool, quiet: bool
) -> None:
    """Follow the motion over a key, and write and print its branches."""
    import xarray as xr

    from mesoslip.cycles.branch import branches
    from mesoslip.cycles.cycle import started
    from mesoslip.output import writing

    if start is not None:
        config = started(config, start)
    key, values = _values(text)
    with progress_shown(quiet) as progress:
        data = branches(config, key, values, progress=progress)
    if output is not None:
        writing.write(xr.DataTree(data), output)
    if as_json:
        print_json({str(name): data[name].values.tolist() for name in data.variables})
        return
    _print_branches(data, key)


def _values(text: str) -> tuple[str, list[float]]:
    """Key and values of an option KEY=FROM:TO:POINTS."""
    import numpy as np

    from mesoslip.configuration.keys import key_kind, nearest_keys
    from mesoslip.errors import ConfigError

    key, _, span = text.partition("=")
    parts = span.split(":")
    kind = key_kind(key)
    points = int(parts[2]) if re.fullmatch("[0-9]{1,18}", parts[-1]) and len(parts) == 3 else 0
    message = "must be KEY=FROM:TO:POINTS, such as drive.velocity=0.1um/s:10um/s:20"
    if kind is None and span:
        near = nearest_keys(key)
        message = "has an unknown key" + (f"; did you mean {near[0]!r}?" if near else "")
    elif points > MAX_POINTS:
        message = f"has too many points; the maximum is {MAX_POINTS}"
    if kind is None or not 2 <= points <= MAX_POINTS:
        raise ConfigError.of("--continue", message, text)
    low, high = (
        quantity(part, "--continue", kind.unit or "1", kind.example, positive=True)
        for part in parts[:2]
    )
    return key, np.geomspace(low, high, points).tolist()


def _print_branches(data: Dataset, key: str) -> None:
    """Print a line for each value: motion and amplitude, up and down."""
    from mesoslip.configuration.units import from_cf_units
    from mesoslip.quantities import with_unit

    words = str(data["motion"].attrs["flag_meanings"]).split()
    rows: list[list[str]] = [[key, "smooth sliding", "up", "A/F_s", "down", "A/F_s"]]
    unit = from_cf_units(str(data[key].attrs["units"]))
    for at, value in enumerate(data[key].values):
        growth = float(data["growth_rate"].values[at])
        stable = "unknown" if math.isnan(growth) else "unstable" if growth > 0 else "stable"
        row = [with_unit(float(value), unit, 3), stable]
        for direction in range(2):
            row += [
                words[int(data["motion"].values[direction, at])],
                f"{float(data['amplitude_ratio'].values[direction, at]):.3g}",
            ]
        rows.append(row)
    print_table(rows)
    for end in range(data.sizes.get("end", 0)):
        one = data.isel(end=end)
        between = " and ".join(
            with_unit(value, unit, 4)
            for value in sorted((one["end_value"].item(), one["end_beyond"].item()))
        )
        typer.echo(
            f"{('up', 'down')[one['end_direction'].item()]}: the {words[one['end_motion'].item()]} "
            f"motion, of {100 * one['end_amplitude_ratio'].item():.3g} % of F_s, ends in smooth "
            f"sliding between {between}"
        )


def _print(found: Cycle) -> None:
    from mesoslip.cycles.cycle_result import SUMMARY

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
    work = f"{found.cycles} passages computed, by {found.solver}"
    error = f"; relative error of period and peaks {found.error:.1g}" if found.error > 0 else ""
    typer.echo(f"{work}{error}", err=not sys.stdout.isatty())
