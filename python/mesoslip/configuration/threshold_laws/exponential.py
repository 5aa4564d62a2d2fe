"""The shifted exponential law, from 1 - width on."""

from __future__ import annotations

from mesoslip.configuration.threshold_laws.base import ThresholdLawKind

LAW = ThresholdLawKind(
    "exponential",
    max_width=1.0,
    if_wider=", whose smallest threshold would be negative",
    jumps="lower",
)
