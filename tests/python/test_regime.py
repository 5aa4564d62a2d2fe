"""The regime of motion: its rules, and runs of every kind."""

import dataclasses
import json
import math

import marked_motions
import mesoslip
import numpy as np
import pytest
import regimes
from conftest import drive_in_stages
from mesoslip.analysis.regime.events import NO_SLIPS, Slips
from mesoslip.analysis.regime.result import IRREGULAR, NAMES, REGIME, SMOOTH, STICK_SLIP, TRANSIENT
from mesoslip.analysis.regime.rules import classify
from mesoslip.analysis.regime.scales import Scales
from scipy.stats import norm

TIME = np.linspace(0.0, 1.0, 20001)


def sawtooth(periods, falls):
    """A force that rises in periods [s], and then falls at once."""
    ends = np.cumsum(periods)
    force = np.interp(
        TIME,
        np.ravel([np.concatenate([[0], ends[:-1]]), ends - 1e-4], order="F"),
        np.ravel([1 - np.concatenate([falls[:1], falls[:-1]]), np.ones(len(falls))], order="F"),
    )
    return 1e-5 * force


def result(config, force, velocity=None, slips=NO_SLIPS):
    velocity = np.full(len(TIME), 1e-7) if velocity is None else velocity
    scales = Scales.of_config(config, TIME[-1])
    return classify(scales, TIME, force, velocity, slips)


@pytest.mark.parametrize(("count", "duration"), [(1, 12.0), (1, 30.0), (12, 12.0)])
def test_a_slider_that_rests_between_slips_is_not_smooth(klein, count, duration):
    """However few its contacts, whose noise is large; a rigid one that follows the drive is."""
    changes = {"contacts__count": count, "run__duration": duration, "output__interval": 0.01}
    found = mesoslip.regime(mesoslip.run(klein(**changes)))
    assert found["relative_amplitude"][0] < found["smooth_amplitude"][0]
    assert found["regime"][0] == (TRANSIENT if found["slips"][0] <= 3 else STICK_SLIP)
    changes |= {"slider__stiffness": 2000.0, "contacts__count": 4, "run__duration": 4.0}
    assert mesoslip.regime(mesoslip.run(klein(**changes)))["regime"][0] == SMOOTH


def test_noise_of_steady_contacts_is_smooth(klein):
    """0.6 N^(-1/2) of the static force, which with few contacts is much."""
    rng = np.random.default_rng(1)
    config = klein(contacts__count=100)
    noise = np.convolve(rng.normal(size=len(TIME)), np.ones(20) / np.sqrt(20), "same")
    force = 1e-5 + 0.035 * 18e-6 * noise
    found = result(config, force)
    assert found.regime == SMOOTH
    assert found.relative_amplitude < found.smooth_amplitude
    # The same of ten thousand contacts is more than noise.
    assert result(klein(contacts__count=10_000), force).regime != SMOOTH


@pytest.mark.parametrize(("number", "regime"), [(0, SMOOTH), (1, TRANSIENT), (3, IRREGULAR)])
def test_rare_deep_slips_are_not_smooth(klein, number, regime):
    """Though 5 and 95 % of the force do not see them."""
    force = 1e-5 + 1e-8 * np.random.default_rng(1).normal(size=len(TIME))
    start = 0.1 + 0.13 * np.arange(number)
    for one in start:
        after = (one + 0.001 <= TIME) & (one + 0.005 > TIME)
        force[after] -= 5e-6 * (1 - (TIME[after] - one - 0.001) / 0.004)
    before = np.full(number, 1e-5)
    slips = Slips(start, start + 0.001, before, np.full(number, 5e-6))
    found = result(klein(), force, slips=slips)
    assert found.relative_amplitude < found.smooth_amplitude
    assert found.regime == regime


def test_a_sawtooth_is_stick_slip(klein):
    found = result(klein(), sawtooth(np.full(60, 1 / 50), np.full(60, 0.8)))
    assert found.regime == STICK_SLIP
    assert found.period == pytest.approx(1 / 50, rel=1e-3)
    assert found.period_variation < 0.02
    assert found.relative_amplitude == pytest.approx(0.45 * 0.8 * 10 / 18, rel=0.02)
    assert found.cycles == 49


