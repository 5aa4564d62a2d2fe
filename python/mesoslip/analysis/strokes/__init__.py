"""Strokes of a record that goes back and forth: pieces between its reversals, slips in them, and
measured properties of strokes and cycles."""

from mesoslip.analysis.strokes.catalogue import Strokes, strokes, strokes_from, strokes_of
from mesoslip.analysis.strokes.friction_map import FrictionMap, along, friction_map, place_of
from mesoslip.analysis.strokes.revolutions import (
    angle_of,
    are_of_track,
    found_period,
    has_rotation,
)
from mesoslip.analysis.strokes.segments import (
    FORCE,
    Piece,
    back_and_forth,
    monotone_pieces,
    output_pieces,
    path_of,
    pieces_of_force,
    record_pieces,
)
from mesoslip.analysis.strokes.sliding import Sliding, sliding_of
from mesoslip.analysis.strokes.slips import find_slips_between_reversals

__all__ = [
    "FORCE",
    "FrictionMap",
    "Piece",
    "Sliding",
    "Strokes",
    "along",
    "angle_of",
    "are_of_track",
    "back_and_forth",
    "find_slips_between_reversals",
    "found_period",
    "friction_map",
    "has_rotation",
    "monotone_pieces",
    "output_pieces",
    "path_of",
    "pieces_of_force",
    "place_of",
    "record_pieces",
    "sliding_of",
    "strokes",
    "strokes_from",
    "strokes_of",
]
