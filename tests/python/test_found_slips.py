"""Slips found in traces with noise of every kind, and what lies between them."""

import math

import mesoslip
import numpy as np
import pytest
from conftest import klein_tables, long
from made_records import judge, made_record
from mesoslip.analysis.alternating_extremes import extremes_of
from mesoslip.analysis.rate_and_state.points import Loading
from mesoslip.analysis.regime.result import SMOOTH, STICK_SLIP, TRANSIENT
from mesoslip.analysis.sampled_slips import find_slips, windows
from mesoslip.analysis.sampled_slips.windows import Windows, lines_through, parabolas_through
from mesoslip.analysis.stick_phases import stick_phases
from oracles import Friction, spring_slider
from scipy.signal import lfilter

STATIC_FORCE = 18e-6


def turns(values, threshold: float) -> list[tuple[float, float]]:
    """Falls by a walk along the trace that turns when it returns by more than a threshold."""
    falls, direction, high, low = [], 0, 0, 0
    start = None
    for at, value in enumerate(values):
        high = at if value > values[high] else high
        low = at if value < values[low] else low
        if direction >= 0 and values[high] - value > threshold:
            start, direction, low = high, -1, at
        elif direction <= 0 and value - values[low] > threshold:
            if direction < 0:
                falls.append((values[start], values[low]))
            direction, high = 1, at
        if direction == 1:
            low = at
        if direction == -1:
            high = at
    return falls + ([(values[start], values[low])] if direction < 0 else [])


@pytest.mark.parametrize("seed", range(8))
def test_falls_of_all_thresholds_are_those_of_a_walk(seed):
    rng = np.random.default_rng(seed)
    values = np.cumsum(rng.standard_normal(400))
    if seed % 2:
        values = np.round(values)
    extremes = extremes_of(values)
    for threshold in (0.0, 0.5, 1.3, 4.0, 9.0, 40.0):
        tops, bottoms = extremes.falls(threshold)
        found = list(zip(values[tops], values[bottoms], strict=True))
        assert found == turns(values, threshold)
        assert (extremes.fall_sizes > threshold).sum() == len(found)


def test_lines_and_parabolas_through_windows_are_those_of_numpy():
    rng = np.random.default_rng(1)
    time = 5.0 + np.cumsum(rng.random(300))
    values = 40 + np.cumsum(rng.standard_normal(300))
    first, size = np.array([0, 12, 200]), np.array([9, 150, 5])
    at = first + size - 2
    some = Windows(first, size)
    lines = lines_through(time, values, some, time[at])
    parabolas = parabolas_through(time, values, some, at)
    for number, part in enumerate(np.split(some.samples, some.starts[1:])):
        line = np.polynomial.Polynomial.fit(time[part], values[part], 1)
        assert lines.level[number] == pytest.approx(line(time[at[number]]), rel=1e-12)
        assert lines.slope[number] == pytest.approx(line.deriv()(0.0), rel=1e-9)
        deviation = np.std(values[part] - line(time[part]))
        assert lines.deviation[number] == pytest.approx(deviation, rel=1e-9)
        curve = np.polynomial.Polynomial.fit(time[part], values[part], 2)
        assert parabolas[number] == pytest.approx(curve(time[at[number]]), rel=1e-12)


def test_slips_do_not_depend_on_how_many_samples_are_evaluated_at_once(monkeypatch):
    time = 0.001 * np.arange(1500)
    force = np.minimum(time % 0.12, 6 * (0.12 - time % 0.12))
    force += 0.004 * np.random.default_rng(2).standard_normal(1500)
    found = find_slips(time, force)
    monkeypatch.setattr(windows, "MAX_SAMPLES", 20)
    again = find_slips(time, force)
    assert len(found) == 12
    np.testing.assert_array_equal(found.start_time, again.start_time)
    np.testing.assert_array_equal(found.counts.mirrored_count, again.counts.mirrored_count)
    np.testing.assert_allclose(found.force_before, again.force_before, rtol=1e-12)


NOISES = {
    "digital": lambda force, level, rng: (
        np.round((force + level * rng.standard_normal(force.size)) / (3 * level)) * (3 * level)
    ),
    "impulsive": lambda force, level, rng: (
        force
        + level * rng.standard_normal(force.size)
        + 20 * level * (rng.random(force.size) < 0.01) * rng.choice([-1, 1], force.size)
    ),
    "hum": lambda force, level, rng: (
        force
        + level * rng.standard_normal(force.size)
        + 5 * level * np.sin(0.1 * np.pi * np.arange(force.size) + 1)
    ),
    "drift": lambda force, level, rng: (
        force
        + level * rng.standard_normal(force.size)
        + 0.2 * STATIC_FORCE * np.sin(np.linspace(0, 4, force.size))
    ),
}


