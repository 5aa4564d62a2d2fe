"""Scales of a motion: the evaluated stage of the drive, noise, and scales."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mesoslip.analysis.apparatus import Apparatus
from mesoslip.configuration.config import Config
from mesoslip.output.access import group_of
from mesoslip.output.arrays import Tree

Array = NDArray[np.float64]

# Noise of N contacts in steady sliding (0.6 N^(-1/2)) over the static force, with a margin.
NOISE_AMPLITUDE = 0.8
# The same for the noise of a measured trace, over its standard deviation: the percentiles of normal
# noise lie at 1.64 of it.
MEASURED_NOISE_AMPLITUDE = 2.2


@dataclass(frozen=True)
class Stage:
    """The last stage in which the drive moves: its times [s] and velocity [m/s]."""

    start: float
    end: float
    velocity: float

    @property
    def middle(self) -> float:
        return (self.start + self.end) / 2

    @property
    def direction(self) -> float:
        return -1.0 if self.velocity < 0 else 1.0


@dataclass(frozen=True)
class Scales:
    """Scales of a motion.

    Attributes
    ----------
    stage
        The evaluated stage of the drive.
    static_force
        Static force, in the unit of the force.
    noise_amplitude
        Amplitude that noise gives to smooth sliding, in the unit of the force.
    renewal_displacement
        Displacement of the drive in which all contacts break [m]; 0 if unknown.
    stiffness
        Stiffness of the spring, unit of the force per metre.
    is_rigid
        Whether the slider moves as the drive, so that it neither sticks nor slips.
    has_velocity
        Whether the drive has a velocity with which that of the slider can be compared.
    is_measured
        Whether noise and drift may hide cycles and velocities: then slips are the cycles.
    """

    stage: Stage
    static_force: float
    noise_amplitude: float
    renewal_displacement: float
    stiffness: float
    is_rigid: bool
    has_velocity: bool
    is_measured: bool = False

    @classmethod
    def of_config(cls, config: Config, reached: float) -> Scales:
        """Those of a configuration.

        Parameters
        ----------
        config
            The configuration.
        reached
            Time that the run reached [s].
        """
        static = config.contacts.static_force
        noise = 0.0
        if config.contact_kind.is_discrete:
            noise = NOISE_AMPLITUDE * static / math.sqrt(config.contacts.count)
        return cls(
            stage_of(config, reached),
            static,
            noise,
            config.contacts.break_stretch,
            config.spring_stiffness,
            math.isinf(config.spring_stiffness),
            config.drive.force_rate is None,
        )

    @classmethod
    def of_measurement(
        cls, apparatus: Apparatus, stage: Stage, force: Array, noise: float
    ) -> Scales:
        """Those of a measured trace without a configuration.

        The static force is the maximum of the force; which displacement renews the contacts is
        unknown.

        Parameters
        ----------
        apparatus
            The apparatus.
        stage
            The evaluated stage.
        force
            The evaluated force.
        noise
            Standard deviation of the noise of the force.
        """
        return cls(
            stage,
            float(np.max(np.abs(force), initial=0.0)),
            MEASURED_NOISE_AMPLITUDE * noise,
            0.0,
            apparatus.stiffness,
            math.isinf(apparatus.stiffness),
            math.isfinite(stage.velocity),
            is_measured=True,
        )


def stage_of(config: Config, reached: float) -> Stage:
    """The last stage with a moving drive that the run reached."""
    begin, found = 0.0, Stage(0.0, reached, 0.0)
    for part in config.drive_parts:
        if begin >= reached:
            break
        end = min(begin + part.duration, reached)
        velocity = part.end_velocity or part.start_velocity
        if velocity != 0:
            found = Stage(begin, end, velocity)
        begin = end
    return found


def measured_stage(tree: Tree, apparatus: Apparatus, reached: float) -> Stage:
    """The last stage of a measured trace in which the drive moves; the whole trace without one."""
    start = float(tree.to_dataset()["time"].values[0])
    found = Stage(start, reached, apparatus.velocity)
    if "stages" not in tree.children:
        return found
    data = group_of(tree, "stages")
    columns = ("stage_start_time", "stage_end_time", "drive_start_velocity", "drive_end_velocity")
    for begin, end, first, last in zip(*(data[name].values for name in columns), strict=True):
        if begin < reached and (last or first):
            found = Stage(float(begin), min(float(end), reached), float(last or first))
    return found
