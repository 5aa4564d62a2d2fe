"""A plain, slow model of an interface with a length, for tests: fixed steps of Runge and Kutta.

Blocks in a row with equal contacts that keep given thresholds (section 16 of the model). A step in
which contacts break or attach is shortened to the first of these events, which is found in the
cubic through both ends of the step.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass
class PlainInterface:
    """Blocks in a row; forces and stiffness of contacts are those of one contact."""

    mass: float
    neighbour_spring: float
    edge_stiffness: float
    top_stiffness: float
    thresholds: Array
    """Force at which each contact breaks, shape (blocks, contacts of a block)."""
    contact_stiffness: float
    velocity: float
    delay: float = 0.0
    back_force_ratio: float = 0.0
    drag: float = 0.0
    """Drag of a detached contact over the velocity."""
    neighbour_damping: float = 0.0
    damping: float = 0.0

    def __post_init__(self) -> None:
        blocks = len(self.thresholds)
        self.block_mass = self.mass / blocks
        self.place, self.speed, self.mean = np.zeros((3, blocks))
        self.time, self.breaks = 0.0, 0
        self.origins = np.zeros(self.thresholds.shape)
        self.pinned = np.ones(self.thresholds.shape, dtype=bool)
        self.due = np.full(self.thresholds.shape, np.inf)
        self.direction = np.ones(blocks)

    def contact_force(self, place: Array, speed: Array) -> Array:
        """Force of each block on its contacts."""
        stretch = np.where(self.pinned, place[:, None] - self.origins, 0.0)
        detached = self.drag * np.sum(~self.pinned, axis=1)
        force: Array = self.contact_stiffness * stretch.sum(axis=1) + detached * speed
        return force

    def drive_forces(self, time: float, place: Array) -> Array:
        """Force of the springs of the drive on each block."""
        forces: Array = self.top_stiffness / len(place) * (self.velocity * time - place)
        forces[0] += self.edge_stiffness * (self.velocity * time - place[0])
        return forces

    def rates(self, time: float, state: Array) -> Array:
        """Time derivatives of displacements, velocities and their running means."""
        place, speed, mean = state
        links = self.neighbour_spring * np.diff(place)
        links += self.neighbour_damping * self.block_mass * np.diff(speed)
        force = self.drive_forces(time, place) - self.contact_force(place, speed)
        force[:-1] += links
        force[1:] -= links
        damping = self.damping * (speed - mean)
        return np.array([speed, force / self.block_mass - damping, damping])

    def after(self, step: float) -> Array:
        """The state after a step without events."""
        time, state = self.time, np.array([self.place, self.speed, self.mean])
        first = self.rates(time, state)
        second = self.rates(time + step / 2, state + step / 2 * first)
        third = self.rates(time + step / 2, state + step / 2 * second)
        last = self.rates(time + step, state + step * third)
        return state + step / 6 * (first + 2 * second + 2 * third + last)

    def first_break(self, step: float, state: Array) -> tuple[float, tuple[int, int] | None]:
        """Length of the step to the first break, and its contact."""
        found, which = step, None
        limit = self.thresholds / self.contact_stiffness
        stretch = np.abs(state[0][:, None] - self.origins)
        for block, contact in zip(*np.nonzero(self.pinned & (stretch >= limit)), strict=True):
            sign = np.sign(state[0, block] - self.origins[block, contact])
            place = self.origins[block, contact] + sign * limit[block, contact]
            ends = self.place[block], state[0, block]
            slopes = step * self.speed[block], step * state[1, block]
            gap = ends[1] - ends[0]
            cubic = np.polynomial.Polynomial(
                [
                    ends[0] - place,
                    slopes[0],
                    3 * gap - 2 * slopes[0] - slopes[1],
                    slopes[0] + slopes[1] - 2 * gap,
                ]
            )
            roots = cubic.roots()
            real = roots[np.abs(roots.imag) < 1e-9].real
            inside = real[(real >= -1e-9) & (real <= 1 + 1e-9)]
            part = float(inside.min()) * step if inside.size else step
            if part <= found:
                found, which = max(part, 0.0), (block, contact)
        return found, which

    def advance(self, end: float, max_step: float) -> None:
        """Advance to a time."""
        while self.time < end - 1e-12 * max(1.0, end):
            step = min(max_step, end - self.time, max(float(self.due.min()) - self.time, 0.0))
            state = self.after(step)
            part, which = self.first_break(step, state)
            if which is not None:
                state = self.after(part)
            self.time += part
            self.place, self.speed, self.mean = state
            moving = self.speed != 0
            self.direction[moving] = np.sign(self.speed[moving])
            if which is not None:
                self.pinned[which] = False
                self.due[which] = self.time + self.delay
                self.breaks += 1
            self.attach()

    def attach(self) -> None:
        """Attach the contacts whose delay is over."""
        now = self.due <= self.time * (1 + 1e-15)
        if not now.any():
            return
        force = self.direction[:, None] * self.back_force_ratio * self.thresholds
        origins = self.place[:, None] - force / self.contact_stiffness
        self.origins[now] = origins[now]
        self.pinned |= now
        self.due[now] = np.inf
