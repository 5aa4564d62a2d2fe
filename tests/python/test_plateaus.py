"""Plateaus of speed, load and force: means, errors that know correlation, Stribeck's curve."""

import json
import math

import mesoslip
import numpy as np
import pytest
from mesoslip.analysis.plateaus.catalogue import plateaus_of
from mesoslip.analysis.plateaus.levels import levels_of
from mesoslip.errors import ConfigError, FileError
from scipy.signal import lfilter

SPEEDS = np.array([0.001, 0.01, 0.05, 0.2, 2.0])
LOAD, SAMPLES, RADIUS = 20.0, 200, 0.03


def coefficient(speed):
    """A curve with a mixed regime."""
    return 0.12 * np.exp(-speed / 0.05) + 0.01 + 0.012 * speed


def record(seed: int = 1, noise: float = 0.004, correlation: float = 0.7):
    """Time, speed, load and force in plateaus of the speed, each with a transient."""
    rng = np.random.default_rng(seed)
    count = SAMPLES * SPEEDS.size
    speed = np.repeat(SPEEDS, SAMPLES) * (1 + 0.002 * rng.standard_normal(count))
    load = LOAD * (1 + 0.003 * rng.standard_normal(count))
    level = np.repeat(coefficient(SPEEDS), SAMPLES)
    level *= 1 + 0.1 * np.tile(np.exp(-np.arange(SAMPLES) / 10), SPEEDS.size)
    shock = noise * math.sqrt(1 - correlation**2) * rng.standard_normal(count)
    deviation = lfilter([1.0], [1.0, -correlation], shock)
    return 0.1 * np.arange(count), speed, load, (level + deviation) * load


def written(path, columns, header):
    np.savetxt(path, np.transpose(columns), delimiter=",", header=header, comments="", fmt="%.7g")
    return path


@pytest.fixture(scope="module")
def disc(tmp_path_factory):
    """A trace of torque, rotation speed and load."""
    folder = tmp_path_factory.mktemp("disc")
    time, speed, load, force = record()
    rpm = 60 * speed / (math.tau * RADIUS)
    header = "time [s],torque [N mm],speed [rpm],load [N]"
    path = written(folder / "disc.csv", [time, 1e3 * RADIUS * force, rpm, load], header)
    return path, mesoslip.read_trace(path, radius="30 mm", viscosity="90 mPa*s")


def test_torque_and_rotation_with_a_radius(disc):
    """Force, speed and coefficient as they were made; the doubtful load is a guess."""
    path, tree = disc
    _, speed, load, force = record()
    for name, values in (
        ("spring_force", force),
        ("sliding_speed", speed),
        ("normal_force", load),
        ("friction_coefficient", force / load),
    ):
        assert tree[name].values[0] == pytest.approx(values, rel=1e-5)
    assert "guess: 'load [N]' taken as the normal force, beside" in tree.attrs["understood"]
    assert "force: torque / radius (30 mm)" in tree.attrs["understood"]
    with pytest.raises(FileError, match="give --radius"):
        mesoslip.read_trace(path)


def test_rad_per_second_are_revolutions_over_two_pi(tmp_path):
    columns = [np.arange(9.0), 1 + np.arange(9.0) % 2, np.full(9, math.tau)]
    path = written(tmp_path / "a.csv", columns, "time [s],force [N],speed [rad/s]")
    assert mesoslip.read_trace(path)["rotation_speed"].values[0] == pytest.approx(np.ones(9))


def test_a_given_normal_force_makes_coefficients(tmp_path):
    columns = [np.arange(9.0), 1 + np.arange(9.0) % 2]
    path = written(tmp_path / "a.csv", columns, "time [s],force [N]")
    tree = mesoslip.read_trace(path, normal_force="4 N")
    assert tree["friction_coefficient"].values[0] == pytest.approx(columns[1] / 4)