def test_what_alternates_is_regular(klein):
    """Large and small slips in turn: the periods vary, pairs of them do not."""
    periods, falls = np.tile([0.024, 0.012], 40), np.tile([0.8, 0.4], 40)
    found = result(klein(), sawtooth(periods, falls))
    assert found.regime == STICK_SLIP
    assert found.period_variation > 0.3
    assert found.period_irregularity < 0.02
    assert found.fall_irregularity < 0.02


def test_random_slips_are_irregular(klein):
    rng = np.random.default_rng(2)
    random = result(klein(), sawtooth(rng.exponential(0.015, 400) + 2e-3, np.full(400, 0.8)))
    assert random.regime == IRREGULAR
    falls = np.where(rng.random(100) < 0.5, 0.8, 0.42)
    assert result(klein(), sawtooth(np.full(100, 0.012), falls)).fall_irregularity > 0.25


def test_what_dies_away_is_not_settled(klein):
    config = klein(contacts__count=1_000_000)
    for rate, regime in [
        (0.0, STICK_SLIP),
        (0.05, STICK_SLIP),
        (0.2, TRANSIENT),
        (2.0, TRANSIENT),
        (15.0, TRANSIENT),
    ]:
        force = 1e-5 * (1 + 0.5 * np.exp(-rate * TIME) * np.sin(300 * TIME))
        assert result(config, force).regime == regime
    # Decayed, before and within the window.
    assert result(config, 1e-5 * (1 + np.exp(-60 * TIME - 4))).regime == SMOOTH


def test_a_run_that_ends_too_soon_is_transient(klein):
    assert result(klein(), 1e-5 * TIME).regime == TRANSIENT
    assert result(klein(), sawtooth([0.6, 0.6], [0.8, 0.8])).regime == TRANSIENT
    # The spring has taken most of the displacement of the drive, 20 nm.
    config = klein(drive__velocity=1e-6, contacts__count=50)
    time = 0.02 * TIME
    for share, regime in ((0.95, TRANSIENT), (0.2, SMOOTH)):
        force = 1e-5 + share * config.slider.stiffness * 1e-6 * time
        scales = Scales.of_config(config, time[-1])
        found = classify(scales, time, force, np.ones(len(time)), NO_SLIPS)
        assert found.regime == regime
    # The drive has not moved by a breaking stretch.
    slow = klein(drive__velocity=1e-9)
    assert result(slow, np.full(len(TIME), 1e-5)).regime == TRANSIENT
    scales = Scales.of_config(slow, 0.0)
    assert classify(scales, *np.empty((3, 0)), NO_SLIPS).regime == TRANSIENT


def test_the_rebound_of_a_slip_is_no_cycle(klein):
    """A slip overshoots and swings back at once: samples miss part of the overshoot."""
    rng = np.random.default_rng(3)
    force = sawtooth(np.full(60, 1 / 40), np.full(60, 0.6))
    ends = np.flatnonzero(np.diff(force) < -1e-6)
    for end in ends:
        force[end + 1 : end + 3] -= rng.exponential(3e-5)
    found = result(klein(), force)
    assert found.regime == STICK_SLIP
    assert found.period == pytest.approx(1 / 40, rel=1e-3)
    assert found.fall_irregularity < 0.01


def ringing(periods, decay):
    """Slips after periods [s], each followed by ringing at 200 Hz, and the catalogue of slips."""
    starts = np.cumsum(periods)
    rate, drop = 9e-4, np.diff(starts, prepend=0.0) * 9e-4
    force = rate * TIME
    for start, size in zip(starts, drop, strict=True):
        since = np.maximum(TIME - start, 0.0)
        swing = np.exp(-decay * since) * np.cos(2 * np.pi * 200 * since)
        force = force - np.where(TIME > start, size * (1 - 0.9 * swing), 0.0)
    force += 1e-6
    before = force[np.searchsorted(TIME, starts, "right") - 1]
    return force, Slips(starts, starts + 2.5e-3, before, 1.8 * drop)


