"""The regime of motion in an output: smooth, stick-slip, irregular or transient.

It is determined from the spring force in the evaluated window: the second half of the last stage in
which the drive moves; the first half counts as transient. ``docs/regimes.md`` explains the rules
and reports their validation.
"""

from mesoslip.analysis.regime.outputs import judge, regime, regime_of_realization, regimes
from mesoslip.analysis.regime.result import (
    IRREGULAR,
    NAMES,
    REGIME,
    SMOOTH,
    STICK_SLIP,
    TRANSIENT,
    RegimeResult,
    results_of,
    summary,
)
from mesoslip.analysis.regime.rules import classify
from mesoslip.analysis.regime.scales import Scales

__all__ = [
    "IRREGULAR",
    "NAMES",
    "REGIME",
    "SMOOTH",
    "STICK_SLIP",
    "TRANSIENT",
    "RegimeResult",
    "Scales",
    "classify",
    "judge",
    "regime",
    "regime_of_realization",
    "regimes",
    "results_of",
    "summary",
]
