"""The noise of a trace: each kind as it was put in, on a sawtooth; errors against many draws."""

import numpy as np
import pytest
from mesoslip.analysis.even_traces import power_spectrum
from mesoslip.analysis.noise import estimate_noise, parts_of
from scipy.signal import lfilter, welch

COUNT = 40_000
TIME = 1e-3 * np.arange(COUNT)
# Force grows for 0.7 s and falls within 10 ms.
SAW = np.interp(TIME % 0.71, [0, 0.7, 0.71], [1.0, 1.7, 1.0])
WHITE = 0.003


def white(seed: int = 1, deviation: float = WHITE):
    return deviation * np.random.default_rng(seed).standard_normal(COUNT)


def coloured(deviation: float, samples: float, seed: int = 2):
    """Noise whose autocorrelation decays by e in so many samples."""
    ratio = np.exp(-1 / samples)
    start = np.random.default_rng(seed).standard_normal(COUNT + 1000)
    return deviation * lfilter([np.sqrt(1 - ratio**2)], [1, -ratio], start)[1000:]


@pytest.mark.parametrize("length", [64, 255, 4096, 100_000])
def test_power_spectra_are_those_of_scipy(length):
    values = SAW + coloured(0.1, 20)
    for found, wanted in zip(
        power_spectrum(values, 1e-3, length),
        welch(values, fs=1e3, nperseg=min(length, COUNT)),
        strict=True,
    ):
        np.testing.assert_allclose(found, wanted, rtol=1e-9, atol=1e-18)


@pytest.mark.parametrize("deviation", [1e-4, 1e-3, 1e-2])
def test_white_noise_and_nothing_else(deviation):
    noise = estimate_noise(TIME, SAW + white(deviation=deviation))
    assert noise.deviation == pytest.approx(deviation, rel=0.05)
    assert noise.correlated_deviation == 0
    assert noise.impulse_share < 1e-4
    assert noise.hum == ()
    assert noise.drift == 0
    assert noise.digital_step == 0
    assert len(noise.sentences()) == 1 + (noise.impulse_share > 0)


@pytest.mark.parametrize("step", [2e-3, 1e-2, 5e-2])
def test_digital_steps(step):
    noise = estimate_noise(TIME, np.round((SAW + white()) / step) * step)
    assert noise.digital_step == pytest.approx(step, rel=1e-6)
    assert noise.deviation >= 0.99 * step / np.sqrt(12)
    assert noise.impulse_share < 1e-3


def test_impulses_are_found_and_replaced():
    rng = np.random.default_rng(3)
    hit = rng.random(COUNT) < 0.01
    force = SAW + white() + hit * rng.choice([-1, 1], COUNT) * 20 * WHITE
    noise = estimate_noise(TIME, force)
    found = noise.is_impulse(TIME)
    assert (found & hit).sum() > 0.95 * hit.sum()
    assert (found & ~hit).sum() < 0.02 * hit.sum()
    assert noise.impulse_size == pytest.approx(20 * WHITE, rel=0.05)
    assert noise.deviation == pytest.approx(WHITE, rel=0.05)
    cleaned = noise.clean(TIME, force)
    assert np.abs(cleaned - SAW)[found].max() < 8 * WHITE
    np.testing.assert_array_equal(cleaned[~found], force[~found])
    # Of an excerpt as of the whole.
    part = slice(5000, 9000)
    np.testing.assert_array_equal(noise.clean(TIME[part], force[part])[:3000], cleaned[5000:8000])


def test_slips_and_ringing_are_no_impulses():
    """Neither corners of a trace without noise, nor five samples in a period."""
    ringing = 0.1 * np.exp(-(TIME % 0.71) / 0.05) * np.cos(2 * np.pi * TIME / 5.3e-3)
    for force in (SAW, SAW + ringing, np.cos(2 * np.pi * TIME / 0.024)):
        assert estimate_noise(TIME, force).impulse_share < 2e-4


@pytest.mark.parametrize("given", [None, 50.0])
def test_hum_is_found_with_its_harmonic(given):
    hum = 0.01 * np.sin(2 * np.pi * 50.02 * TIME + 0.3) + 0.004 * np.sin(2 * np.pi * 150.06 * TIME)
    noise = estimate_noise(TIME, SAW + white() + hum, hum=given)
    assert [one.frequency for one in noise.hum] == pytest.approx([50.02, 150.06], rel=1e-3)
    assert [one.amplitude for one in noise.hum] == pytest.approx([0.01, 0.004], rel=0.15)
    rest = noise.clean(TIME, SAW + hum) - SAW
    assert np.std(rest) < 0.15 * np.std(hum)


def test_what_is_the_trace_s_own_is_no_hum():
    """Regular slips have lines at multiples of their frequency; so has ringing after them."""
    ringing = 0.1 * np.exp(-(TIME % 0.71) / 0.05) * np.cos(2 * np.pi * (TIME % 0.71) / 0.02)
    for force in (SAW, SAW + ringing, np.cos(2 * np.pi * TIME / 0.029)):
        assert estimate_noise(TIME, force + white(deviation=1e-3)).hum == ()


def test_drift():
    noise = estimate_noise(TIME, SAW + white() + 0.02 * TIME)
    assert noise.drift == pytest.approx(0.02, rel=0.1)


@pytest.mark.parametrize(("sign", "drift"), [(1, 0.0), (-1, 0.0), (1, 0.02)])
def test_a_first_loading_is_no_drift(sign, drift):
    """A trace that starts relaxed: half of it is loading."""
    loading = np.minimum(TIME / TIME[-1] * 2, 1.0) * 5.0
    noise = estimate_noise(TIME, sign * (loading + SAW) + white() + drift * TIME)
    assert noise.drift == pytest.approx(drift, rel=0.25)


@pytest.mark.parametrize("samples", [4.0, 15.0])
def test_correlated_noise_beside_white_noise(samples):
    noise = estimate_noise(TIME, SAW + white() + coloured(0.01, samples))
    assert noise.total_deviation == pytest.approx(np.hypot(0.01, WHITE), rel=0.2)
    assert noise.correlation_time == pytest.approx(1e-3 * samples, rel=0.5)


def test_a_rate_that_changes_has_parts():
    time = np.concatenate([0.1 * np.arange(500), 50 + 0.01 * np.arange(6000)])
    parts = parts_of(time)
    assert [(one.first, one.after) for one in parts] == [(0, 500), (500, 6500)]
    assert [one.interval for one in parts] == pytest.approx([0.1, 0.01])
    # Neither a gap nor jitter is another rate.
    jitter = np.sort(TIME + 2e-4 * np.random.default_rng(1).random(COUNT))
    assert len(parts_of(jitter)) == 1
    assert len(parts_of(np.delete(TIME, slice(2000, 2400)))) == 1


@pytest.mark.parametrize("samples", [0.0, 10.0])
def test_errors_of_means_and_slopes_know_the_correlation(samples):
    """Against the scatter over windows of the noise itself."""
    alone = white() + (coloured(0.01, samples) if samples else 0.0)
    noise = estimate_noise(TIME, SAW + alone)
    windows, time = alone.reshape(-1, 200), TIME[:200]
    assert noise.mean_error(time) == pytest.approx(np.std(windows.mean(axis=1)), rel=0.35)
    slopes = np.polyfit(time, windows.T, 1)[0]
    assert noise.slope_error(time) == pytest.approx(np.std(slopes), rel=0.35)
