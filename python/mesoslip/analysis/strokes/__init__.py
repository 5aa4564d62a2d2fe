"""Strokes of a record that goes back and forth: pieces between its reversals, slips in them, and
what is measured of strokes and cycles."""

from mesoslip.analysis.strokes.catalogue import (
    Strokes,
    check_middle,
    strokes,
    strokes_from,
    strokes_of,
)
from mesoslip.analysis.strokes.segments import (
    Piece,
    back_and_forth,
    monotone_pieces,
    output_pieces,
    pieces_of_force,
    record_pieces,
)
from mesoslip.analysis.strokes.sliding import Sliding, sliding_of
from mesoslip.analysis.strokes.slips import find_slips_between_reversals

__all__ = [
    "Piece",
    "Sliding",
    "Strokes",
    "back_and_forth",
    "check_middle",
    "find_slips_between_reversals",
    "monotone_pieces",
    "output_pieces",
    "pieces_of_force",
    "record_pieces",
    "sliding_of",
    "strokes",
    "strokes_from",
    "strokes_of",
]
