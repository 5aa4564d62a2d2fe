"""mesoslip: stick-slip friction of a multicontact interface.

>>> import mesoslip
>>> tree = mesoslip.run("runs/klein.toml")        # doctest: +SKIP
>>> tree["spring_force"].plot()                   # doctest: +SKIP
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from mesoslip.errors import ConfigError, FileError, MesoslipError, RunError

if TYPE_CHECKING:
    from mesoslip.api import (
        avalanche_summary,
        avalanches,
        claims,
        curve,
        example,
        figures,
        fit,
        group,
        info,
        onset,
        plot,
        read,
        read_trace,
        regime,
        report,
        response,
        run,
        slips,
        sweep,
    )
    from mesoslip.configuration.config import Config
    from mesoslip.configuration.threshold_law import ThresholdLaw
    from mesoslip.theory.force_curve import ForceCurve
    from mesoslip.theory.steady_sliding import SteadySliding

__all__ = [
    "Config",
    "ConfigError",
    "FileError",
    "ForceCurve",
    "MesoslipError",
    "RunError",
    "SteadySliding",
    "ThresholdLaw",
    "avalanche_summary",
    "avalanches",
    "claims",
    "curve",
    "example",
    "figures",
    "fit",
    "group",
    "info",
    "onset",
    "plot",
    "read",
    "read_trace",
    "regime",
    "report",
    "response",
    "run",
    "slips",
    "sweep",
]

# What takes long to import is imported when it is asked for.
_LAZY = {
    "Config": "configuration.config",
    "ForceCurve": "theory.force_curve",
    "SteadySliding": "theory.steady_sliding",
    "ThresholdLaw": "configuration.threshold_law",
    "avalanche_summary": "api",
    "avalanches": "api",
    "claims": "api",
    "curve": "api",
    "example": "api",
    "figures": "api",
    "fit": "api",
    "group": "api",
    "info": "api",
    "onset": "api",
    "plot": "api",
    "read": "api",
    "read_trace": "api",
    "regime": "api",
    "report": "api",
    "response": "api",
    "run": "api",
    "slips": "api",
    "sweep": "api",
}


def __getattr__(name: str) -> Any:
    if name not in _LAZY:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f"mesoslip.{_LAZY[name]}"), name)


def __dir__() -> list[str]:
    """What there is, of which some is imported only when it is asked for."""
    return sorted({*globals(), *__all__})
