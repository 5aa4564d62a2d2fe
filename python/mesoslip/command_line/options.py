"""Arguments and options that commands share, and lines that they print."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from mesoslip.quantities import with_unit

if TYPE_CHECKING:
    from mesoslip.configuration.config import Config
    from mesoslip.execution.executors import ExecutorLike

ConfigArgument = Annotated[
    str, typer.Argument(help="TOML file, or an output to run again", metavar="CONFIG")
]
OutputArgument = Annotated[Path, typer.Argument(help="Output of mesoslip", metavar="OUT.nc")]
OutputsArgument = Annotated[
    list[Path], typer.Argument(help="Outputs of mesoslip", metavar="OUT.nc...")
]
SetOption = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        help="Change one key, as in contacts.delay=1ms; may be repeated",
        metavar="KEY=VALUE",
    ),
]
SchedulerOption = Annotated[
    str | None,
    typer.Option(
        "--scheduler",
        help="Dask scheduler whose workers do the computing, or its --scheduler-file",
        metavar="ADDRESS",
    ),
]
PoolOption = Annotated[
    str | None,
    typer.Option(
        "--pool",
        help="What computes: threads, processes, or both: threads at first, and processes if it "
        "takes long",
        metavar="POOL",
    ),
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print JSON, with values in SI")]


def load(config: str, changes: Iterable[str] | None) -> Config:
    """A configuration with changes; keys that a change of kind drops are named on stderr.

    Raises
    ------
    FileError, ConfigError
        If it cannot be read or is wrong.
    """
    from mesoslip.output.inputs import as_config

    checked = as_config(config, changes or ())
    if checked.dropped:
        kind = f'slider.kind = "{checked.slider.kind}"'
        typer.echo(f"dropped with {kind}: {', '.join(checked.dropped)}", err=True)
    return checked


def executor_of(
    workers: int | None, scheduler: str | None = None, pool: str | None = None
) -> ExecutorLike:
    """The executor that options ask for; the default of the command without any.

    Raises
    ------
    ConfigError
        If there is no such pool, or what options ask for is contradictory.
    """
    from mesoslip.errors import ConfigError, Problem
    from mesoslip.execution.executors import Dask, Processes, Threads, ThreadsThenProcesses

    pools = {"threads": Threads, "processes": Processes, "both": ThreadsThenProcesses}
    if pool is not None and pool not in pools:
        raise ConfigError([Problem("", "--pool", f"must be one of {', '.join(pools)}", pool)])
    if scheduler is not None:
        return Dask(scheduler)
    return workers if pool is None else pools[pool](workers)


def show(name: str, value: float | bool | None, unit: str, meaning: str) -> None:
    """A line for a quantity."""
    if isinstance(value, bool) or value is None:
        shown = {True: "yes", False: "no", None: "none"}[value]
    elif math.isnan(value):
        shown = "not known"
    else:
        shown = with_unit(value, unit, 6)
    typer.echo(f"{name:22} {shown:20} {meaning}")


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
    """A quantity given to an option, in SI.

    Raises
    ------
    ConfigError
        If it is not a quantity of the unit's dimension, or of a sign that the option refuses.
    """
    from mesoslip.configuration.units import to_si
    from mesoslip.errors import ConfigError, Problem

    try:
        value = to_si(_number_or_text(text), unit, example)
    except ValueError as error:
        raise ConfigError([Problem("", option, str(error), text)]) from None
    if positive and value <= 0:
        raise ConfigError([Problem("", option, "must be greater than 0", text)])
    if not negative and value < 0:
        raise ConfigError([Problem("", option, "must not be negative", text)])
    return value


def _number_or_text(text: str) -> float | str:
    """A plain number, which is in SI; or a string with a unit."""
    from mesoslip.configuration.units import number_of

    try:
        return number_of(text)
    except ValueError:
        return text


def quantity_or_none(
    text: str | None, option: str, unit: str, example: str, *, positive: bool = False
) -> float | None:
    """A quantity given to an option, in SI; None if the option is not given. See `quantity`."""
    return None if text is None else quantity(text, option, unit, example, positive=positive)


def time_of(text: str, option: str) -> float:
    """A time given to an option [s]."""
    return quantity(text, option, "s", "2 s")
