"""Lyapunov exponents and return maps against closed forms."""

import json
import math

import mesoslip
import numpy as np
import pytest
from conftest import klein_tables
from mesoslip.analysis.lyapunov import Orbit, growth, pooled, summary, transverse_distances
from mesoslip.analysis.return_map import map_exponent, settled_peaks
from mesoslip.configuration.config import Config
from mesoslip.errors import RunError

# No contact breaks: the slider on its springs is a linear system.
PINNED = {
    "run__engine": "me",
    "run__duration": 3.0,
    "contacts__static_force": 1.0,
    "contacts__stiffness": 500.0,
    "contacts__coupling": "equal",
    "output__interval": 0.5e-3,
}


def linear_rate(config: Config) -> float:
    """Slowest decay of V' = -w^2 x - D, D' = eta (V' - D)."""
    slider = config.slider
    square = (slider.stiffness + config.contacts.stiffness) / slider.mass
    eta = slider.damping_rate
    return float(np.max(np.roots([1.0, 2 * eta, square, eta * square]).real))


def test_distances_of_a_linear_system_decay_with_its_slowest_mode():
    config = Config.from_dict(klein_tables(**PINNED))
    tree = mesoslip.lyapunov(config, twins=4, duration=0.5, executor=1)
    expected = linear_rate(config)
    # Windows average over the ringing; the shift in time takes a little of it off.
    assert float(tree["lyapunov_exponent"]) == pytest.approx(expected, rel=0.03)
    assert summary(tree) == "regular: small distances decay"


def test_a_run_that_ends_before_a_twin_starts_is_too_short():
    tables = klein_tables(**PINNED, run__stop={"displacement": 1e-9})
    with pytest.raises(RunError, match=r"displacement of the slider reached.*a longer run is"):
        mesoslip.lyapunov(tables, twins=4, duration=0.5, executor=1)


def test_a_twin_that_is_not_displaced_is_the_run_itself():
    config = Config.from_dict(klein_tables(run__duration=3.0, contacts__count=50))
    with mesoslip.Realization(config) as run:
        run.advance_to(1.9)
        with run.twin(0.0) as same, run.twin(1e-12) as other:
            for one in (run, same, other):
                one.advance_to(2.5)
            begin = len(run.trace) - len(same.trace)
            assert np.array_equal(run.trace[begin:], same.trace)
            assert not np.array_equal(run.trace[begin:], other.trace)
            assert abs(other.energy_residual) < 1e-9


@pytest.mark.parametrize(
    ("kind", "changes"),
    [
        ("rigid", {}),
        (
            "layered",
            {
                "slider__layers": 2,
                "slider__layer_damping": 1e3,
                "slider__damping_ratio": None,
            },
        ),
    ],
)
def test_a_displaced_drive_pulls_with_its_spring(kind, changes):
    config = Config.from_dict(klein_tables(slider__kind=kind, contacts__count=50, **changes))
    with mesoslip.Realization(config) as run:
        run.advance_to(0.1)
        with run.twin(1e-9) as other:
            for one in (run, other):
                one.advance_to(0.5)
            before, after = run.records("trace")[-1], other.records("trace")[-1]
            shift = after["drive_displacement"] - before["drive_displacement"]
            assert shift == pytest.approx(1e-9, rel=1e-4)
            # Pinned contacts and the spring share it.
            spring, contacts = config.spring_stiffness, config.contacts.stiffness
            share = 1e-9 * spring * contacts / (spring + contacts)
            difference = after["spring_force"] - before["spring_force"]
            assert difference == pytest.approx(share, rel=0.02)


def test_a_shift_in_time_is_no_distance():
    time = np.arange(0.0, 20.0, 0.01)

    def orbit(shift: float, growth: float) -> Orbit:
        phase = time + shift
        position = np.stack([np.cos(phase), np.sin(phase)], axis=1)
        position *= 1 + growth * np.exp(0.3 * time)[:, np.newaxis]
        return Orbit(time, position, np.gradient(position, time, axis=0))

    _, none = transverse_distances(orbit(0.0, 0.0), orbit(1e-4, 0.0), 100)
    assert none.max() < 1e-7
    rest = Orbit(time, np.ones((len(time), 2)), np.zeros((len(time), 2)))
    assert transverse_distances(rest, rest, 100)[1].max() == 0
    times, grown = transverse_distances(orbit(0.0, 0.0), orbit(1e-4, 1e-6), 100)
    gain, length = growth(times, grown, 0.0, 1.0)
    assert gain / length == pytest.approx(0.3, rel=0.02)
    assert length > 15


def test_growth_counts_between_two_distances():
    times = np.arange(40.0)
    distances = np.minimum(np.maximum(1e-9 * np.exp(times), 1e-6), 1e-1)
    gain, length = growth(times, distances, 1e-5, 1e-2)
    assert gain == pytest.approx(length)
    # First distances at or above the bounds.
    assert length == math.ceil(math.log(1e7)) - math.ceil(math.log(1e4))
    # A distance that decays counts until it is below the range.
    gain, length = growth(times, np.maximum(np.exp(-times), 1e-6), 1e-4, 0.5)
    assert (gain, length) == (pytest.approx(-length), 7.0)
    assert growth(times, np.full(40, 1e-6), 1e-5, 1e-2) == (0.0, 0.0)