@pytest.fixture(scope="module", params=["Klein", "fast"])
def run(request):
    changes = {"run__duration": 8.0}
    if request.param == "fast":
        changes = {"drive__velocity": 1e-6, "run__duration": 2.0}
    return mesoslip.run(klein_tables(**changes))


@pytest.mark.parametrize("kind", NOISES)
@pytest.mark.parametrize("relative", [5e-4, long(5e-3)])
def test_slips_under_every_noise_are_those_of_the_exact_catalogue(run, kind, relative):
    exact, time = mesoslip.slips(run), run["time"].values
    level = relative * STATIC_FORCE
    force = NOISES[kind](run["spring_force"].values[0], level, np.random.default_rng(1))
    found = find_slips(time, force)
    overlap = (found.start_time[:, None] < exact["end_time"].values) & (
        found.end_time[:, None] > exact["start_time"].values
    )
    visible = exact["force_drop"].values > 12 * level
    assert overlap.any(axis=0)[visible].all()
    assert (overlap.sum(axis=1) == 1).all()


@pytest.mark.parametrize("noise", [0.0, 1e-5, 1e-4, 1e-3])
def test_rate_and_state_has_its_eight_slips(noise):
    """Slips of a slider that knows no setup period, with and without noise."""
    law = Friction(0.6, 1e-5, 0.010, 0.015, 1e-6)
    period = 8.3
    time = np.linspace(0, 8.2 * period, 30_000)
    stages = [Loading(1.0, 1e-5, 1.05e-5), Loading(time[-1], 1.05e-5, 1.05e-5)]
    motion = spring_slider(law, stages, time, 1000.0, damping=0.2)
    force = motion.force + noise * np.random.default_rng(1).standard_normal(time.size)
    tops, _ = extremes_of(motion.force).falls(0.01)
    wanted = time[tops]
    found = find_slips(time, force)
    assert len(wanted) >= 8
    assert len(found) == len(wanted)
    np.testing.assert_allclose(found.start_time, wanted, atol=0.15)


def test_noise_alone_and_its_colours_have_no_slips():
    rng = np.random.default_rng(1)
    time = 1e-3 * np.arange(100_000)
    for force in (
        rng.standard_normal(time.size),
        np.convolve(rng.standard_normal(time.size + 9), np.full(10, 0.3), "valid"),
    ):
        assert len(find_slips(time, 100 + force)) == 0


@pytest.mark.parametrize(("repetitions", "max_with_slips"), [(2, 1), long(5, 3)])
def test_smooth_sliding_with_slowly_varying_noise_has_hardly_any_slips(repetitions, max_with_slips):
    """Noise correlated over more samples than the estimate of noise can see.

    Few deep falls may all follow slow rises by chance.
    """
    rng = np.random.default_rng(0)
    time = 1e-2 * np.arange(10_000)
    with_slips = 0
    for samples in (10, 50, 100, 200) * repetitions:
        memory = np.exp(-1 / samples)
        gain = np.sqrt(1 - memory**2)
        varying = lfilter([gain], [1, -memory], rng.standard_normal(time.size + 2000))[2000:]
        noise = 1e-3 * varying + 2e-4 * rng.standard_normal(time.size)
        with_slips += len(find_slips(time, 0.6 + noise)) > 0
    assert with_slips <= max_with_slips


@pytest.mark.parametrize("evolution", [0.006, 0.015])
def test_the_peak_after_a_velocity_step_is_no_slip(evolution):
    """The force rises fast with the drive, and decays slowly, above and below its old value."""
    law = Friction(0.6, 1e-6, 0.010, evolution, 3e-5)
    stages = [Loading(10.0, 1e-6, 1e-6), Loading(60.0, 1e-5, 1e-5)]
    time = np.linspace(0, 60, 6000)
    force = spring_slider(law, stages, time, 5000.0).force
    assert force.max() - force[-1] > 0.005
    for level in (0.0, 1e-5, 2e-4):
        noise = level * np.random.default_rng(1).standard_normal(time.size)
        assert len(find_slips(time, force + noise)) == 0


@pytest.mark.parametrize("noise", [0.02, 0.1, 0.3])
def test_ringing_after_slips_is_no_slip(noise):
    """One to three more cycles about a constant force, that rise 2.5 times as fast as loading."""
    rng = np.random.default_rng(1)
    step, period, loading, low = 1e-3, 0.02, 170.0, -1.0
    pieces: list[np.ndarray] = []
    for _ in range(40):
        top = rng.uniform(3.5, 6.5)
        phase = np.arange(0, 2 * np.pi * (rng.integers(1, 4) + 0.5), 2 * np.pi * step / period)
        ringing = top * np.exp(-0.03 * phase) * np.cos(phase)
        pieces += [np.arange(low, top, loading * step), ringing]
        low = ringing[-1]
    force, wanted = np.concatenate(pieces), np.cumsum([one.size for one in pieces])[::2]
    found = find_slips(
        step * np.arange(force.size), force + noise * rng.standard_normal(force.size)
    )
    assert abs(len(found) - 40) <= 1
    near = np.abs(found.start_time[:, None] - step * wanted).min(axis=0)
    assert (near < period / 4).all()