def test_plateaus_are_those_of_the_speed(disc):
    """All of them; friction after the transient within its errors; the abscissa by hand."""
    found = mesoslip.plateaus(disc[1])
    assert found.sizes["plateau"] == SPEEDS.size
    assert found.attrs["source"] == "sliding speed"
    assert found["sliding_speed"].values == pytest.approx(SPEEDS, rel=1e-3)
    value, error = (found[f"mean_friction_coefficient{one}"].values for one in ("", "_error"))
    assert (np.abs(value - coefficient(SPEEDS)) < 3 * error).all()
    assert found["hersey_number"].values == pytest.approx(0.09 * SPEEDS / LOAD, rel=2e-3)


def test_errors_know_correlation():
    """Deviations over their errors have a variance of about 1, white noise or not."""
    for correlation in (0.0, 0.9):
        ratios = []
        for seed in range(8):
            time, speed, load, force = record(seed, correlation=correlation)
            tree = tree_of(time, force, load, speed)
            found = plateaus_of(tree).columns
            value, error = (found[f"mean_friction_coefficient{one}"] for one in ("", "_error"))
            ratios += ((value - coefficient(SPEEDS)) / error).tolist()
        assert 0.5 < np.mean(np.square(ratios)) < 2.0


def test_a_load_that_varies_is_no_error_of_the_coefficient():
    """Friction follows it; the error of the coefficient is that of the rest."""
    time, speed, _, _ = record()
    rng = np.random.default_rng(4)
    load = LOAD * (1 + 0.05 * rng.standard_normal(time.size))
    force = 0.1 * load * (1 + 1e-4 * rng.standard_normal(time.size))
    found = plateaus_of(tree_of(time, force, load, speed)).columns
    assert found["mean_friction_coefficient"] == pytest.approx(np.full(SPEEDS.size, 0.1), rel=1e-4)
    assert np.all(found["mean_friction_coefficient_error"] < 5e-6)


def tree_of(time, force, load=None, speed=None):
    """A measured output of arrays."""
    import xarray as xr

    variables = {"spring_force": force, "normal_force": load, "sliding_speed": speed}
    data = {
        name: (("realization", "time"), one[np.newaxis])
        for name, one in variables.items()
        if one is not None
    }
    coordinates = {"time": time, "realization": [0]}
    return xr.DataTree(xr.Dataset(data, coordinates, {"origin": "measured"}))


def test_plateaus_of_the_force_alone_are_a_guess():
    time, _, _, force = record(noise=0.001)
    found = plateaus_of(tree_of(time, force))
    assert found.source == "force"
    assert found.notes[0].startswith("guess:")
    assert found.columns["mean_friction"] == pytest.approx(LOAD * coefficient(SPEEDS), rel=0.02)


