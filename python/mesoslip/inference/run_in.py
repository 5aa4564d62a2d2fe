"""The start of a simulation that belongs to no trace: the sliding in which it forgets how it began.

A trace that begins under force is taken from the middle of an experiment. Its simulation is loaded
first, and then slides until contacts have been replaced and the place has another strength.
"""

from __future__ import annotations

import math

from mesoslip.analysis.apparatus import first_velocity
from mesoslip.configuration.config import Config

# Displacement of the drive in loadings to the static force, from relaxed contacts and from those of
# steady sliding; in breaking stretches; and in correlation lengths of the track.
LOADINGS, STEADY_LOADINGS = 1.5, 0.5
STRETCHES = 10.0
TRACK_LENGTHS = 1.0
# Minimum time in periods of the setup, for a drive so fast that the slider still rings.
PERIODS = 5


def run_in_distance(config: Config, force: float) -> float:
    """Displacement of the drive in which a simulation forgets its start [m]; ``force`` is the
    maximum of the trace [N]."""
    contacts, stiffness = config.contacts, config.spring_stiffness
    loading = max(contacts.static_force, force) / stiffness if stiffness > 0 else 0.0
    loadings = STEADY_LOADINGS if contacts.initial == "steady" else LOADINGS
    replaced = STRETCHES * contacts.break_stretch
    return loadings * loading + replaced + TRACK_LENGTHS * contacts.place_length


def run_in_samples(config: Config, force: float, interval: float, count: int) -> int:
    """That distance in samples of an interval [s], with some periods of the setup, at most that of
    the trace."""
    velocity = abs(first_velocity(config) or 0.0)
    if not velocity > 0:
        return count
    wanted = max(run_in_distance(config, force) / velocity, PERIODS * 2 * config.slider.quiet_time)
    return min(count, math.ceil(wanted / interval))
