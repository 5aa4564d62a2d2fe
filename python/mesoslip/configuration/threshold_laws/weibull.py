"""Weibull's law."""

from __future__ import annotations

from mesoslip.configuration.threshold_laws.base import ThresholdLawKind

LAW = ThresholdLawKind("weibull")
