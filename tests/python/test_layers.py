"""Elastic sliders against the rigid one, closed forms, matrix exponentials, other integrators."""

import mesoslip
import numpy as np
import pytest
import sksundae
from conftest import at_end, long
from mesoslip import _core
from mesoslip.output import layout
from mesoslip.simulation.realization import Realization
from mesoslip.theory.derived import derived
from scipy import linalg

pytestmark = pytest.mark.usefixtures("no_step_errors")

MASS, STIFFNESS = 1.47e-3, 97.0
FORCE = 18e-6


def layered(layers, **more):
    return {"kind": "layered", "mass": MASS, "stiffness": STIFFNESS, "layers": layers, **more}


def finish(config):
    return at_end(Realization(config, 0))


def chain(layers, contact=0.0, drag=0.0, damping=0.0, base=None):
    """Matrix of x' = A x for (displacements of base and layers, their velocities), and masses."""
    mass, spring = MASS / layers, STIFFNESS * layers
    n = layers + 1
    stiffness, dashpots = np.zeros((n, n)), np.zeros((n, n))
    for layer in range(1, layers):
        bond = np.zeros(n)
        bond[layer], bond[layer + 1] = -1, 1
        stiffness += spring * np.outer(bond, bond)
        dashpots += damping * mass * np.outer(bond, bond)
    # The drive's spring is not damped.
    stiffness[layers, layers] += spring
    bond = np.zeros(n)
    bond[0], bond[1] = -1, 1
    stiffness += contact * np.outer(bond, bond)
    dashpots += drag * np.outer(bond, bond)
    masses = np.full(n, mass)
    masses[0] = 1.0
    if base is None:
        stiffness[0], dashpots[0] = 0, 0
    else:
        masses[0] = base["mass"]
        stiffness[0, 0] += base["stiffness"]
        dashpots[0, 0] += base["mass"] * base["damping"]
    top = np.hstack([np.zeros((n, n)), np.eye(n)])
    bottom = np.hstack([-stiffness / masses[:, None], -dashpots / masses[:, None]])
    return np.vstack([top, bottom]), masses


def test_one_layer_is_the_rigid_slider(klein):
    """The same breaks, and the same forces over the first slips; chaos parts them after 3.1 s."""
    changes = {"run__duration": 3.1, "output__slip_interval": 1e-4}
    rigid = finish(klein(slider={"kind": "rigid", "mass": MASS, "stiffness": STIFFNESS}, **changes))
    one = finish(klein(slider=layered(1), **changes))
    assert len(one.slips) == len(rigid.slips) == 1
    assert one.breaks == rigid.breaks
    # A sample may fall between two ways of rounding the time of an event.
    assert np.mean(one.trace[:, 6] != rigid.trace[:, 6]) < 1e-3
    np.testing.assert_allclose(one.trace[:, 4:6], rigid.trace[:, 4:6], atol=1e-8 * FORCE, rtol=0)
    np.testing.assert_allclose(one.trace[:, 7], one.trace[:, 4], atol=1e-12 * FORCE, rtol=0)
    np.testing.assert_allclose(one.slips, rigid.slips, rtol=1e-6, atol=1e-12)


@pytest.mark.parametrize("layers", [16, long(64)])
def test_frequencies_of_the_free_chain(klein, layers):
    """With all contacts broken, each mode moves at its frequency: amplitudes tell ω² to 10⁻⁶."""
    config = klein(
        slider=layered(layers),
        contacts__reattach=False,
        contacts__drag_rate=0.0,
        drive__velocity=1e-6,
        run__duration=0.2,
        output__interval=2e-6,
        output__layers=True,
    )
    realization = finish(config)
    assert realization.trace[-1, 6] == 4080
    free = realization.trace[:, 6] == 4080
    x = realization.layer_trace[free]
    drive = realization.trace[free, 1]
    frequencies = config.slider.frequencies
    interval = 2e-6
    place = np.arange(layers) + 0.5
    for mode in (1, 2, 5, 10):
        shape = np.cos((2 * mode - 1) * np.pi * place / (2 * layers + 1))
        amplitude = (x - drive[:, None]) @ shape
        # Of a harmonic motion the second difference is -(2 sin(ω dt/2))² times it.
        step = max(1, round(0.3 / frequencies[mode - 1] / interval))
        middle = amplitude[step:-step]
        second = amplitude[2 * step :] - 2 * middle + amplitude[: -2 * step]
        ratio = -(second @ (middle - middle.mean())) / (middle @ (middle - middle.mean()))
        measured = 2 * np.arcsin(np.sqrt(ratio) / 2) / (step * interval)
        assert measured == pytest.approx(frequencies[mode - 1], rel=1e-6)