def test_ringing_after_slips_is_no_cycle(klein):
    """Its swings are deeper than half the force's range, and three times as many as slips."""
    periods = 0.0375 + 0.004 * np.random.default_rng(4).normal(size=25)
    force, slips = ringing(periods, 50.0)
    # Without a catalogue all swings are cycles.
    assert result(klein(), force).cycles > 2 * len(periods)
    # The drive loads the spring by as much as slips relieve.
    config = klein(drive__velocity=9e-4 / 97.0)
    found = result(config, force, slips=slips)
    assert (found.regime, found.are_slips, found.cycles) == (STICK_SLIP, True, 24)
    assert found.period == pytest.approx(0.0375, rel=0.05)
    assert found.slips == 25
    # The slider swings too much for a rest; where it does rest, the rebound is left out.
    assert math.isnan(found.slip_share)
    force, slips = ringing(periods, 400.0)
    assert result(config, force, slips=slips).slip_share == pytest.approx(1, rel=0.08)
    assert "a slip every 3" in found.summary


def test_oscillations_with_one_slip_have_cycles_of_the_force(klein):
    force = 1e-5 + 3e-6 * np.sin(2 * np.pi * 100 * TIME)
    found = result(klein(), force, slips=Slips(*np.array([[0.5], [0.51], [1.3e-5], [6e-6]])))
    assert (found.regime, found.are_slips, found.slips) == (STICK_SLIP, False, 1)
    assert found.cycles == 99
    assert "99 oscillations of 10" in found.summary


def test_peaks_that_vary_are_irregular(klein):
    """By a tenth of the falls, with periods that vary by a quarter; peaks that alternate are
    regular, and so is either variation alone."""
    rng = np.random.default_rng(5)
    even, random = np.ones(60), rng.uniform(0.57, 1.43, size=60)
    for peaks, periods, regime in [
        (1 + 0.1 * rng.normal(size=60), random, IRREGULAR),
        (1 + 0.1 * np.tile([1, -1], 30), random, STICK_SLIP),
        (1 + 0.03 * rng.normal(size=60), random, STICK_SLIP),
        (1 + 0.1 * rng.normal(size=60), even, STICK_SLIP),
    ]:
        starts = np.cumsum(periods) / 62
        slips = Slips(starts, starts, 1.5e-5 * peaks, np.full(60, 1.5e-5))
        force = sawtooth(np.full(60, 1 / 62), np.full(60, 0.8))
        found = result(klein(), force, slips=slips)
        assert (found.regime, found.are_slips) == (regime, True)
        assert max(found.period_irregularity, found.fall_irregularity) < 0.3


def test_shares_of_sticking_and_of_fast_sliding(klein):
    velocity = np.select([TIME < 0.4, TIME < 0.7], [0.0, 0.7e-7], 2e-7)
    found = result(klein(), sawtooth(np.full(60, 1 / 50), np.full(60, 0.8)), velocity)
    assert found.stick_share == pytest.approx(0.4, abs=1e-3)
    assert found.fast_share == pytest.approx(0.3, abs=1e-3)


def test_velocities_that_are_mostly_noise_have_no_shares(klein):
    """If they were measured; the velocity of a run is exact."""
    run = Scales.of_config(klein(), TIME[-1])
    measured = dataclasses.replace(run, is_measured=True)
    noise = np.random.default_rng(4).standard_normal(len(TIME))
    for scales, deviation, share in (
        (run, 1e-7, norm.cdf(-0.5)),
        (measured, 0.5e-7, norm.cdf(-1.0)),
        (measured, 1e-7, np.nan),
    ):
        force, velocity = np.full(len(TIME), 1e-5), 1e-7 + deviation * noise
        found = classify(scales, TIME, force, velocity, NO_SLIPS)
        assert found.stick_share == pytest.approx(share, abs=0.01, nan_ok=True)


