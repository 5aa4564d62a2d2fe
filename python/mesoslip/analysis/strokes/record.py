"""A record that goes back and forth: samples, pieces, and the noise of its quantities."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mesoslip.analysis.noise import noise_level, without_impulses
from mesoslip.analysis.strokes.segments import (
    FORCE,
    ONE_WAY,
    POSITIONS,
    Piece,
    given_in,
    output_pieces,
)
from mesoslip.analysis.strokes.sliding import polarity
from mesoslip.array_types import Array
from mesoslip.errors import FileError
from mesoslip.output.access import group_of
from mesoslip.output.arrays import Tree
from mesoslip.output.variables import force_among

# Direction of the force that is given.
AGAINST = "against"
# What pieces are, except those of a disc.
NOUN = "strokes"


@dataclass(frozen=True)
class StrokeRecord:
    """Samples of a realization, arrays of shape (samples,)."""

    time: Array
    force: Array
    position: Array | None
    """Displacement in which the strokes were found [m]; None if they are those of the force."""
    normal: Array | None
    """Normal force [N], positive."""
    pieces: tuple[Piece, ...]
    source: str
    """The quantity in which they were found."""
    white: float
    """Standard deviation of the white noise of the force."""
    correlated: float
    """That of noise that is correlated from sample to sample."""
    correlation_time: float
    noun: str = NOUN
    """What the pieces are."""
    remarks: tuple[str, ...] = ()
    """Sentences on the pieces."""
    direction: str | None = None
    """Direction of the force, `AGAINST` or along the motion, if it is given."""

    @cached_property
    def sign(self) -> float:
        """+1 if the force is positive along the motion, -1 if it is against it.

        Along the motion loops lose energy; without a position the force in the pieces decides.
        """
        if self.direction is not None:
            return -1.0 if self.direction == AGAINST else 1.0
        whole = self.pieces[1:-1]
        if self.position is None or len(whole) < 2:
            return polarity(self.force, self.pieces)
        cycles = slice(whole[0].first, whole[2 * (len(whole) // 2) - 1].after)
        return -1.0 if loop_area(self.position[cycles], self.force[cycles]) < 0 else 1.0

    @cached_property
    def position_noise(self) -> float:
        """Standard deviation of the noise of the position [m]."""
        return 0.0 if self.position is None else noise_level(self.position)

    @cached_property
    def variance_ratio(self) -> float:
        """Variance of a sum over many samples of noise, over that of white noise."""
        if self.correlated == 0:
            return 1.0
        interval = float(np.median(np.diff(self.time)))
        length = 1 / math.tanh(interval / (2 * self.correlation_time))
        total = self.white**2 + self.correlated**2
        return (self.white**2 + self.correlated**2 * length) / total

    @property
    def singular(self) -> str:
        """What a piece is."""
        first, _, rest = self.noun.partition(" ")
        return f"{first.removesuffix('s')} {rest}".rstrip()

    @property
    def noise(self) -> float:
        """Standard deviation of all noise of the force."""
        return math.hypot(self.white, self.correlated)

    @property
    def notes(self) -> list[str]:
        """Guesses about the record, which may be wrong."""
        found = list(self.remarks)
        if self.source == FORCE:
            found.append(
                "guess: strokes are those of the sign of the force, as no displacement is known "
                "(trace --motion)"
            )
        elif self.sign < 0 and self.direction is None:
            found.append(
                "guess: the force is against the motion, as of the drive on the sensor "
                "(trace --force-direction)"
            )
        return found


def record_of(tree: Tree, realization: int = 0, name: str = "the output") -> StrokeRecord:
    pieces, source = output_pieces(tree, realization)
    if pieces is None:
        if given_in(tree, "motion") == ONE_WAY:
            raise FileError(f"{name}: was read as one-way; read it again with --motion strokes")
        raise FileError(
            f"{name}: does not go back and forth: the {source} has no reversals"
            if source != FORCE
            else f"{name}: does not go back and forth, as far as the sign of the force shows, and "
            "no displacement is known; for revolutions of a disc give --period"
        )
    return record_in(tree, realization, pieces, source)


def record_in(
    tree: Tree,
    realization: int,
    pieces: tuple[Piece, ...],
    source: str,
    noun: str = NOUN,
    remarks: tuple[str, ...] = (),
) -> StrokeRecord:
    """A realization of an output, cut into pieces."""
    root = tree.to_dataset()
    force = root[force_among(root)].values[realization].astype(float)
    known = np.flatnonzero(np.isfinite(force))
    count = int(known[-1]) + 1
    time, force = root["time"].values[:count], force[:count]
    white, correlated, correlation_time = noise_level(force), 0.0, 0.0
    if "noise" in tree.children:
        noise = group_of(tree, "noise")
        force = without_impulses(time, force, noise["impulse_time"].values)
        white, correlated, correlation_time = (
            float(noise[one].values)
            for one in ("deviation", "correlated_deviation", "correlation_time")
        )
    position = None
    if source in POSITIONS:
        position = _whole(time, root[POSITIONS[source]].values[realization][:count])
    normal = None
    if "normal_force" in root and "spring_force" in root:
        normal = np.abs(
            _whole(time, np.atleast_2d(root["normal_force"].values)[realization][:count])
        )
    kept = tuple(one._replace(after=min(one.after, count)) for one in pieces if one.first < count)
    noise_of = (white, correlated, correlation_time)
    direction = given_in(tree, "force_direction")
    return StrokeRecord(
        time, force, position, normal, kept, source, *noise_of, noun, remarks, direction
    )


def loop_area(x: Array, force: Array) -> float:
    """Integral of force dx around a polygon of samples."""
    force = force - force.mean()
    return float(0.5 * (force + np.roll(force, -1)) @ (np.roll(x, -1) - x))


def _whole(time: Array, values: Array) -> Array:
    """Values with lines over missing samples."""
    known = np.isfinite(values)
    whole: Array = np.interp(time, time[known], values[known].astype(float))
    return whole