def test_frequencies_are_the_eigenvalues():
    for layers in (1, 2, 16, 64):
        matrix, _ = chain(layers)
        eigen = np.sort(np.abs(linalg.eigvals(matrix).imag))[-2 * layers :: 2]
        j = np.arange(1, layers + 1)
        n = 2 * layers + 1
        closed = 2 * layers * np.sqrt(STIFFNESS / MASS) * np.sin((2 * j - 1) * np.pi / (2 * n))
        np.testing.assert_allclose(eigen, closed, rtol=1e-7)


@pytest.mark.parametrize("damping", [0.0, 20.0, 400.0])
def test_modes_decay_as_the_eigenvalues_say(klein, damping):
    """Of what is left of the modes, with all contacts broken, a linear recurrence states the rates.

    Damping acts between layers, not on the drive's spring: the slowest mode hardly decays.
    """
    layers, interval = 3, 5e-4
    config = klein(
        slider=layered(layers, layer_damping=damping),
        contacts__reattach=False,
        contacts__drag_rate=0.0,
        run__duration=1.95,
        output__interval=interval,
        output__layers=True,
    )
    realization = finish(config)
    free = realization.trace[:, 6] == 4080
    assert free.sum() > 50
    x = realization.layer_trace[free] - realization.trace[free, 1][:, None]
    before = np.hstack([x[1:-1], x[:-2]])
    recurrence, *_ = np.linalg.lstsq(before, x[2:], rcond=None)
    companion = np.vstack([recurrence.T, np.eye(layers, 2 * layers)])
    measured = np.log(linalg.eigvals(companion).astype(complex)) / interval
    matrix, _ = chain(layers, damping=damping)
    chosen = [*range(1, layers + 1), *range(layers + 2, 2 * layers + 2)]
    expected = linalg.eigvals(matrix[np.ix_(chosen, chosen)])
    for one in expected:
        assert np.min(np.abs(measured - one)) < 1e-5 * np.abs(one)


def test_one_layer_has_none_to_be_damped_against(klein):
    plain, damped = (
        finish(klein(slider=layered(1, layer_damping=rate), run__duration=2.0)).trace
        for rate in (0.0, 1e4)
    )
    assert np.array_equal(plain, damped)


BASE = {"mass": 5e-3, "stiffness": 1e4, "damping": 30.0}


@pytest.mark.parametrize("method", ["series", "adams", "bdf"])
@pytest.mark.parametrize("base", [None, BASE])
@pytest.mark.parametrize("damping", [0.0, 40.0])
def test_pinned_contacts_against_matrix_exponentials(klein, method, base, damping):
    """All contacts pinned, the drive pulling from rest: a linear system with a closed form."""
    layers = 5
    more = {"solver": {"method": method, "relative_tolerance": 1e-11}}
    if base is not None:
        more["base"] = base
    config = klein(
        slider=layered(layers, layer_damping=damping, **more),
        contacts__coupling="equal",
        drive__velocity=1e-6,
        run__duration=0.05,
        output__interval=1e-3,
        output__layers=True,
    )
    realization = finish(config)
    assert realization.breaks == 0
    matrix, masses = chain(layers, contact=2000.0, damping=damping, base=base)
    n = layers + 1
    # The drive as two more variables: its displacement and its velocity.
    whole = np.zeros((2 * n + 2, 2 * n + 2))
    whole[: 2 * n, : 2 * n] = matrix
    whole[2 * n - 1, 2 * n] = STIFFNESS * layers / masses[-1]
    whole[2 * n, 2 * n + 1] = 1
    state = np.zeros(2 * n + 2)
    state[-1] = 1e-6
    propagator = linalg.expm(1e-3 * whole)
    for row, displacements in zip(realization.trace, realization.layer_trace, strict=True):
        np.testing.assert_allclose(displacements, state[1:n], atol=1e-16, rtol=1e-7)
        assert row[5] == pytest.approx(2000 * (state[1] - state[0]), rel=1e-7, abs=1e-8 * FORCE)
        assert row[8] == pytest.approx(state[0], rel=1e-7, abs=1e-16)
        state = propagator @ state


def test_static_stiffness(klein):
    """Pulled slowly, pinned: the drive bears K Nk/(K + Nk) times its way."""
    config = klein(slider=layered(16, layer_damping=500.0), run__duration=1.0)
    trace = finish(config).trace
    force = np.polyfit(trace[-400:, 1], trace[-400:, 4], 1)[0]
    # K_c of the sum of stiffnesses, which the random thresholds change by a little.
    stiffness = np.polyfit(trace[-400:, 2], trace[-400:, 5], 1)[0]
    assert force == pytest.approx(STIFFNESS * stiffness / (STIFFNESS + stiffness), rel=1e-5)
    np.testing.assert_allclose(trace[-1, 7], trace[-1, 4], rtol=1e-4)


