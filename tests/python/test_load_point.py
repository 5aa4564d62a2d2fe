"""Stages found in the displacement of a load point, against the drive that made it."""

import time as clock

import numpy as np
import pytest
from conftest import long
from mesoslip.measured import load_point as stages_of_load_point
from mesoslip.measured.load_point import drive_stages
from mesoslip.measured.output_groups import stage_group

UM = 1e-6


def load_point(stages, rates, noise=0.0, step=0.0, seed=0):
    """Times and displacement of stages (duration, velocity at start, at end) with noise and digits.

    ``rates`` are the sampling rates, each of an equal part of the record, or one.
    """
    total = sum(one[0] for one in stages)
    rates = np.atleast_1d(rates)
    edges = np.linspace(0, total, rates.size + 1)
    parts = zip(edges, edges[1:], rates, strict=False)
    time = np.concatenate([np.arange(start, end, 1 / rate) for start, end, rate in parts])
    value, begin, at = np.zeros_like(time), 0.0, 0.0
    for duration, first, last in stages:
        since = np.clip(time - begin, 0, duration)
        inside = time >= begin
        value[inside] = (at + first * since + (last - first) / (2 * duration) * since**2)[inside]
        begin, at = begin + duration, at + 0.5 * (first + last) * duration
    value += noise * np.random.default_rng(seed).standard_normal(time.size)
    return time, np.round(value / step) * step if step else value


def check(found, stages, tolerance=0.01, late=0.1):
    """Kinds, velocities and times as they were."""
    assert len(found) == len(stages), [(one.kind, one.start, one.velocity) for one in found]
    begin = 0.0
    for one, (duration, first, last) in zip(found, stages, strict=True):
        assert one.kind == ("ramp" if first != last else "steady" if first else "hold")
        size = tolerance * max(abs(first), abs(last)) + 3 * one.velocity_error
        assert one.start_velocity == pytest.approx(first, abs=size)
        assert one.end_velocity == pytest.approx(last, abs=size)
        assert one.start == pytest.approx(begin, abs=late)
        begin += duration
        assert one.end == pytest.approx(begin, abs=late + 0.11)


@pytest.mark.parametrize("ratio", [1.5, long(10.0), 1000.0])
@pytest.mark.parametrize("noise", [0.0, 0.05 * UM])
@pytest.mark.parametrize("step", [0.0, 0.1 * UM])
@pytest.mark.parametrize("rates", [long(10), (10, 100)])
def test_a_step_of_the_velocity(ratio, noise, step, rates):
    """The velocities agree within their errors, and the time to a tenth of a second."""
    stages = [(60, UM, UM), (60, ratio * UM, ratio * UM)]
    found = drive_stages(*load_point(stages, rates, noise, step))
    check(found, stages, late=0.4 if step or noise else 0.06)


def test_a_step_down_after_a_fast_stage():
    stages = [(100, 0.1 * UM, 0.1 * UM), (10, 100 * UM, 100 * UM), (100, 0.1 * UM, 0.1 * UM)]
    found = drive_stages(*load_point(stages, 100, 0.05 * UM, 0.1 * UM))
    check(found, stages)


def test_holds():
    """At rest exactly, though the record is noisy."""
    stages = [(20, 10 * UM, 10 * UM), (100, 0, 0), (20, 10 * UM, 10 * UM), (300, 0, 0)]
    stages.append((20, 10 * UM, 10 * UM))
    check(drive_stages(*load_point(stages, 10, 0.1 * UM, 0.02 * UM)), stages)
    check(drive_stages(*load_point(stages, 10)), stages)


def test_ramps():
    """They join the velocities beside them."""
    stages = [(20, UM, UM), (30, UM, 10 * UM), (20, 10 * UM, 10 * UM), (10, 10 * UM, 0)]
    stages += [(30, 0, 0), (20, 0, 5 * UM)]
    found = drive_stages(*load_point(stages, 100, 0.1 * UM, 0.02 * UM))
    check(found, stages, late=0.2)
    assert found[1].start_velocity == found[0].end_velocity
    assert found[1].end_velocity == found[2].start_velocity


def test_reversals():
    stages = [(20, UM, UM), (20, -UM, -UM), (30, 3 * UM, 3 * UM)]
    check(drive_stages(*load_point(stages, 1000, 0.1 * UM, 0.02 * UM)), stages)


def test_wander_of_the_drive_is_no_stage():
    """A drive that wanders by some percent, and one that stops for a moment and catches up."""
    time, value = load_point([(100, 3 * UM, 3 * UM)], 10, 0.02 * UM)
    found = drive_stages(time, value + 0.5 * UM * np.sin(2 * np.pi * time / 30))
    assert [one.kind for one in found] == ["steady"]
    late = np.interp(time, [50, 51, 51.5, 52], [0, -1.5 * UM, -1.5 * UM, 0])
    assert [one.kind for one in drive_stages(time, value + late)] == ["steady"]


def test_errors_of_velocities_cover_the_velocities():
    """With noise that is correlated from sample to sample too."""
    pulls = []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        time, value = load_point([(50, UM, UM), (50, 3 * UM, 3 * UM)], 10)
        noise = np.convolve(rng.standard_normal(time.size + 9), np.full(10, 0.1), "valid")
        found = drive_stages(time, value + 0.1 * UM * noise)
        assert len(found) == 2
        pulls += [
            (one.velocity - velocity) / one.velocity_error
            for one, velocity in zip(found, (UM, 3 * UM), strict=True)
        ]
    assert 0.6 < np.std(pulls) < 1.5


@pytest.mark.parametrize(("noise", "step"), [(0.1 * UM, 0.0), (0.0, 0.1 * UM)])
def test_the_noise_of_a_sample(noise, step):
    """Of samples at unequal times, and of digital steps, whose noise is that of rounding."""
    rng = np.random.default_rng(1)
    time = np.cumsum(rng.uniform(0.5, 1.5, 50_000))
    value = 0.013 * UM * time + noise * rng.standard_normal(time.size)
    value = np.round(value / step) * step if step else value
    deviation, found = stages_of_load_point._sample_noise(time, value)
    assert deviation == pytest.approx(noise or step / np.sqrt(12), rel=0.03)
    assert found == pytest.approx(step, abs=1e-3 * UM)


def test_what_cannot_have_stages():
    assert drive_stages(np.arange(2.0), np.arange(2.0)) == ()
    still = drive_stages(np.arange(50.0), np.zeros(50))
    assert [one.kind for one in still] == ["hold"]
    value = np.arange(50.0) * UM
    value[10:20] = np.nan
    assert [one.kind for one in drive_stages(np.arange(50.0), value)] == ["steady"]


def test_a_million_samples_take_seconds():
    stages = [(400, 3 * UM, 3 * UM), (300, 10 * UM, 10 * UM), (100, 0, 0), (200, 30 * UM, 30 * UM)]
    record = load_point(stages, 1000, 0.1 * UM, 0.02 * UM)
    start = clock.process_time()
    check(drive_stages(*record), stages)
    assert clock.process_time() - start < 5


def test_stages_as_a_group():
    stages = [(20, UM, UM), (20, 0, 0)]
    table = stage_group(drive_stages(*load_point(stages, 10, 0.01 * UM)))
    assert table.sizes["stage"] == 2
    np.testing.assert_array_equal(table["stage_number"], [0, 1])
    assert table["drive_velocity_error"].attrs["units"] == "m s-1"
    assert table["drive_start_velocity"].values[1] == 0
