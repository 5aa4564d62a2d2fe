"""The origin of an output: attributes after CF and ACDD."""

from __future__ import annotations

import platform
from contextvars import ContextVar
from datetime import UTC, datetime
from functools import cache
from importlib import metadata
from typing import Any, Protocol

from mesoslip import _build

# The command as typed, if an output is made by the command line.
COMMAND_LINE: ContextVar[str | None] = ContextVar("COMMAND_LINE", default=None)

# Contents of the output of each command.
SUMMARIES = {
    "run": "A slider pulled over contacts with random breaking thresholds, simulated with the "
    "earthquake-like model of multicontact friction or its master equation",
    "curve": "Force of infinitely many contacts with random breaking thresholds under a slider "
    "that moves forward slowly, from the master equation of multicontact friction",
    "steady": "Steady sliding of infinitely many contacts that age or break by thermal activation, "
    "over velocity, and its linear stability",
    "onset": "Onset of the slip of a slider on contacts with random breaking thresholds, for "
    "contacts that break one after another and for a film that melts at once",
    "cycle": "The motion that a slider on infinitely many contacts settles to, from the master "
    "equation of multicontact friction",
    "lyapunov": "Largest Lyapunov exponent of a slider pulled over contacts with random breaking "
    "thresholds, from runs that start a small distance apart",
    "branches": "Motions that a slider on infinitely many contacts settles to, followed over a "
    "parameter up and down, from the master equation of multicontact friction",
    "sweep": "Measures of runs of a slider pulled over contacts with random breaking thresholds, "
    "over a range of parameters",
    "trace": "A measured trace of the spring force of a slider, with the slips found in it",
    "rates": "Rate-and-state parameters of friction with their uncertainty, from a record of the "
    "force under a drive with steps or holds",
    "fit": "Parameters of the earthquake-like model of multicontact friction with their "
    "uncertainty, from a trace of the spring force",
}


class Described(Protocol):
    """The configuration of a run, or the description of a measured trace."""

    @property
    def title(self) -> str | None: ...

    @property
    def base(self) -> Described | None: ...

    def to_toml(self) -> str: ...


@cache
def version(package: str) -> str:
    """Version of a package; cached, as a sweep needs it a thousand times."""
    return metadata.version(package)


def program_attributes(config: Described, command: str) -> dict[str, Any]:
    """Attributes of every output: configuration, command and program."""
    # Imported here, as the command line imports this module and must start fast.
    from mesoslip import _core

    now = datetime.now(UTC).isoformat(timespec="seconds")
    program = f"mesoslip {version('mesoslip')}"
    sundials = _core.sundials().decode().strip()
    asked = COMMAND_LINE.get() or f"mesoslip.{command} in Python"
    base = config.base
    return {
        "Conventions": "CF-1.11, ACDD-1.3",
        "title": config.title or "Friction of a multicontact interface",
        "summary": SUMMARIES[command],
        "keywords": "friction, stick-slip, multicontact interface, earthquake-like model",
        "source": program,
        "history": f"{now} {program}: {asked}",
        "date_created": now,
        "configuration": config.to_toml(),
        # The base of the configuration does not affect the results.
        **({} if base is None else {"base_configuration": base.to_toml()}),
        "program_version": version("mesoslip"),
        "commit": _build.COMMIT,
        "compiler": _build.COMPILER,
        "library_versions": ", ".join(
            [f"python {platform.python_version()}"]
            + ([f"SUNDIALS {sundials}"] if sundials else [])
            + [f"{name} {version(name)}" for name in ("numpy", "xarray", "netCDF4", "pydantic")]
        ),
    }
