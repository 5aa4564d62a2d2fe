"""The rules and thresholds by which a motion is classified."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mesoslip.analysis.cycles import (
    MAX_PATTERN,
    MIN_CYCLES,
    Cycles,
    correlation,
    defined,
    find_cycles,
    irregularity,
    trend,
    variation,
)
from mesoslip.analysis.regime.result import IRREGULAR, SMOOTH, STICK_SLIP, TRANSIENT, RegimeResult
from mesoslip.analysis.regime.scales import Scales

Array = NDArray[np.float64]

# Maximum amplitude of smooth sliding without noise, over the mean force.
SMOOTH_AMPLITUDE = 0.02
# Percentiles of the force; the amplitude is half their distance.
LOW, HIGH = 5.0, 95.0
# Minimum mean force that amplitudes are divided by, over the static force.
MIN_MEAN = 0.05
# Reversal of the force that ends a cycle, over the distance of the percentiles, and the maximum
# excursion beyond the percentiles that counts, such as the rebound of a slip.
TURNING = 0.5
MAX_EXCURSION = 0.1
# Maximum variation of periods, and of the falls of the force in a cycle, of stick-slip.
IRREGULAR_PERIODS = 0.3
IRREGULAR_FALLS = 0.35
# Maximum variations of an oscillation that is not noise, though as small.
REGULAR_PERIODS = 0.15
REGULAR_FALLS = 0.2
# A motion is transient if its amplitude changes by more than this fraction, and by as many standard
# errors; or if one half of the window is smooth and the amplitude of the other exceeds the limit of
# smooth sliding by this factor.
MAX_CHANGE = 0.4
SIGNIFICANCE = 4.0
SMOOTH_FACTOR = 1.5
# Maximum velocity of a sticking slider over that of the drive: pinned contacts let it move at
# K/(K + Nk) of the drive's velocity.
STICKING = 0.5


def classify(
    scales: Scales, time: Array, force: Array, velocity: Array, starts: Array, drops: Array
) -> RegimeResult:
    """The regime of a motion.

    Parameters
    ----------
    scales
        What it is compared with.
    time, force, velocity
        The evaluated window of the trace: time [s], force, velocity of the slider [m/s], NaN if it
        is unknown.
    starts, drops
        Starts [s] of the slips of the realization, and their force drops.
    """
    if len(time) < 2 * MIN_CYCLES:
        return RegimeResult()
    stage = scales.stage
    force, velocity = stage.direction * force, stage.direction * velocity
    is_inside = (starts >= time[0]) & (starts <= time[-1])
    starts, drops = starts[is_inside], np.abs(drops[is_inside])
    mean = float(np.mean(force))
    scale = max(abs(mean), MIN_MEAN * scales.static_force)
    smooth = SMOOTH_AMPLITUDE * scale + scales.noise_amplitude
    low, high = np.percentile(force, [LOW, HIGH])
    amplitude = float(high - low) / 2
    half = len(force) // 2
    halves = [_amplitude(force[:half]), _amplitude(force[half:])]
    excursion = MAX_EXCURSION * (high - low)
    cycles = find_cycles(
        time, force, np.clip(force, low - excursion, high + excursion), TURNING * (high - low)
    )
    min_drop = TURNING * (high - low)
    if scales.is_measured and drops.size:
        # The strength may vary along the track by more than slips are deep.
        min_drop = min(min_drop, TURNING * float(np.median(drops)))
    is_large = drops >= min_drop
    slips = Cycles(np.diff(starts[is_large]), drops[is_large], cycles.peaks)
    # In the catalogue a slip and its rebounds are one, but oscillations without slips are missing;
    # a trace with few samples may miss slips. The more regular of the two descriptions counts,
    # unless it leaves out most cycles.
    has_most = len(slips.periods) >= max(MIN_CYCLES, len(cycles.periods) / MAX_PATTERN)
    is_regular = not irregularity(slips.periods) >= irregularity(cycles.periods)
    if (has_most and is_regular) or (scales.is_measured and len(slips.periods) >= MIN_CYCLES):
        cycles = slips
    change, error = trend(cycles.falls)
    moved = abs(stage.velocity) * (time[-1] - time[0])
    numbers = {
        "relative_amplitude": amplitude / scale,
        "smooth_amplitude": smooth / scale,
        "cycles": len(cycles.periods),
        "period": defined(np.mean, cycles.periods),
        "period_variation": variation(cycles.periods),
        "period_irregularity": irregularity(cycles.periods),
        "fall_variation": variation(cycles.falls),
        "fall_irregularity": irregularity(cycles.falls),
        "peak_spread": defined(np.std, cycles.peaks, 2) / (2 * amplitude or math.nan),
        "peak_correlation": correlation(cycles.peaks),
        "amplitude_change": change,
        "amplitude_change_error": error,
        "drift": float(np.mean(force[half:]) - np.mean(force[:half])) / scale,
        "fast_share": math.nan,
        "stick_share": math.nan,
        "slips": len(starts),
        "window_start": float(time[0]),
        "window_end": float(time[-1]),
    }
    if not scales.has_velocity:
        moved = math.inf
    elif np.isfinite(velocity).all() and not (
        scales.is_measured and _scatter(velocity) > STICKING * abs(stage.velocity)
    ):
        numbers |= {
            "fast_share": float(np.mean(velocity > abs(stage.velocity))),
            "stick_share": float(np.mean(velocity < STICKING * abs(stage.velocity))),
        }
    is_renewed = moved >= scales.renewal_displacement
    result = RegimeResult(**numbers)  # type: ignore[arg-type]
    regime = _regime(result, [one / scale for one in halves], is_renewed=is_renewed)
    # A prescribed slider neither sticks nor slips.
    if scales.is_rigid and regime in {STICK_SLIP, IRREGULAR}:
        regime = SMOOTH
    return replace(result, regime=regime)


def _regime(found: RegimeResult, halves: list[float], *, is_renewed: bool) -> int:
    """The rules; ``halves`` are the amplitudes in the halves of the window, over the mean force."""
    smooth = found.smooth_amplitude
    if min(halves) <= smooth and max(halves) > SMOOTH_FACTOR * smooth:
        return TRANSIENT
    is_regular = (
        found.cycles >= MIN_CYCLES
        and found.period_irregularity < REGULAR_PERIODS
        and found.fall_irregularity < REGULAR_FALLS
    )
    if found.relative_amplitude <= (SMOOTH_AMPLITUDE if is_regular else smooth):
        return SMOOTH if is_renewed else TRANSIENT
    if found.cycles < MIN_CYCLES:
        return TRANSIENT
    is_certain = abs(found.amplitude_change) > SIGNIFICANCE * found.amplitude_change_error
    if is_certain and abs(found.amplitude_change) > MAX_CHANGE:
        return TRANSIENT
    if found.period_irregularity > IRREGULAR_PERIODS or found.fall_irregularity > IRREGULAR_FALLS:
        return IRREGULAR
    return STICK_SLIP


def _scatter(values: Array) -> float:
    """Median distance from the median, which slips do not change."""
    return float(np.median(np.abs(values - np.median(values))))


def _amplitude(force: Array) -> float:
    low, high = np.percentile(force, [LOW, HIGH])
    return float(high - low) / 2
