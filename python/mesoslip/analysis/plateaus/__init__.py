"""Plateaus of a record: between steps of the speed, of the load, or of the force itself."""

from mesoslip.analysis.plateaus.catalogue import (
    SIGNALS,
    Plateaus,
    plateaus,
    plateaus_from,
    plateaus_of,
)
from mesoslip.analysis.plateaus.levels import levels_of

__all__ = [
    "SIGNALS",
    "Plateaus",
    "levels_of",
    "plateaus",
    "plateaus_from",
    "plateaus_of",
]
