"""The normal law, the one of the source."""

from __future__ import annotations

from mesoslip.configuration.threshold_laws.base import ThresholdLawKind

LAW = ThresholdLawKind("gaussian")