def test_amplitudes_are_fractions_of_the_static_force(klein):
    """A force around 0, of which amplitudes would be many times the mean."""
    found = result(klein(), 9e-6 * np.sin(300 * TIME))
    assert found.relative_amplitude == pytest.approx(0.5 * np.sin(0.45 * np.pi), rel=0.01)
    assert abs(found.drift) < 0.05


def test_layers_are_judged_by_the_force_of_their_slips(klein):
    layers = {"kind": "layered", "mass": 1.47e-3, "stiffness": 97.0, "layers": 4}
    few = {"contacts__count": 300, "contacts__delay": 3e-3, "drive__velocity": 1e-6}
    tree = mesoslip.run(klein(**few, slider=layers, run__duration=3.0, output__interval=2e-4))
    found = mesoslip.regime(tree).isel(realization=0)
    slips = mesoslip.slips(tree)
    inside = slips["start_time"] >= float(found["window_start"])
    assert found["slips"] == inside.sum()
    assert found["are_slips"] == 1
    assert float(found["period"]) == pytest.approx(
        float(slips["waiting_time"].values[inside.values][1:].mean()), rel=0.3
    )
    elastic = tree["elastic_force"].values[0][tree["time"].values >= float(found["window_start"])]
    low, high = np.percentile(elastic, [5, 95])
    assert float(found["relative_amplitude"]) == pytest.approx((high - low) / 2 / 18e-6, rel=0.01)


def test_the_irregular_motion_of_ageing_contacts(klein):
    """Section 15 of the model: the peaks of slips vary by 0.19 of their mean. In 12 s one or two of
    24 runs are taken for stick-slip, in 30 s none."""
    ageing = {"law": "relax", "time": 0.15, "young_force_ratio": 0.2877}
    irregular = klein(
        slider__damping_ratio=0.02,
        slider__stiffness=75.9,
        contacts__coupling="equal",
        contacts__count=100,
        contacts__delay=2.765e-3,
        contacts__threshold__relative_width=0.0316,
        contacts__ageing=ageing | {"young_relative_width": 0.2264},
        drive__velocity=2.32e-6,
        run__duration=30.0,
    )
    assert regime_of(irregular) == [IRREGULAR]


def test_marked_motions():
    """Some of those of the study that an eye has marked, the cheapest of each kind."""
    motions = [one for one in marked_motions.load() if one["kind"] in {"layers", "lattice", "fast"}]
    assert len(marked_motions.load()) == 140
    for one in marked_motions.classified(motions[1::30]):
        assert one.regime in one.marks, one.configuration
        assert one.regime in NAMES


def test_spectra_say_the_same():
    """At 5 of the 360 points of the study, with other random numbers."""
    compared = list(regimes.compare(regimes.points()[151::42], first_seed=9000))
    disagreeing = [one.point for one in compared if one.regime not in one.spectral]
    assert not disagreeing
    assert {SMOOTH, STICK_SLIP} <= {one.regime for one in compared}


def regime_of(config):
    return mesoslip.regime(mesoslip.run(config))["regime"].values.tolist()


def test_kinds_of_runs(klein):
    few = {"contacts__count": 500, "output__interval": 1e-3}
    assert regime_of(klein(**few, run__duration=1.0)) == [TRANSIENT]
    assert regime_of(klein(**few, slider={"kind": "prescribed"}, run__duration=3.0)) == [SMOOTH]
    # The drive of a rigid spring that holds loads nothing.
    hold = klein(contacts__count=10, slider={"kind": "prescribed"}, drive={"velocity": 0.0})
    assert regime_of(hold.replace({"run.duration": 0.1})) == [TRANSIENT]
    smooth = klein(**few, slider__stiffness=200.0, contacts__delay=3e-4, run__realizations=3)
    assert regime_of(smooth) == [SMOOTH] * 3
    layers = {"kind": "layered", "mass": 1.47e-3, "stiffness": 97.0, "layers": 4}
    long = klein(**few, slider=layers, contacts__delay=3e-3, drive__velocity=1e-6)
    assert set(regime_of(long.replace({"run.duration": 4.0}))) <= {STICK_SLIP, IRREGULAR}


