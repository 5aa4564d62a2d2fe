"""Klein's case: what the source says of it."""

import mesoslip
import numpy as np
import pytest

OMEGA_S = np.sqrt(97 / 1.47e-3)


@pytest.fixture(scope="module")
def tree():
    from conftest import klein_tables

    return mesoslip.run(klein_tables(output__slip_interval=1e-5))


def test_the_first_spike_is_the_largest(tree):
    drops = tree["slips/force_drop"].values
    before = tree["slips/force_before"].values
    assert len(drops) > 5
    assert 0.95 * 18e-6 < before[0] < 18e-6
    assert np.all(before[1:] < 0.9 * before[0])
    assert np.all(drops[1:] < 0.8 * drops[0])


def test_details_of_the_first_slip(tree):
    """S21: F falls to about zero and swings, all contacts let go, V is of order Omega_S F_s/K."""
    fine = tree["slip_traces"].to_dataset()
    first = fine["slip"].values == 0
    start, end = tree["slips/start_time"].values[0], tree["slips/end_time"].values[0]
    inside = first & (fine["sample_time"].values < end)
    detached = fine["detached_contacts"].values[inside]
    force = fine["contact_force"].values[inside]
    assert detached.max() == 4080
    assert abs(force[detached == 4080]).max() < 1e-3 * 18e-6
    # The contacts let go and attach again about ten times on the way down.
    swings = np.count_nonzero(np.diff((detached > 2040).astype(int)) == 1)
    assert swings > 5
    scale = OMEGA_S * 18e-6 / 97
    assert 0.5 * scale < tree["slips/peak_velocity"].values[0] < scale
    # Half a period of the setup, 12 ms.
    assert 0.8 * np.pi / OMEGA_S < end - start < 1.5 * np.pi / OMEGA_S


def test_the_catalogue_agrees_with_the_trace(tree):
    """Force before and after, peak velocity and times are those of the finer traces."""
    fine = tree["slip_traces"].to_dataset()
    slips = tree["slips"].to_dataset()
    for number in range(slips.sizes["slip"]):
        trace = fine.isel(sample=fine["slip"].values == number)
        one = slips.isel(slip=number)
        force = trace["spring_force"].values
        assert trace["sample_time"].values[0] == one["start_time"]
        np.testing.assert_allclose(force.max(), one["force_before"], rtol=1e-6)
        np.testing.assert_allclose(force.min(), one["force_after"], atol=1e-6 * 18e-6)
        np.testing.assert_allclose(trace["velocity"].max(), one["peak_velocity"], rtol=1e-3)
        least = trace["sample_time"].values[force.argmin()]
        assert abs(least - one["end_time"].item()) < 2e-5


def test_ringing_decays_at_half_the_damping_rate(klein):
    """Model section 7: the amplitude goes as exp(-eta_S t/2), near Omega_L."""
    config = klein(output__slip_interval=5e-5, run__duration=2.1, output__slip_velocity=1e-8)
    tree = mesoslip.run(config)
    fine = tree["slip_traces"].to_dataset()
    time, velocity = fine["sample_time"].values, fine["velocity"].values
    late = (time > 1.95) & (time < 2.02) & (fine["slip"].values == 0)
    time, velocity = time[late], velocity[late]
    velocity = velocity - velocity.mean()
    peaks = np.flatnonzero((velocity[1:-1] > velocity[:-2]) & (velocity[1:-1] > velocity[2:])) + 1
    rate = -np.polyfit(time[peaks], np.log(velocity[peaks]), 1)[0]
    frequency = 2 * np.pi / np.mean(np.diff(time[peaks]))
    np.testing.assert_allclose(rate, 0.2 * OMEGA_S / 2, rtol=0.1)
    np.testing.assert_allclose(frequency, np.sqrt(2097 / 1.47e-3), rtol=0.02)


def last_drops(tree, span: float) -> np.ndarray:
    slips = tree["slips"].to_dataset()
    late = slips["start_time"].values > tree["time"].values[-1] - span
    return slips["force_drop"].values[late]


def test_without_delay_sliding_becomes_smooth(klein):
    """S22: stick-slip dies out although K << K*; what stays is the noise of 510 contacts.

    An eighth of Klein's, with as large a swing until only the noise is left.
    """
    tree = mesoslip.run(
        klein(contacts__count=510, contacts__delay=0.0, run__duration=300.0, output__interval=1e-2)
    )
    time, force = tree["time"].values, tree["spring_force"].values[0]
    swing = [np.ptp(force[(time > end - 20) & (time < end)]) / 18e-6 for end in (40, 150, 300)]
    assert swing[0] > 0.3
    assert swing[1] < 0.2
    assert swing[2] < 0.1


def test_a_long_delay_gives_lasting_stick_slip(klein):
    tree = mesoslip.run(klein(contacts__delay=1e-3, run__duration=60.0, output__interval=1e-2))
    drops = last_drops(tree, 20.0)
    assert len(drops) > 5
    assert np.mean(drops) > 0.2 * 18e-6