def test_two_sampling_rates_in_one_record():
    """The same slips where the recorder was ten times as fast for a part."""
    tree = mesoslip.run(klein_tables(run__duration=8.0, output__interval=2e-4))
    time, force = tree["time"].values, tree["spring_force"].values[0]
    rng = np.random.default_rng(1)
    kept = (time > 4) | (np.arange(time.size) % 10 == 0)
    exact = mesoslip.slips(tree)["start_time"].values
    found = find_slips(time[kept], (force + 3e-8 * rng.standard_normal(force.size))[kept])
    np.testing.assert_allclose(found.start_time, exact, atol=0.01)


def test_long_traces_take_a_time_proportional_to_their_length():
    import time as clock

    time = 1e-3 * np.arange(200_000)
    force = np.interp(time % 0.71, [0, 0.7, 0.71], [1.0, 1.7, 1.0])
    force += 0.003 * np.random.default_rng(1).standard_normal(time.size)
    start = clock.process_time()
    found = find_slips(time, force)
    assert len(found) == 281
    assert clock.process_time() - start < 3


def test_loading_and_creep_of_a_sawtooth():
    """Loading by K V, and creep over the last fifth of each stick phase."""
    stiffness, velocity = 100.0, 1e-4
    time = 1e-3 * np.arange(10_000)
    phase = time % 1.0
    # The slider creeps at a quarter of the drive's velocity from 0.8 s on, and slips from 0.98 s.
    creep = 0.25 * velocity * np.clip(phase - 0.8, 0, 0.18)
    moved = np.where(phase < 0.98, creep, creep + (phase - 0.98) / 0.02 * 0.95 * velocity)
    drive = velocity * time
    period = np.floor(time + 1e-9)
    force = stiffness * (drive - moved - 0.995 * velocity * period)
    ends = np.arange(1, 10) - 1e-3
    starts = np.arange(1, 10) - 0.02
    before = np.interp(starts, time, force)
    for given in (stiffness, np.nan):
        for sign in (1, -1):
            found = stick_phases(
                time,
                sign * force,
                starts,
                ends,
                sign * before,
                drive=sign * drive,
                stiffness=given,
            )
            assert np.isnan(found.loading_rate[0])
            np.testing.assert_allclose(found.stick_duration[1:], 0.981, rtol=1e-6)
            np.testing.assert_allclose(found.loading_rate[1:], sign * stiffness * velocity)
            np.testing.assert_allclose(found.loading_stiffness[1:], stiffness)
            wanted = found.creep_displacement[1:]
            np.testing.assert_allclose(wanted, 0.25 * velocity * 0.18, rtol=1e-6)
            # The creep is measured from the first sample after a tenth of the phase.
            since = 0.981 - np.ceil(98.1) * 1e-3
            np.testing.assert_allclose(
                found.creep_share[1:], wanted / (since * velocity), rtol=2e-3
            )


@pytest.mark.parametrize(("delay", "damping_ratio"), [(5e-3, 0.2), (2e-2, 0.02)])
def test_creep_begins_after_the_rebound(delay, damping_ratio):
    """The slider overshoots by as much as the drive loads; a weakly damped one never rests."""
    changes = {"contacts__delay": delay, "slider__damping_ratio": damping_ratio}
    changes |= {"contacts__count": 500, "drive__velocity": 1e-6, "run__duration": 1.0}
    tree = mesoslip.run(klein_tables(**changes))
    found = mesoslip.slips(tree)
    share = found["creep_share"].values[1:]
    assert share.size >= 2
    in_slips = mesoslip.response(tree, fit=False)["steady/slip_share"].item()
    in_window = mesoslip.regime(tree)["slip_share"].item()
    if damping_ratio < 0.1:
        assert np.isnan(share).all()
        assert math.isnan(in_slips)
        assert math.isnan(in_window)
    else:
        # Drops with their rebounds add up to 1.5 of the loading; the rest is that of creep.
        assert in_slips == pytest.approx(1 - np.median(share), abs=0.1)
        assert in_window == pytest.approx(in_slips, abs=0.1)
        # Pinned contacts stretch by K/(K + Nk) of the drive; only some break before a slip.
        assert np.all(share > 0.8 * 97 / 2097)
        assert np.median(share) < 0.15


