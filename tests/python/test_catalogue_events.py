"""The b-value, Omori's decay, and a second channel beside slips."""

import json

import mesoslip
import numpy as np
import pytest
import xarray as xr
from event_coverage import sequence, sizes
from mesoslip.analysis.events.channel import emissions_of
from mesoslip.analysis.events.laws import b_value, omori
from mesoslip.errors import ConfigError, FileError


def test_b_value_of_a_complete_catalogue():
    """Aki's estimate by hand, and its error for an exponential law, b / sqrt(n)."""
    made = sizes(np.random.default_rng(1), 1.2, 4000)
    found = b_value(made, completeness=0.0)
    assert found.value == pytest.approx(np.log10(np.e) / np.log10(made).mean() * 3999 / 4000)
    assert found.error == pytest.approx(found.value / np.sqrt(4000), rel=0.1)
    assert abs(found.value - 1.2) < 3 * found.error
    assert found.p_value > 0.05


def test_completeness_is_above_what_is_missing():
    """Detection grows around 0.5: the fit begins above it, and is right; one from 0 on is not."""
    made = sizes(np.random.default_rng(2), 1.0, 3000, blur=0.15)
    found = b_value(made)
    assert 0.5 < found.completeness < 1.1
    assert abs(found.value - 1.0) < 3 * found.error
    assert b_value(made, completeness=0.0).p_value < 0.05
    assert b_value(made[:10]) is None


@pytest.mark.parametrize(("count", "max_error"), [(190, 0.6), (3000, 0.1)])
def test_large_b_values_with_a_gradual_detection(count, max_error):
    """Few events are all fitted, with their detection; of many, those above the completeness."""
    rng = np.random.default_rng(4)
    found = [b_value(sizes(rng, 1.5, count, blur=0.2)) for _ in range(8)]
    assert all((one.count == count) == (count < 200) for one in found)
    assert all(abs(one.value - 1.5) < 3 * one.error for one in found)
    bias = np.mean([(one.value - 1.5) / one.error for one in found])
    assert abs(bias) < 3 / np.sqrt(8)
    assert np.median([one.error for one in found]) < max_error


def test_a_fit_that_cannot_tell_the_law_from_the_detection_is_a_lower_limit():
    """A normal distribution of magnitudes is one with any large b, not with a small one."""
    found = b_value(10 ** np.random.default_rng(1).normal(0, 0.3, 40))
    assert found.high == found.error == np.inf
    assert 0.5 < found.low < found.value


@pytest.mark.parametrize(("count", "blur"), [(60, 0.4), (150, 0.0)])
def test_intervals_contain_the_truth(count, blur):
    """Also where many catalogues give lower limits: to leave these out would keep the low ones."""
    rng = np.random.default_rng(8)
    found = [b_value(sizes(rng, 1.0, count, blur=blur)) for _ in range(20)]
    inside = sum(one.low <= 1.0 <= one.high for one in found)
    assert inside >= 17
    limits = sum(np.isinf(one.high) for one in found)
    assert (limits > 0) == (blur > 0)


def test_omori_decay_and_its_absence():
    times, marks, end = sequence(np.random.default_rng(1), 1.2, 1.0, 20, 40, 0.03)
    found = omori(times, marks, 10.0, end)
    assert found.decays
    assert found.main_count == 20
    assert abs(found.p - 1.2) < 3 * found.p_error < 1.0
    assert found.background == pytest.approx(0.03, rel=0.2)
    rng = np.random.default_rng(3)
    even = omori(1e4 * rng.random(400), np.where(rng.random(400) < 0.05, 10.0, 1.0), 10.0, 1e4)
    assert not even.decays


