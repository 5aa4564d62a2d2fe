"""The uniform law."""

from __future__ import annotations

import math

from mesoslip.configuration.threshold_laws.base import ThresholdLawKind

LAW = ThresholdLawKind(
    "uniform",
    max_width=1 / math.sqrt(3),
    if_wider=", whose smallest threshold would be negative",
    jumps="both",
)