@pytest.mark.parametrize(
    ("engine", "layers", "more"),
    [
        ("eq", 16, {"layer_damping": 30.0, "base": BASE}),
        ("me", 4, {"layer_damping": 30.0, "base": BASE}),
        *(long("eq", 16, more) for more in ({}, {"base": BASE}, {"layer_damping": 30.0})),
        *(long("me", 4, more) for more in ({}, {"base": BASE}, {"layer_damping": 30.0})),
    ],
)
def test_energy_balance_closes(klein, more, engine, layers):
    slider = layered(layers, **more)
    realization = finish(klein(slider=slider, run__duration=2.2, run__engine=engine))
    assert abs(realization.energy_residual) < (1e-11 if engine == "eq" else 1e-4)
    assert realization.breaks > 4080


def test_energy_balance_of_a_long_run(klein):
    """12 s of stick-slip of 16 layers."""
    realization = finish(klein(slider=layered(16), run__duration=12.0))
    assert abs(realization.energy_residual) < 1e-11


@pytest.mark.parametrize("method", ["adams", long("bdf")])
def test_cvode_converges_to_the_series(klein, method):
    """Forces through the first slip, with tolerance; and its own count of steps."""
    changes = {"contacts__count": 100, "run__duration": 1.93, "output__interval": 1e-4}
    exact = finish(klein(slider=layered(4), **changes)).trace
    errors, steps = [], []
    for tolerance in (1e-6, 1e-8, 1e-10):
        solver = {"method": method, "relative_tolerance": tolerance}
        realization = finish(klein(slider=layered(4, solver=solver), **changes))
        # Event times move by the error: compare what is continuous.
        errors.append(np.max(np.abs(realization.trace[:, 4] - exact[:, 4])) / FORCE)
        steps.append(realization.integrator_counts[0])
    assert errors[2] < 1e-5
    assert errors[2] < 0.1 * errors[1]
    assert errors[1] < 0.1 * errors[0]
    assert steps[0] < steps[1] < steps[2]


def test_a_build_without_sundials_serves_layers_by_series(klein, monkeypatch):
    """`auto` takes the series however long it takes; CVODE's methods are refused in one line."""
    monkeypatch.setattr(_core, "sundials", lambda: b"")
    long = {"contacts__count": 100, "run__duration": 1e9}
    assert klein(slider=layered(4), **long).slider.solver_name(klein(**long)) == "series"
    finish(klein(slider=layered(4), contacts__count=100, run__duration=0.01))
    refused = klein(slider=layered(4, solver={"method": "adams"}))
    with pytest.raises(mesoslip.ConfigError, match=r"^slider\.solver\.method = 'adams': .*without"):
        mesoslip.run(refused)
    monkeypatch.setattr(_core, "sundials", lambda: b"7.0.0")
    assert klein(slider=layered(4), **long).slider.solver_name(klein(**long)) == "bdf"


def test_an_independent_cvode(klein):
    """The same case by scikit-sundae, with every contact in the rates, up to the first breaks."""
    layers, count = 4, 20
    config = klein(
        slider=layered(layers),
        contacts__count=count,
        contacts__coupling="equal",
        contacts__reattach=False,
        contacts__drag_rate=0.0,
        contacts__threshold={"law": "uniform", "relative_width": 0.3},
        drive__velocity=1e-6,
        run__duration=0.19,
        output__interval=1e-4,
    )
    realization = Realization(config, 0)
    realization.advance(1)
    limits = np.sort(realization.contacts["break_stretch"])
    realization = finish(config)
    matrix, masses = chain(layers)
    n = layers + 1
    k = 2000.0 / count

    def rates(time, state, rate):
        displacement = max(state[1], rates.farthest)
        rate[:] = matrix @ state
        force = k * state[1] * np.sum(limits > displacement)
        rate[n + 1] -= force / masses[1]
        rate[-1] += STIFFNESS * layers * 1e-6 * time / masses[-1]

    # Break by break: contacts that have broken stay so.
    solver = sksundae.cvode.CVODE
    state, start, forces, times = np.zeros(2 * n), 0.0, [], []
    for broken in range(count + 1):
        threshold = limits[broken] if broken < count else np.inf
        rates.farthest = limits[broken - 1] if broken else -1.0

        def reach(_, state, events):
            events[0] = state[1] - min(reach.threshold, 1.0)

        reach.threshold = threshold
        reach.terminal = [True]
        reach.direction = [1]
        grid = np.concatenate([[start], np.arange(np.floor(start * 1e4) + 1, 1901) * 1e-4])
        if len(grid) < 2:
            break
        result = solver(
            rates, rtol=1e-10, atol=1e-17, eventsfn=reach, num_events=1, max_num_steps=10**6
        ).solve(grid, state)
        inside = np.isin(result.t, grid[1:])
        times.extend(result.t[inside])
        forces.extend(1e-6 * result.t[inside] - result.y[inside, layers])
        state, start = result.y[-1], result.t[-1]
        if start >= 0.19 - 1e-12:
            break
    ours = np.interp(times, realization.trace[:, 0], realization.trace[:, 4])
    theirs = STIFFNESS * layers * np.array(forces)
    assert len(times) > 1500
    np.testing.assert_allclose(ours, theirs, atol=1e-5 * FORCE, rtol=0)