@pytest.mark.parametrize("low", [1e-9, 1e-4])
def test_the_range_of_distances_does_not_bias_the_rate(low):
    # Random walks of the logarithm, by steps wider than their mean, as slips are.
    rng = np.random.default_rng(3)
    steps = rng.normal(0.5, 1.0, (400, 150))
    walks = np.exp(np.log(1e-11) + np.cumsum(steps, axis=1))
    times = np.arange(150.0)
    grown, lengths = np.array([growth(times, walk, low, 1e-2) for walk in walks]).T
    fit = pooled(grown, lengths, 1e3 * np.arange(400.0))
    assert fit.error < 0.03
    assert abs(fit.exponent - 0.5) < 3 * fit.error


def test_the_error_of_a_mean_rate_is_that_of_its_scatter():
    rng = np.random.default_rng(1)
    lengths, apart, together = np.ones(20), 2.0 * np.arange(20), np.linspace(0.0, 4.0, 20)
    draws = [rng.normal(2.0, 0.5, 20) for _ in range(400)]
    means, errors = np.array([pooled(one, lengths, apart) for one in draws]).T
    assert means.mean() == pytest.approx(2.0, abs=0.02)
    assert errors.mean() == pytest.approx(means.std(), rel=0.1)
    # Twins of 20 times in a run of 5.
    ratio = pooled(draws[0], lengths, together).error / pooled(draws[0], lengths, apart).error
    assert ratio == pytest.approx(2.0)
    assert math.isnan(pooled(np.array([1.0, 0.0]), np.array([1.0, 0.0]), np.arange(2.0)).error)
    # Two twins: the standard deviation over the root of 2.
    two = pooled(np.array([1.0, 3.0]), np.ones(2), np.array([0.0, 10.0]))
    assert two == pytest.approx((2.0, 1.0))


def test_the_exponent_of_a_map_is_the_mean_logarithm_of_its_slope():
    x = np.empty(1000)
    x[0] = 0.3
    for i in range(x.size - 1):
        x[i + 1] = 4 * x[i] * (1 - x[i])
    assert map_exponent(x) == pytest.approx(math.log(2), abs=0.03)
    # Of a map with a stable point.
    y = np.empty(300)
    y[0] = 0.1
    for i in range(y.size - 1):
        y[i + 1] = 0.5 - 0.95 * (y[i] - 0.3)
    assert map_exponent(y[:200]) == pytest.approx(math.log(0.95), abs=0.001)
    assert math.isnan(map_exponent(x[:50]))


def test_peaks_are_those_of_the_second_half():
    tree = mesoslip.run(klein_tables(run__duration=8.0, contacts__count=20), executor=1)
    slips = tree["slips"].to_dataset()
    late = slips["start_time"].values >= 4.0
    assert np.array_equal(settled_peaks(tree), slips["force_before"].values[late])
    assert 0 < late.sum() < late.size
    (axes,) = mesoslip.plot(tree, view="return-map").axes
    # Equal axes, with the diagonal from corner to corner.
    assert axes.get_aspect() == 1
    assert axes.get_xlim() == axes.get_ylim() == tuple(axes.lines[-1].get_xdata())
    other = mesoslip.run(
        klein_tables(run__duration=2.0, contacts__count=20, drive__velocity=0.4e-6), executor=1
    )
    axes = mesoslip.plot([tree, other], view="bifurcation").axes[0]
    for line, one, velocity in zip(axes.lines, (tree, other), (100.0, 400.0), strict=True):
        assert line.get_xdata() == pytest.approx(velocity)
        assert line.get_ydata() == pytest.approx(1e6 * settled_peaks(one))
    third = mesoslip.run(klein_tables(run__duration=0.1, contacts__delay=1e-3), executor=1)
    with pytest.raises(mesoslip.ConfigError, match=r"contacts\.delay.*one number"):
        mesoslip.plot([tree, third], view="bifurcation")


def test_sliders_without_inertia_have_no_twins(tmp_path, command):
    config = {**klein_tables(), "slider": {"kind": "prescribed"}}
    with pytest.raises(mesoslip.ConfigError, match=r"slider\.kind = .*rigid or layered"):
        mesoslip.lyapunov(config)
    with pytest.raises(mesoslip.ConfigError, match=r"twins.* must be at least 2"):
        mesoslip.lyapunov(klein_tables(), twins=1)
    file = tmp_path / "pinned.toml"
    file.write_text(Config.from_dict(klein_tables(**PINNED)).to_toml())
    output = tmp_path / "pinned.nc"
    _, text, _ = command(
        "lyapunov", file, "-o", output, "--follow", "0.5 s", "--twins", "4", "--quiet"
    )
    assert "regular: small distances decay" in text
    with mesoslip.open_output(output) as tree:
        assert tree.sizes["twin"] == 4
        assert mesoslip.plot(tree).axes
    _, text, _ = command("lyapunov", file, "--follow", "0.5 s", "--twins", "4", "--json", "--quiet")
    found = json.loads(text)
    assert found["lyapunov_exponent"] < -3 * found["lyapunov_error"]


def test_a_sweep_measures_exponents(tmp_path):
    (tmp_path / "base.toml").write_text(Config.from_dict(klein_tables(**PINNED)).to_toml())
    (tmp_path / "sweep.toml").write_text(
        'base = "base.toml"\n[sweep]\nmeasures = ["lyapunov_exponent", "peak_variation"]\n'
        '[sweep.grid]\n"run.duration" = ["1.5 s"]\n'
    )
    data = mesoslip.sweep(tmp_path / "sweep.toml", executor=1)
    assert data["lyapunov_exponent"].item() < -1
    assert math.isnan(data["peak_variation"].item())
