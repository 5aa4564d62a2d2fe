"""The rules and thresholds by which a motion is classified."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from mesoslip.analysis.regime.events import (
    MIN_CYCLES,
    Slips,
    correlation,
    defined,
    events_of,
    find_cycles,
    irregularity,
    trend,
    variation,
)
from mesoslip.analysis.regime.result import IRREGULAR, SMOOTH, STICK_SLIP, TRANSIENT, RegimeResult
from mesoslip.analysis.regime.scales import Scales
from mesoslip.analysis.stick_phases import relieved_loading
from mesoslip.array_types import Array

# Maximum amplitude of smooth sliding without noise, over the mean force.
SMOOTH_AMPLITUDE = 0.02
# Percentiles of the force; the amplitude is half their distance.
LOW, HIGH = 5.0, 95.0
# Minimum drop of rare slips in a motion that is not smooth, over twice the amplitude of smooth
# sliding.
DEEP = 2.0
# Minimum share of the time at rest, and of the loading in slips, of a motion that is not smooth
# even if its amplitude is that of the noise of a few contacts.
RESTING = 0.8
# Minimum scale of amplitudes, over the static force; above it the scale is the mean force.
MIN_MEAN = 0.05
# Minimum reversal of the force that ends a cycle, over the distance of the percentiles, and maximum
# distance beyond the percentiles: the force is clipped there, such as in the rebound of a slip.
TURNING = 0.5
MAX_EXCURSION = 0.1
# Maximum variation of periods, and of the falls of the force in a cycle, of stick-slip; and a
# smaller one where the peaks of the force vary by more than a part of the mean fall.
IRREGULAR_PERIODS = IRREGULAR_FALLS = 0.3
IRREGULAR_PEAKS, WITH_PEAKS = 0.07, 0.2
# Maximum variations of an oscillation with the amplitude of noise.
REGULAR_PERIODS = 0.15
REGULAR_FALLS = 0.2
# A motion is transient if its falls change by more than MAX_CHANGE, and by SIGNIFICANCE standard
# errors; if one half of the window is smooth and the amplitude of the other exceeds the limit of
# smooth sliding by SMOOTH_FACTOR; or if the amplitudes of an oscillation in the halves differ by
# HALVES_FACTOR.
MAX_CHANGE = 0.1
SIGNIFICANCE = 4.0
SMOOTH_FACTOR = 1.5
HALVES_FACTOR = 1.5
# Maximum velocity of a sticking slider over that of the drive: pinned contacts let it move at
# K/(K + Nk) of the drive's velocity.
STICKING = 0.5


def classify(
    scales: Scales, time: Array, force: Array, velocity: Array, slips: Slips
) -> RegimeResult:
    """The regime of a motion by its evaluated window and the slips of the realization; an unknown
    velocity [m/s] is NaN."""
    if len(time) < 2 * MIN_CYCLES:
        return RegimeResult()
    stage = scales.stage
    force, velocity = stage.direction * force, stage.direction * velocity
    slips = slips.between(time[0], time[-1], stage.direction)
    mean = float(np.mean(force))
    static = scales.static_force or 1.0
    scale = max(abs(mean), MIN_MEAN * static)
    smooth = SMOOTH_AMPLITUDE * scale + scales.noise_amplitude
    low, high = np.percentile(force, [LOW, HIGH])
    amplitude = float(high - low) / 2
    half = len(force) // 2
    halves = [_amplitude(force[:half]), _amplitude(force[half:])]
    excursion = MAX_EXCURSION * (high - low)
    cycles = find_cycles(
        time, force, np.clip(force, low - excursion, high + excursion), TURNING * (high - low)
    )
    rise = 2 * float(np.mean(force[half:]) - np.mean(force[:half]))
    slip_share = _slip_share(scales, time, force, slips)
    loading = 0.0 if scales.is_measured else scales.loading_rate * (time[-1] - time[0])
    # The rest of the drive's displacement is in the spring.
    moved = abs(stage.velocity) * (time[-1] - time[0])
    if loading > 0:
        moved *= max(0.0, 1 - rise / loading)
    cycles, are_slips = events_of(slips, cycles, loading)
    change, error = trend(cycles.falls)
    numbers = {
        "relative_amplitude": amplitude / static,
        "smooth_amplitude": smooth / static,
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
        "drift": rise / 2 / static,
        "fast_share": math.nan,
        "stick_share": math.nan,
        "slips": len(slips),
        "are_slips": are_slips,
        "slip_share": slip_share,
        "peak_irregularity": irregularity(cycles.peaks, defined(np.mean, cycles.falls)),
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
    result = RegimeResult(force_scale=scales.force_scale, **numbers)  # type: ignore[arg-type]
    regular = SMOOTH_AMPLITUDE * scale / static
    judged = result
    stands_out = scales.is_measured and (
        are_slips or (len(slips) > 0 and len(cycles.periods) < MIN_CYCLES)
    )
    if stands_out or (result.stick_share > RESTING and slip_share > RESTING):
        # Slips that stand out of the noise, or between long rests, are no smooth sliding, however
        # small and few.
        judged, regular = replace(result, smooth_amplitude=0.0), 0.0
    regime = _regime(
        judged, [one / static for one in halves], regular=regular, is_renewed=is_renewed
    )
    # A prescribed slider neither sticks nor slips, nor does a measured one without slips.
    never_slips = scales.is_rigid or (scales.is_measured and not len(slips))
    if never_slips and regime in {STICK_SLIP, IRREGULAR}:
        regime = SMOOTH
    deep = int(np.count_nonzero(slips.drop > DEEP * 2 * smooth))
    if regime == SMOOTH and deep and not (never_slips or scales.is_measured):
        # Percentiles do not see rare slips.
        regime = IRREGULAR if deep > 1 else TRANSIENT
    return replace(result, regime=regime)


def _regime(found: RegimeResult, halves: list[float], *, regular: float, is_renewed: bool) -> int:
    """The regime by statistics, the amplitudes in the halves of the window, and the maximum
    amplitude of a regular oscillation that is smooth, all over the static force."""
    smooth = found.smooth_amplitude
    if min(halves) <= smooth and max(halves) > SMOOTH_FACTOR * smooth:
        return TRANSIENT
    is_regular = (
        found.cycles >= MIN_CYCLES
        and found.period_irregularity < REGULAR_PERIODS
        and found.fall_irregularity < REGULAR_FALLS
    )
    if found.relative_amplitude <= (regular if is_regular else smooth):
        return SMOOTH if is_renewed else TRANSIENT
    if found.cycles < MIN_CYCLES:
        return TRANSIENT
    if not found.are_slips and max(halves) > HALVES_FACTOR * min(halves):
        return TRANSIENT
    is_certain = abs(found.amplitude_change) > SIGNIFICANCE * found.amplitude_change_error
    if is_certain and abs(found.amplitude_change) > MAX_CHANGE:
        return TRANSIENT
    has_peaks = found.peak_irregularity > IRREGULAR_PEAKS
    is_irregular = found.period_irregularity > (
        WITH_PEAKS if has_peaks else IRREGULAR_PERIODS
    ) or found.fall_irregularity > (WITH_PEAKS if has_peaks else IRREGULAR_FALLS)
    return IRREGULAR if is_irregular else STICK_SLIP


def _slip_share(scales: Scales, time: Array, force: Array, slips: Slips) -> float:
    """Falls of the slips without rebounds over the loading; NaN if the slider does not rest."""
    rate = scales.loading_rate
    if not 0 < rate < math.inf:
        return math.nan
    if not len(slips):
        return 0.0
    fallen, loaded = relieved_loading(time, force, slips.start, slips.end, slips.before)
    return fallen / (rate * loaded) if loaded > 0 else math.nan


def _scatter(values: Array) -> float:
    """Median distance from the median, which slips hardly change."""
    return float(np.median(np.abs(values - np.median(values))))


def _amplitude(force: Array) -> float:
    low, high = np.percentile(force, [LOW, HIGH])
    return float(high - low) / 2
