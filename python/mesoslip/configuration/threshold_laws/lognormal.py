"""The law of exp(μ + σz), z being a normal deviate."""

from __future__ import annotations

from mesoslip.configuration.threshold_laws.base import ThresholdLawKind

LAW = ThresholdLawKind("lognormal")
