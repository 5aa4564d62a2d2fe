"""States of the master equation at a section as vectors, and small changes of states by vectors.

A vector has the velocity and the damper of the slider, and two densities as hat functions: of
pinned contacts over their stretch, and of detached ones over the time since they broke. A change
multiplies populations by a smooth function. It does not affect structure finer than the hat
functions, which decays within one life of a contact, as thresholds blur it.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import solveh_banded

from mesoslip.array_types import Array
from mesoslip.cycles.section import mass_of
from mesoslip.simulation.archive import Archive
from mesoslip.simulation.kernel import Words
from mesoslip.simulation.start import drive_displacement

if TYPE_CHECKING:
    from mesoslip.configuration.config import Config

# Distance of hat functions over the spread of the breaking stretches, and their maximum number.
CELL_PART, MAX_CELLS = 0.5, 2000
# Maximum spread in this ratio.
MAX_SPREAD = 0.35
# Range of stretches in mean breaking stretches, extended by a number of spreads.
MIN_STRETCH, MAX_STRETCH, SPREADS = -0.3, 1.2, 4.0
# Number of hat functions of the time since breaking.
DELAY_CELLS = 8
# Part of all contacts below which a cell is not changed.
EMPTY = 1e-10
# Range of the factor of a population in a change.
MIN_FACTOR, MAX_FACTOR = 0.05, 5.0

# Columns of a population, rows of its moments and of a packet: fortran/contacts/populations.
ORIGIN, FORCE, WEIGHT = 0, 1, 2
NUMBER, STIFF = 0, 1
PACKET_START, PACKET_END, PACKET_NUMBER, PACKET_MASS, PACKET_GROWTH = range(5)
SLIDER, PINNED, DETACHED = "rigid slider", "pinned populations", "detached packets"


class Hats:
    """Hat functions at evenly spaced points."""

    def __init__(self, low: float, high: float, cells: int) -> None:
        self.low, self.step, self.count = low, (high - low) / cells, cells + 1

    def _place(self, points: Array) -> tuple[np.ndarray, Array]:
        place = np.clip((points - self.low) / self.step, 0, self.count - 1 - 1e-9)
        cell = place.astype(int)
        return cell, place - cell

    def sums(self, points: Array, amounts: Array) -> Array:
        """Sums of the amounts at points, weighted with each hat function."""
        cell, part = self._place(points)
        total = np.zeros(self.count)
        np.add.at(total, cell, amounts * (1 - part))
        np.add.at(total, cell + 1, amounts * part)
        return total

    def factors(self, points: Array, amounts: Array, change: Array) -> Array:
        """Factors of the amounts, smooth over the points, that change their sums by ``change``."""
        if not amounts.size:
            return np.empty(0)
        cell, part = self._place(points)
        bands = np.zeros((2, self.count))
        np.add.at(bands[1], cell, amounts * (1 - part) ** 2)
        np.add.at(bands[1], cell + 1, amounts * part**2)
        np.add.at(bands[0], cell + 1, amounts * part * (1 - part))
        is_empty = bands[1] <= EMPTY * np.sum(amounts)
        bands[1] += EMPTY * np.sum(amounts)
        values = solveh_banded(bands, np.where(is_empty, 0.0, change))
        factor = 1 + values[cell] * (1 - part) + values[cell + 1] * part
        clipped: Array = np.clip(factor, MIN_FACTOR, MAX_FACTOR)
        return clipped


class Coordinates:
    """States of a rigid slider on populations as vectors; forces over F_s, numbers over N."""

    def __init__(self, config: Config, velocity: float) -> None:
        contacts = config.contacts
        self._config = config
        self._sign = math.copysign(1.0, velocity)
        self._mass, self._spring = mass_of(config), config.spring_stiffness
        self._count = contacts.count
        self._stretch = contacts.static_force / contacts.stiffness
        power = 0.5 if contacts.coupling == "scaled" else 1.0
        spread = min(contacts.stretch_width, power * MAX_SPREAD)
        high = MAX_STRETCH + SPREADS * contacts.stretch_width
        cells = (high - MIN_STRETCH) / (CELL_PART * spread)
        self._pinned = Hats(MIN_STRETCH, high, min(MAX_CELLS, math.ceil(cells)))
        self._detached = Hats(0.0, 1.0, DELAY_CELLS)
        self._velocity = math.sqrt(contacts.stiffness / self._mass) * self._stretch
        self._acceleration = contacts.static_force / self._mass

    def of(self, words: Words) -> Array:
        """The vector of a state."""
        archive = Archive(words)
        rows, left = self._rows(archive)
        since, numbers, _ = self._packets(archive)
        return np.concatenate(
            [
                [archive.number(SLIDER, "velocity") / self._velocity],
                [archive.number(SLIDER, "damper") / self._acceleration],
                self._pinned.sums(self._stretches(archive, rows), left[NUMBER]) / self._count,
                self._detached.sums(since, numbers) / self._count,
            ]
        )

    def weigh(self, vector: Array) -> Array:
        """A vector whose length measures a change; densities are integrated, so that the shift of a
        peak counts with its distance."""
        slider, pinned, detached = np.split(vector, [2, 2 + self._pinned.count])
        step = self._pinned.step
        return np.concatenate([slider, step**1.5 * np.cumsum(pinned), step * detached])

    def modulation(self, words: Words, part: float) -> Array:
        """The change that modulates the density of pinned contacts over their stretch."""
        pinned = np.split(self.of(words), [2, 2 + self._pinned.count])[1]
        wave = part * np.sin(2 * np.pi * np.arange(pinned.size) / pinned.size) * pinned
        # The sum over the contacts stays the same; all of them may be detached.
        wave -= pinned * (np.sum(wave) / max(float(np.sum(pinned)), EMPTY))
        return np.concatenate([np.zeros(2), wave, np.zeros(self._detached.count)])

    def _rows(self, archive: Archive) -> tuple[Array, Array]:
        count = int(archive.number(PINNED, "count"))
        return archive.matrix(PINNED, "population")[:count], archive.matrix(PINNED, "left")[
            :, :count
        ]

    def _stretches(self, archive: Archive, rows: Array) -> Array:
        here = archive.number(SLIDER, "displacement")
        stretches: Array = self._sign * (here - rows[:, ORIGIN]) / self._stretch
        return stretches

    def _packets(self, archive: Archive) -> tuple[Array, Array, slice]:
        """Time since breaking over the delay, numbers of contacts, and columns in the archive."""
        packets = archive.matrix(DETACHED, "packet")
        first, last = (int(archive.number(DETACHED, name)) for name in ("first", "last"))
        there = slice(first - 1, last)
        packets = packets[:, there]
        numbers = packets[PACKET_NUMBER].copy()
        if numbers.size:
            part, growth = archive.number(DETACHED, "first_part"), packets[PACKET_GROWTH, 0]
            numbers[0] *= 1 - part * (1 - growth * (1 - part))
        middle = 0.5 * (packets[PACKET_START] + packets[PACKET_END])
        delay = self._config.contacts.delay or 1.0
        return (archive.number(SLIDER, "time") - middle) / delay, numbers, there

    def changed(self, words: Words, change: Array) -> Words:
        """A state changed by a small vector."""
        archive = Archive(words)
        rows, left = self._rows(archive)
        since, numbers, there = self._packets(archive)
        parts = np.split(change, [1, 2, 2 + self._pinned.count])
        factor = self._pinned.factors(
            self._stretches(archive, rows), left[NUMBER], parts[2] * self._count
        )
        pinned = float(factor @ left[NUMBER])
        detached = archive.number(DETACHED, "number")
        if numbers.size:
            packets = archive.matrix(DETACHED, "packet")
            factors = self._detached.factors(since, numbers, parts[3] * self._count)
            for name, row in (("number", PACKET_NUMBER), ("mass", PACKET_MASS)):
                more = float((factors - 1) @ (numbers * packets[row, there] / packets[2, there]))
                archive.set_number(DETACHED, name, archive.number(DETACHED, name) + more)
            packets[PACKET_NUMBER : PACKET_MASS + 1, there] *= factors
            archive.set_matrix(DETACHED, "packet", packets)
            detached = archive.number(DETACHED, "number")
        if pinned > 0:
            factor *= (self._count - detached) / pinned
        self._set_rows(archive, rows, left, factor)
        self._set_slider(
            archive,
            self._velocity * float(parts[0][0]),
            self._acceleration * float(parts[1][0]),
        )
        return archive.words()

    def _set_rows(self, archive: Archive, rows: Array, left: Array, factor: Array) -> None:
        """Multiply populations."""
        count = len(rows)
        everything = archive.matrix(PINNED, "population")
        everything[:count, WEIGHT] *= factor
        archive.set_matrix(PINNED, "population", everything)
        moments = archive.matrix(PINNED, "left")
        moments[:, :count] *= factor
        archive.set_matrix(PINNED, "left", moments)
        contacts, left = self._config.contacts, left * factor
        stiffness = contacts.stiffness / self._count * left[STIFF]
        force = contacts.static_force / self._count * left[NUMBER] * rows[:, FORCE]
        archive.set_number(PINNED, "stiffness", math.fsum(stiffness))
        archive.set_number(
            PINNED, "offset", math.fsum(stiffness * rows[:, ORIGIN]) - math.fsum(force)
        )

    def _set_slider(self, archive: Archive, velocity: float, damper: float) -> None:
        """Change velocity and damper of the slider, and its acceleration accordingly."""
        velocity += archive.number(SLIDER, "velocity")
        damper += archive.number(SLIDER, "damper")
        here = archive.number(SLIDER, "displacement")
        drive = drive_displacement(archive, SLIDER)
        stiffness, offset = (archive.number(PINNED, name) for name in ("stiffness", "offset"))
        drag = self._config.contacts.contact_drag * archive.number(DETACHED, "mass")
        force = stiffness * here - offset + drag * velocity
        archive.set_number(SLIDER, "velocity", velocity)
        archive.set_number(SLIDER, "damper", damper)
        archive.set_number(
            SLIDER, "acceleration", (self._spring * (drive - here) - force) / self._mass - damper
        )
