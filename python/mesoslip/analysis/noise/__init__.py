"""The noise of a measured trace: its parts, their removal, and the errors by noise."""

from mesoslip.analysis.noise.estimate import TraceNoise, estimate_noise, without_impulses
from mesoslip.analysis.noise.hum import HumLine
from mesoslip.analysis.noise.levels import digital_step_of, noise_level
from mesoslip.analysis.noise.parts import Part, parts_of

__all__ = [
    "HumLine",
    "Part",
    "TraceNoise",
    "digital_step_of",
    "estimate_noise",
    "noise_level",
    "parts_of",
    "without_impulses",
]