@pytest.mark.parametrize("number", [7, 46, 66, 166, 206])
def test_slips_of_made_records(number):
    """Falls of all sizes, noise of every kind; tests/studies/made_records.py has 300 records."""
    found = judge(made_record(number))
    visible = found.drop > 12
    assert found.is_found[visible].mean() > 0.8
    assert found.is_right.mean() > 0.9


@pytest.mark.parametrize("number", [8, 9, 19, 48])
def test_made_records_without_slips(number):
    assert len(judge(made_record(number)).is_right) == 0


@pytest.mark.parametrize("shape", ["oscillation", "sawtooth", "noise"])
def test_a_given_minimum_fall_is_obeyed(shape):
    """No other rule vetoes it: falls above it count, with and without asymmetry and noise."""
    rng = np.random.default_rng(1)
    time = 1e-3 * np.arange(8_000)
    phase = time % 0.1
    force = {
        "oscillation": np.sin(2 * np.pi * time / 0.1),
        "sawtooth": np.interp(phase, [0, 0.09, 0.1], [-1, 1, -1]),
        "noise": lfilter([0.2], [1, -0.98], rng.standard_normal(time.size)),
    }[shape]
    found = find_slips(time, force + 0.01 * rng.standard_normal(time.size), min_fall=0.8)
    if shape == "noise":
        assert len(found) > 4
    else:
        assert abs(len(found) - 80) <= 1
    assert found.min_fall == 0.8
    # The table of counts has a row for it.
    at = np.flatnonzero(found.counts.threshold == 0.8)
    assert found.counts.count[at].tolist() == [len(found)]
    assert (np.diff(found.counts.threshold) > 0).all()


def test_small_slips_are_stick_slip_and_smooth_sliding_has_none(tmp_path):
    """One definition for slips and regime: a drop of .0053 of .6 above the noise, and noise."""
    time = 1e-2 * np.arange(8_000)
    saw = np.interp(time % 5.0, [0, 4.8, 5.0], [0, 0.0053, 0])
    noise = 2e-4 * np.random.default_rng(1).standard_normal(time.size)
    found = {}
    for name, force in {"slips": 0.6 + saw + noise, "smooth": 0.6 + noise}.items():
        path = tmp_path / f"{name}.csv"
        np.savetxt(path, np.stack([time, force], axis=1), "%.6f", ",", header="time [s],mu")
        tree = mesoslip.read_trace(path, velocity=1e-6)
        found[name] = mesoslip.regime(tree)["regime"].item(), tree["slips"].sizes["slip"]
        counts = tree["slip_counts"]
        assert counts["mirrored_count"].sizes == counts["slip_count"].sizes
    assert found == {"slips": (STICK_SLIP, 16), "smooth": (SMOOTH, 0)}


@pytest.mark.parametrize("slips", [2, 7])
def test_small_slips_too_few_for_a_regime_are_not_smooth(slips, tmp_path):
    """As the evaluated half of the record has fewer than four."""
    time = np.arange(0.0, 10.0 * (slips + 1), 0.02)
    noise = np.random.default_rng(1).normal(0, 1e-8, time.size)
    force = 6e-4 + 5.3e-6 * (time / 10 % 1) + noise
    path = tmp_path / "few.csv"
    columns = np.column_stack([time, force])
    np.savetxt(path, columns, header="time [s],force [N]", comments="", delimiter=",")
    tree = mesoslip.read_trace(path, velocity=1e-6)
    assert tree["slips"].sizes["slip"] == slips
    assert mesoslip.regime(tree)["regime"].item() == TRANSIENT


@pytest.mark.parametrize("noise", [0.001, 0.05, 0.08])
def test_sudden_falls_end_where_they_have_fallen(noise):
    """Not at the minimum of the noise after them, nor before the end of a slow fall."""
    at = np.arange(6000)
    rng = np.random.default_rng(3)
    trace = np.where(at % 100 == 0, 0.0, (at % 100) / 100) + noise * rng.standard_normal(at.size)
    found = find_slips(1e-3 * at, trace)
    assert found.first.size >= 55
    assert np.mean(found.last - found.first <= 2) > 0.95
    assert np.abs((found.first + found.last) / 2 % 100 - 50).min() > 45
    # Not less than the mean rate.
    durations = 1e-3 * (found.last - found.first)
    drops = found.force_before - found.force_after
    assert (found.fall_rate >= drops / durations * (1 - 1e-9)).all()
    # A fall of half a sine in 20 samples.
    phase = at % 120
    slow = np.where(phase < 100, phase / 100, 0.5 + 0.5 * np.cos(np.pi * (phase - 100) / 20))
    found = find_slips(1e-3 * at, slow + noise / 5 * rng.standard_normal(at.size))
    assert np.median(found.last - found.first) == pytest.approx(20, abs=4)