@pytest.fixture(scope="module")
def trace(tmp_path_factory):
    """A sawtooth with a burst 3 ms after the start of every second slip."""
    rng = np.random.default_rng(1)
    time = np.arange(0, 10, 1e-3)
    phase = time % 0.5
    force = 1 + np.interp(phase, [0, 0.48, 0.5], [0, 0.3, 0]) + 0.002 * rng.standard_normal(10000)
    channel = 0.1 * rng.standard_normal(10000)
    bursts = 0.483 + np.arange(0, 10, 1.0)
    for one in bursts:
        at = round(one * 1000)
        channel[at : at + 8] += 3 * np.array([1, -1, 0.9, -0.8, 0.7, -0.6, 0.5, -0.4])
    path = tmp_path_factory.mktemp("events") / "a.csv"
    header = "time [s],force [N],AE [V]"
    np.savetxt(path, np.c_[time, force, channel], delimiter=",", header=header, comments="")
    return mesoslip.read_trace(path), bursts


def test_bursts_of_a_channel_belong_to_slips(trace):
    tree, bursts = trace
    found = emissions_of(tree)
    assert found.start_time == pytest.approx(bursts, abs=1.5e-3)
    assert found.amplitude == pytest.approx(3.0, abs=0.4)
    data = mesoslip.events(tree)
    one = data["coincidence"]
    assert (one["slips"], one["with_events"], one["in_slips"]) == (20, 10, 10)
    assert one["by_chance"] < 2
    assert one["median_lag"] == pytest.approx(3e-3, abs=2e-3)


def test_a_burst_that_decays_is_one_event(trace):
    """Near the threshold, noise and the ringing of the sensor cross it many times."""
    rng = np.random.default_rng(2)
    after = np.arange(600)
    channel = 0.02 * rng.standard_normal(10000)
    for start in range(500, 9500, 1000):
        channel[start : start + 600] += 1.5 * np.exp(-after / 100) * np.sin(1.3 * after)
    data = trace[0].to_dataset().assign(acoustic_emission=(("realization", "time"), [channel]))
    found = emissions_of(xr.DataTree(data))
    assert found.start_time == pytest.approx(np.arange(0.5, 9.5), abs=3e-3)
    assert np.ptp(found.end_time - found.start_time) < 0.1


def test_a_trigger_has_events_between_its_edges(trace):
    tree = trace[0].copy()
    level = np.zeros((1, 10000))
    level[0, 1000:1020] = level[0, 5000:5003] = 5.0
    data = tree.to_dataset().assign(acoustic_emission=(("realization", "time"), level))
    tree = xr.DataTree(data)
    found = emissions_of(tree)
    assert found.is_trigger
    assert found.start_time == pytest.approx([1.0, 5.0])
    assert found.end_time == pytest.approx([1.019, 5.002])


def test_command_and_messages(trace, command, tmp_path):
    from mesoslip.output.writing import write

    path = tmp_path / "a.nc"
    write(trace[0], path)
    out = command.output("events", path)
    assert "10 of 20 slips have an event of the channel" in out
    data = json.loads(command("events", path, "--of", "slips", "--json")[1])
    assert len(data["events"]) == 20
    command("events", path, "--csv", tmp_path / "a.csv")
    for option, value, words in (
        ("--completeness", "nan", "completeness = nan: must be a finite number"),
        ("--main-size", "inf", "main_size = inf: must be a finite number of at least 0"),
        ("--threshold", "3", "threshold = 3.0: is that of the channel, and these events are slips"),
    ):
        err = command.refusal("events", path, "--of", "slips", option, value)
        assert words in err
    assert len((tmp_path / "a.csv").read_text().splitlines()) == 11
    with pytest.raises(ConfigError, match="must be one of slips, avalanches, channel"):
        mesoslip.events(path, "bursts")
    with pytest.raises(FileError, match="has no avalanches"):
        mesoslip.events(path, "avalanches")
    with pytest.raises(FileError, match="no second channel"):
        mesoslip.events(plain(trace[0]), "channel")


def plain(tree):
    """An output without its channel."""
    return xr.DataTree(tree.to_dataset().drop_vars("acoustic_emission"))