def test_load_and_speed_cut_together():
    """Steps of the load within a plateau of the speed make plateaus of both."""
    time, speed, _, force = record()
    load = np.where(np.arange(time.size) % SAMPLES < SAMPLES // 2, 20.0, 40.0)
    found = plateaus_of(tree_of(time, force, load, speed))
    assert found.source == "sliding speed and normal force"
    assert len(found.rows) == 2 * SPEEDS.size
    assert len(plateaus_of(tree_of(time, force, load, speed), signal="speed").rows) == SPEEDS.size


def test_a_column_of_the_viscosity(tmp_path):
    """It is the abscissa of Stribeck's curve; a given viscosity goes before it."""
    time, speed, load, force = record()
    warm = np.repeat(np.linspace(90, 50, SPEEDS.size), SAMPLES)
    header = "time [s];friction force [N];load [N];sliding speed [m/s];viscosity [mPa s]"
    path = tmp_path / "a.csv"
    columns = np.transpose([time, force, load, speed, warm])
    np.savetxt(path, columns, delimiter=";", header=header, comments="", fmt="%.7g")
    found = mesoslip.plateaus(mesoslip.read_trace(path))
    expected = 1e-3 * np.linspace(90, 50, SPEEDS.size) * SPEEDS / LOAD
    assert found["hersey_number"].values == pytest.approx(expected, rel=2e-3)
    given = mesoslip.plateaus(mesoslip.read_trace(path), viscosity=0.09)
    assert given["hersey_number"].values == pytest.approx(0.09 * SPEEDS / LOAD, rel=2e-3)


def test_ramps_and_noise_have_no_steps():
    rng = np.random.default_rng(1)
    noise = lfilter([1.0], [1.0, -0.9], rng.standard_normal(4000))
    assert len(levels_of(noise)) == 1
    assert len(levels_of(np.arange(4000.0) + 0.1 * noise)) == 0
    step = np.concatenate([np.zeros(2000), np.linspace(0, 100, 200), np.full(1800, 100.0)])
    first, second = levels_of(step + noise)
    assert first.after == pytest.approx(2000, abs=30)
    assert second.first == pytest.approx(2200, abs=30)


@pytest.mark.parametrize("samples", [20, 100, 400, 1200])
def test_correlated_noise_of_a_force_makes_no_plateaus(samples):
    """Whatever its correlation; sharp steps on it are found, but for cuts by the noise."""
    memory = math.exp(-1 / samples)
    for seed in range(2):
        rng = np.random.default_rng([samples, seed])
        slow = lfilter(
            [math.sqrt(1 - memory**2)], [1.0, -memory], rng.standard_normal(4000 + 5 * samples)
        )[-4000:]
        noise = slow + 0.1 * rng.standard_normal(4000)
        assert len(levels_of(noise, are_sharp=True)) == 1
        if samples < 1000:
            # Longer correlated noise drifts in a plateau, which is a ramp then.
            step = 20 * (np.arange(4000) > 2500)
            assert len(levels_of(noise + step, are_sharp=True)) == 2


def test_strokes_and_other_signals_are_refused():
    time = 0.01 * np.arange(800)
    force = np.clip(5 * np.sin(math.tau * time), -1, 1)
    with pytest.raises(FileError, match="goes back and forth: mesoslip strokes"):
        plateaus_of(tree_of(time, force))
    with pytest.raises(ConfigError, match="must be one of speed, load, force"):
        mesoslip.plateaus(tree_of(time, force), signal="torque")
    with pytest.raises(FileError, match="no record of the load"):
        plateaus_of(tree_of(time, np.abs(force)), signal="load")


def test_command_tables_and_picture(disc, command, tmp_path):
    from mesoslip.output.writing import write

    path = tmp_path / "disc.nc"
    write(disc[1], path)
    assert "5 plateaus between steps of the sliding speed" in command("plateaus", path)[1]
    table = tmp_path / "coefficients.csv"
    rows = (f"{0.01 * at:.2f},{1 + at // 1000},{0.3 + at % 7 / 1000:.3f}" for at in range(3000))
    table.write_text("time [s],speed [mm/s],COF\n" + "\n".join(rows) + "\n")
    assert plateaus_of(mesoslip.read_trace(table)).notes == [
        "3 plateaus between steps of the sliding speed"
    ]
    data = json.loads(command("plateaus", path, "--json", "--viscosity", "45 mPa*s")[1])
    assert data["plateaus"][-1]["hersey_number"] == pytest.approx(0.045 * 2 / LOAD, rel=1e-2)
    assert r"\toprule" in command("plateaus", path, "--latex")[1]
    command("plateaus", path, "--csv", tmp_path / "a.csv")
    mesoslip.write_table(mesoslip.plateaus(path), tmp_path / "b.csv")
    lines = (tmp_path / "a.csv").read_text().splitlines()
    assert len(lines) == 6
    assert lines == (tmp_path / "b.csv").read_text().splitlines()
    figure = mesoslip.plot(path, view="stribeck")
    assert figure.axes[1].get_xlabel() == "viscosity × speed/load (1/m)"
    assert figure.axes[1].get_xscale() == "log"