def test_everything_pinned_rings_at_the_frequency_of_the_base(klein):
    """Base and slider move as one: √(K_B/(M_B + M + Nm)) of section 8 of the model."""
    base = {"mass": 1.0, "stiffness": 1000.0, "damping": 0.0}
    config = klein(
        slider=layered(4, base=base),
        contacts__drag_rate=0.0,
        contacts__stiffness=2e5,
        contacts__static_force=18e-3,
        drive__velocity=1e-6,
        run__duration=3.0,
        output__interval=1e-3,
    )
    trace = finish(config).trace
    frequency = derived(config)["pinned_base_frequency"].value
    # Layers on their spring to the drive, which moves evenly, add its stiffness.
    expected = np.sqrt(frequency**2 + STIFFNESS / (1.0 + MASS))
    position = trace[:, 8] - np.polyval(np.polyfit(trace[:, 0], trace[:, 8], 1), trace[:, 0])
    crossings = np.flatnonzero(np.diff(np.sign(position)) > 0)
    exact = trace[crossings, 0] - position[crossings] * 1e-3 / np.diff(position)[crossings]
    assert 2 * np.pi / np.mean(np.diff(exact)) == pytest.approx(expected, rel=0.005)


def test_segments_of_a_layered_run_do_not_matter(klein):
    config = klein(slider=layered(8), run__duration=2.2, output__layers=True)
    whole = finish(config)
    pieces = at_end(Realization(config, 0), 501)
    assert np.array_equal(whole.trace, pieces.trace)
    assert np.array_equal(whole.layer_trace, pieces.layer_trace)


def test_the_slip_time_hardly_depends_on_the_layers(klein):
    """Claim C9, from 16 layers on."""
    times = []
    for layers in (16, 64):
        slip = finish(klein(slider=layered(layers), run__duration=2.2)).slips[0]
        times.append(slip[2] - slip[1])
    assert times[0] == pytest.approx(times[1], rel=0.15)


@pytest.mark.parametrize(
    "changes",
    [
        {"contacts__drag_rate": 2e16},
        {"slider": layered(16, base={"mass": 5e-3, "stiffness": 1e7})},
        long({"slider": layered(1) | {"mass": MASS * 1e-6}}),
    ],
)
def test_stiff_cases_finish(klein, changes):
    settings = {"slider": layered(16), "contacts__count": 100, "run__duration": 1.93} | changes
    realization = finish(klein(**settings))
    assert realization.finished
    assert abs(realization.energy_residual) < 1e-8


def test_outputs_of_layers(klein):
    import mesoslip

    config = klein(
        slider=layered(3, base=BASE),
        run__duration=0.1,
        output__layers=True,
        contacts__count=10,
    )
    tree = mesoslip.run(config)
    data = tree.to_dataset()
    assert data["layer_displacement"].dims == ("realization", "time", "layer")
    assert data["layer_displacement"].shape == (1, 101, 3)
    for name in ("elastic_force", "base_displacement", "layer_displacement"):
        assert data[name].attrs["units"]
    assert tree.attrs["solver"] == "series"
    first = data["layer_displacement"].values[0, :, 0] - data["base_displacement"].values[0]
    np.testing.assert_allclose(first, data["displacement"].values[0], atol=1e-20)
    assert layout.recorded(klein())[-1] == "detached_contacts"


def test_the_cantilever(klein):
    """Claim C15: its lowest frequency is 2.03 √(K/M)."""
    rod = {"length": 0.05, "radius": 1e-3, "density": 7800.0, "young_modulus": "200 GPa"}
    config = klein(slider={"kind": "layered", "layers": 8, "cantilever": rod})
    assert config.slider.mass == pytest.approx(7800 * np.pi * 1e-6 * 0.05)
    assert config.slider.stiffness == pytest.approx(3 * 2e11 * np.pi * 1e-12 / 4 / 0.05**3)
    quantities = derived(config)
    assert quantities["bending_ratio"].value == pytest.approx(2.03, abs=0.005)
    assert quantities["chain_frequency"].value == pytest.approx(config.slider.frequencies[0])
