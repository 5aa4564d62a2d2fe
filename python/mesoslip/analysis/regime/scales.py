"""Scales of a motion: the evaluated stage of the drive, forces, and noise."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from mesoslip.analysis.apparatus import Apparatus
from mesoslip.analysis.regime.result import MAXIMUM_FORCE, STATIC_FORCE
from mesoslip.array_types import Array
from mesoslip.configuration.config import Config
from mesoslip.output.access import group_of
from mesoslip.output.arrays import Tree

# Amplitude of the noise of N contacts in steady sliding over the static force, times N^(1/2): 0.6,
# with a margin.
NOISE_AMPLITUDE = 0.8
# Amplitude of measured noise over its standard deviation: the percentiles of normal noise are at
# 1.64, with a margin.
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
    """Scales of a motion, forces in the unit of the apparatus."""

    stage: Stage
    static_force: float
    noise_amplitude: float
    """Amplitude of smooth sliding by noise alone."""
    renewal_displacement: float
    """Displacement of the slider in which all contacts break [m]; 0 if unknown."""
    stiffness: float
    is_rigid: bool
    """Whether the slider moves as the drive, so that it neither sticks nor slips."""
    has_velocity: bool
    """Whether the drive has a velocity with which that of the slider can be compared."""
    is_measured: bool = False
    """Whether noise and drift may hide cycles and velocities: then slips are the cycles."""

    @property
    def loading_rate(self) -> float:
        """Rate at which the drive loads the spring [N/s], K v; 0 in a hold, of a rigid one too."""
        return self.stiffness * abs(self.stage.velocity) if self.stage.velocity else 0.0

    @property
    def force_scale(self) -> str:
        """What forces are divided by."""
        return MAXIMUM_FORCE if self.is_measured else STATIC_FORCE

    @classmethod
    def of_config(cls, config: Config, reached: float) -> Scales:
        """Scales of a configuration, for a run that reached a time [s]."""
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
        """Scales of a measured trace without a configuration, whose static force is the maximum
        force; ``noise`` is a standard deviation."""
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
