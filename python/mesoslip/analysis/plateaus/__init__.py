"""Plateaus of a record: between steps of the speed, of the load, or of the force itself."""

from mesoslip.analysis.plateaus.catalogue import (
    Plateaus,
    check_signal,
    plateaus,
    plateaus_from,
    plateaus_of,
)
from mesoslip.analysis.plateaus.levels import levels_of

__all__ = [
    "Plateaus",
    "check_signal",
    "levels_of",
    "plateaus",
    "plateaus_from",
    "plateaus_of",
]
