"""Slips in a record that goes back and forth, searched within its pieces.

A reversal is no slip: the force changes its sign because the drive changes its direction. Forces
along the motion of each piece are put one after the other, without the rise of the force after each
reversal and without a step from piece to piece, so that one search sees all strokes. Between
reversals nothing is changed but a slow trend.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from mesoslip.analysis.noise import TraceNoise, estimate_noise
from mesoslip.analysis.sampled_slips import FoundSlips, Parts, find_slips
from mesoslip.analysis.strokes.segments import Piece
from mesoslip.analysis.strokes.sliding import sliding_of
from mesoslip.array_types import Array

# Samples at the end of a piece that belong to the reversal.
END = 2


def find_slips_between_reversals(
    pieces: Sequence[Piece] | None,
    time: Array,
    force: Array,
    *,
    noise: float | TraceNoise | None = None,
    are_guessed: bool = False,
    **options: Any,
) -> FoundSlips:
    """The slips of a record within its monotone pieces; see `find_slips`.

    The pieces are those of `monotone_pieces`, or guessed, those of `pieces_of_force`; None stands
    for a record in one direction. Forces of slips have the sign of the record.
    """
    if pieces is None:
        return find_slips(time, force, noise=noise, **options)
    options = options | {"direction": 1.0, "loading_rate": None}
    force = np.asarray(force, dtype=float)
    if noise is None:
        noise = estimate_noise(time, force)
    if isinstance(noise, TraceNoise):
        # Impulses and hum are those of the record, whose sign the strokes change.
        force = noise.clean(time, force)
        noise = replace(noise, impulse_time=np.empty(0), hum=())
    sliding = sliding_of(force, pieces)
    samples, piece, sign, unfolded = (
        sliding.samples, sliding.piece, sliding.sign, sliding.unfolded()
    )  # fmt: skip
    parts = Parts(np.flatnonzero(np.diff(piece, prepend=-1)), are_guessed)
    found = find_slips(time[samples], unfolded, noise=noise, put_together=parts, **options)
    end = np.array([one.after for one in pieces])[piece[found.first]] - END
    # A fall up to the end of a piece, or nearly so, is that of a reversal that was found late.
    end -= (samples[found.last] - samples[found.first]) // 2
    kept = (piece[found.first] == piece[found.last]) & (samples[found.last] < end)
    first, last = found.first[kept], found.last[kept]
    shift = sliding.force - unfolded
    return replace(
        found,
        start_time=found.start_time[kept],
        end_time=found.end_time[kept],
        force_before=sign[first] * (found.force_before[kept] + shift[first]),
        force_after=sign[last] * (found.force_after[kept] + shift[last]),
        fall_rate=found.fall_rate[kept],
        first=samples[first],
        last=samples[last],
    )