def test_a_slider_without_inertia(klein):
    """Soft: all contacts break in step, once in a mean life; stiff and broad: it creeps."""
    soft = klein(
        slider={"kind": "quasistatic", "stiffness": 97.0},
        run__duration=1.0,
        drive__velocity=1e-6,
        contacts__count=500,
    )
    found = mesoslip.regime(mesoslip.run(soft))
    assert found["regime"] == [STICK_SLIP]
    life = mesoslip.derived(soft)["mean_life"].value
    assert float(found["period"][0]) * 1e-6 == pytest.approx(life, rel=0.01)
    stiff = klein(
        slider={"kind": "quasistatic", "stiffness": 1e5},
        run__duration=4.0,
        contacts__threshold__relative_width=0.3,
        contacts__count=500,
    )
    assert regime_of(stiff) == [SMOOTH]


def test_the_last_stage_of_a_drive_that_turns_back_is_evaluated(klein):
    drive = drive_in_stages((4.0, 1e-6), (4.0, -1e-6), (1.0, 0.0))
    few = {"contacts__count": 500, "contacts__delay": 3e-3, "run__duration": 9.0}
    found = mesoslip.regime(mesoslip.run(klein(**few, drive=drive))).isel(realization=0)
    assert found["regime"] == STICK_SLIP
    assert found["window_start"] == pytest.approx(6.0)
    assert found["window_end"] == pytest.approx(8.0)
    alone = mesoslip.regime(
        mesoslip.run(klein(**few | {"run__duration": 4.0}, drive=drive_in_stages((4.0, -1e-6))))
    ).isel(realization=0)
    assert float(found["period"]) == pytest.approx(float(alone["period"]), rel=0.1)
    assert float(found["stick_share"]) == pytest.approx(float(alone["stick_share"]), abs=0.1)


def test_the_dataset_is_cf(klein, tmp_path):
    tree = mesoslip.run(klein(contacts__count=300, run__realizations=2))
    found = mesoslip.regime(tree)
    assert set(found.data_vars) == set(REGIME)
    assert found["regime"].dtype == np.int8
    assert found["regime"].attrs["flag_values"].tolist() == [0, 1, 2, 3]
    assert found["regime"].attrs["flag_values"].dtype == np.int8
    assert found["regime"].attrs["flag_meanings"] == "smooth stick_slip irregular transient"
    assert all(one.dims == ("realization",) for one in found.data_vars.values())
    assert all("units" in one.attrs for one in found.data_vars.values())
    found.to_netcdf(tmp_path / "regime.nc")


def test_command_and_run_say_the_same(klein, tmp_path, command):
    config, output = tmp_path / "few.toml", tmp_path / "few.nc"
    config.write_text(klein(contacts__count=300).to_toml())
    said = command.messages("run", str(config), "-o", str(output))
    printed = command.output("regime", str(output))
    assert f"{output}: {printed.splitlines()[-1]}" in said
    rows = json.loads(command.output("regime", str(output), "--json"))
    assert [one["realization"] for one in rows] == [0]
    data = mesoslip.regime(output)
    assert rows[0]["cycles"] == int(data["cycles"][0])
    said = command.messages("run", str(config), "-o", str(output), "--set", "run.realizations=3")
    counts = said.splitlines()[-1].split(": ")[1].split(", ")
    assert sum(int(one.split()[0]) for one in counts) == 3
    curve = tmp_path / "curve.nc"
    wide = ("--set", "contacts.threshold.relative_width=0.1")
    assert command("curve", str(config), "-o", str(curve), *wide)[0] == 0
    said = command.refusal("regime", str(curve))
    assert "not an output of mesoslip run" in said


def test_long_traces_are_thinned_out(klein, monkeypatch):
    tree = mesoslip.run(klein(contacts__count=300, contacts__delay=3e-3, run__duration=20.0))
    whole = mesoslip.regime(tree)
    monkeypatch.setattr("mesoslip.analysis.regime.outputs.MAX_SAMPLES", 1500)
    thin = mesoslip.regime(tree)
    assert whole["regime"].values == thin["regime"].values
    assert float(thin["period"][0]) == pytest.approx(float(whole["period"][0]), rel=0.02)
