"""Linear stability of steady sliding with delay, against independent formulas and runs."""

import math

import mesoslip
import numpy as np
import pytest
import steady_sliding
from conftest import long
from mesoslip import ConfigError, SteadySliding
from mesoslip.analysis.regime.result import STICK_SLIP
from mesoslip.quantities import with_unit
from mesoslip.theory.force_curve import ForceCurve
from mesoslip.theory.lives import newborn_stretch, scales
from mesoslip.theory.sliders import dynamic_stiffness
from mesoslip.theory.steady_sliding import stability_boundary, stable_stiffness
from scipy import special

pytestmark = pytest.mark.usefixtures("no_step_errors")


def linearized(config, rate):
    """Λ(λ) as the linearized equations give it, term by term, for a gaussian law.

    X = v t + ε e^(λt), births B0 t + c e^(λt). The integrals over the births are done by a rule of
    their own, and those over thresholds by Gauss and Hermite's.
    """
    contacts, velocity = config.contacts, config.drive_speed
    point, weight = special.roots_hermitenorm(60)
    weight = weight / np.sum(weight)
    u = 1 + contacts.threshold.relative_width * point
    keep = u > contacts.back_force_ratio
    u, weight = u[keep], weight[keep] / np.sum(weight[keep])
    scaled = contacts.coupling == "scaled"
    unit = contacts.break_stretch
    stiffness = contacts.contact_stiffness * (np.sqrt(u) if scaled else np.ones_like(u))
    mass_drag = contacts.contact_drag * (u if scaled else np.ones_like(u))
    broken = unit * (np.sqrt(u) if scaled else u)
    born = contacts.back_force_ratio * contacts.contact_static_force / stiffness
    life = broken - born
    births = velocity / (weight @ life + velocity * contacts.delay)
    age = life / velocity
    end = np.exp(-rate * age)
    late = np.exp(-rate * contacts.delay)
    psi = weight @ end
    # Detachments are births a life ago, and births are detachments a delay ago.
    born_change = births / velocity * late * (1 - psi) / (1 - psi * late)
    node, share = np.polynomial.legendre.leggauss(40)
    passed = age[:, None] * (1 + node) / 2
    share = age[:, None] * share / 2
    moved = births * np.sum(share * (1 - np.exp(-rate * passed)), axis=1)
    fresh = (
        born_change
        * rate
        * np.sum(share * np.exp(-rate * passed) * (born[:, None] + velocity * passed), axis=1)
    )
    gone = births / velocity * (1 - end) * broken
    pinned = weight @ (stiffness * (moved + fresh - gone))
    let_go = weight @ (mass_drag * (births / velocity * (1 - end) + born_change * end))
    steady = weight @ mass_drag * births * contacts.delay
    return contacts.count * (pinned + rate * steady + velocity * let_go * (1 - late))


CASES = [
    {},
    {"contacts__coupling": "equal", "contacts__drag_rate": 2e15},
    {"contacts__back_force_ratio": 0.0, "contacts__threshold__relative_width": 0.1},
    {"contacts__delay": 3e-3, "drive__velocity": 1e-5, "contacts__drag_rate": 2e14},
]


@pytest.mark.parametrize("changes", CASES)
def test_response_is_that_of_the_linearized_equations(klein, changes):
    config = klein(**{"drive__velocity": 2e-6, **changes})
    sliding = SteadySliding(config)
    for rate in (30.0, 400j, 2000j, 50 + 900j, -20 + 300j):
        expected = linearized(config, rate)
        assert complex(sliding.response_at(rate)) == pytest.approx(expected, rel=1e-9)
    assert complex(sliding.response(400.0)) == complex(sliding.response_at(400j))


@pytest.mark.parametrize("law", ["uniform", "lognormal", "weibull", "exponential"])
def test_force_and_slope_are_closed_forms(klein, law):
    config = klein(contacts__threshold={"law": law, "relative_width": 0.4}, drive__velocity=1e-5)
    sliding = SteadySliding(config)
    quantities = mesoslip.derived(config)
    assert sliding.force == pytest.approx(quantities["F_steady_drive"].value, rel=1e-7)
    life = sliding.lives.mean_life * config.contacts.break_stretch
    assert life == pytest.approx(quantities["mean_life"].value, rel=1e-7)
    # Slow shaking is sliding at other velocities.
    faster, slower = (SteadySliding(config, (1 + one) * 1e-5).force for one in (1e-4, -1e-4))
    assert sliding.slope == pytest.approx((faster - slower) / 2e-9, rel=1e-6)
    assert complex(sliding.response_at(0.1) / 0.1).real == pytest.approx(sliding.slope, rel=0.01)


def test_without_delay_steady_contacts_do_not_answer(klein):
    config = klein(contacts__delay=0.0, slider__stiffness=20.0, slider__damping_ratio=0.3)
    sliding = SteadySliding(config, 1e-6)
    assert np.max(np.abs(sliding.response(np.geomspace(1, 1e4, 30)))) == 0
    assert sliding.is_stable
    # Damping relative to the mean velocity: (M λ² + K)(λ + η) + M η λ² = 0.
    mass, eta = config.slider.mass, config.slider.damping_rate
    slider = np.roots([mass, 2 * mass * eta, 20.0, 20.0 * eta])
    roots = sliding._roots(1e-3)
    assert np.min(np.abs(roots - slider[slider.imag > 0][0])) < 1e-6


@pytest.mark.parametrize("velocity", [3e-7, long(3e-6)])
def test_roots_are_as_many_as_the_argument_tells(klein, velocity):
    """All unstable roots by Newton's method from a fine grid of starts, one by one."""
    config = klein(contacts__threshold__relative_width=0.05, drive__velocity=velocity)
    sliding = SteadySliding(config)

    def function(rate):
        slider = dynamic_stiffness(config.slider, rate)
        return slider.numerator / slider.denominator + sliding.response_at(rate)

    real, imaginary = np.meshgrid(np.linspace(0.5, 120, 7), np.linspace(0, 2500, 200))
    root = (real + 1j * imaginary).ravel()
    with np.errstate(all="ignore"):
        for _ in range(40):
            here = function(root)
            step = here * 1e-5 / (function(root + 1e-5) - here)
            root = root - step * np.minimum(1, 20 / np.abs(step))
        good = (np.abs(function(root)) < 1e-4) & (root.real > 1e-4) & (np.abs(root) < 1e4)
    found = np.unique(np.round(np.where(root.imag < 0, root.conj(), root)[good], 3))
    count = 2 * np.sum(found.imag > 0.01) + np.sum(found.imag <= 0.01)
    assert sliding.unstable_count == count
    leading = found[np.argmax(found.real)]
    assert sliding.leading_root == pytest.approx(leading, abs=2e-3)
    assert sliding.growth_rate == sliding.leading_root.real


def test_one_layer_is_a_rigid_slider_without_damping(klein):
    rigid = klein(slider__damping_ratio=0.0, drive__velocity=3e-6)
    layers = {"kind": "layered", "mass": 1.47e-3, "stiffness": 97.0, "layers": 1}
    one = klein(slider=layers, drive__velocity=3e-6)
    assert SteadySliding(one).leading_root == pytest.approx(SteadySliding(rigid).leading_root)
    # A base so heavy that it rests, or so stiff.
    for base in ({"mass": 100.0, "stiffness": 1e4}, {"mass": 1e-2, "stiffness": 1e7}):
        resting = klein(slider={**layers, "base": base}, drive__velocity=3e-6)
        root = SteadySliding(resting).leading_root
        assert root == pytest.approx(SteadySliding(rigid).leading_root, rel=1e-3)


def test_frequencies_of_a_chain_are_those_of_its_formula(klein):
    layers = {"kind": "layered", "mass": 1.47e-3, "stiffness": 97.0, "layers": 5}
    slider = klein(slider=layers).slider
    for frequency in slider.frequencies:
        around = dynamic_stiffness(slider, 1j * frequency * np.array([0.999, 1.0, 1.001]))
        values = np.abs(around.numerator)
        assert values[1] < 1e-6 * values[0]


NEWBORN = {
    "coupling": "equal",
    "newborn_width": 0.1,
    "threshold": {"law": "gaussian", "relative_width": 0.2},
}


@pytest.mark.parametrize(
    ("contacts", "bound"),
    [({"threshold": {"law": "gaussian", "relative_width": 0.3}}, 0.02), (NEWBORN, 5e-3)],
)
def test_engine_answers_as_reported(contacts, bound):
    """With newborn contacts of different forces it is another answer, by a tenth."""
    config = steady_sliding.tables(contacts=contacts)
    sliding = SteadySliding(
        mesoslip.Config.from_dict(
            {**config, "run": {"engine": "me", "duration": 1.0}, "drive": {"velocity": 1e-6}}
        )
    )
    periods = 4 if contacts is NEWBORN else 8
    found = steady_sliding.shaken_response(
        1e-6, 600.0, 1e-10, 0.1, periods=periods, contacts=contacts
    )
    assert found == pytest.approx(complex(sliding.response(600.0)), rel=bound)


@pytest.mark.parametrize(
    ("law", "width", "newborn_width"),
    [("gaussian", 0.1, 0.05), ("uniform", 0.2, 0.01), ("weibull", 0.3, 0.05)],
)
def test_averages_over_newborn_forces_are_those_of_the_renewal_equation(
    klein, law, width, newborn_width
):
    """Means over lives, here and in the kernel of the force curve."""
    config = klein(
        contacts__coupling="equal",
        contacts__threshold={"law": law, "relative_width": width},
        contacts__newborn_width=newborn_width,
    )
    lives, expected = SteadySliding(config).lives, scales(config, newborn_stretch(config))
    assert lives.mean_life == pytest.approx(expected.mean_life, rel=1e-8)
    assert lives.newborn_force == pytest.approx(expected.newborn_force, abs=1e-8)
    assert lives.work / lives.mean_life == pytest.approx(expected.steady_force, rel=1e-8)


def test_boundary_is_where_growth_begins(klein):
    config = klein(contacts__threshold__relative_width=0.2, drive__velocity=3e-6)
    delay = stability_boundary(config, "contacts.delay", 1e-5, 1e-3)
    sliding = SteadySliding(config.replace({"contacts.delay": delay}))
    assert abs(sliding.growth_rate) < 0.2
    assert stability_boundary(config, "contacts.delay", 5e-4, 1e-3) is None
    # A stiffer spring, with its damping, takes more delay.
    stiff = config.replace({"slider.stiffness": 400.0})
    assert stability_boundary(stiff, "contacts.delay", 1e-5, 1e-3) > delay


def test_stiffer_springs_than_one_make_sliding_stable(klein, tmp_path, command):
    config = klein(curve={"length": 3 * klein().contacts.break_stretch})
    found, most = stable_stiffness(config), stable_stiffness(config, dephased=True)
    # K* is far above, and the spring of the experiment below.
    assert 97 < most < found < ForceCurve(config).K_star[0] / 10
    for factor, is_stable in ((0.99, False), (1.01, True), (8, True)):
        sliding = SteadySliding(config.replace({"slider.stiffness": factor * found}))
        assert sliding.is_stable == is_stable
        sliding = SteadySliding(config.replace({"slider.stiffness": factor * most}))
        assert sliding.is_stable_dephased == is_stable
    assert stable_stiffness(klein(contacts__delay=0.0)) is None
    # So long a delay feeds oscillations of the stiffest spring.
    long = klein(contacts__delay=1e-2)
    stiffest = long.replace({"slider.stiffness": 16 * long.contacts.stiffness})
    assert not SteadySliding(stiffest).is_stable
    assert stable_stiffness(long) is None
    file = tmp_path / "klein.toml"
    file.write_text(config.to_toml())
    printed = command("curve", file)[1]
    assert f"{with_unit(found, 'N/m', 3)}  steady sliding at 100 nm/s is linearly" in printed
    assert f"{with_unit(most, 'N/m', 3)}  the same for dephased contacts" in printed
    assert "spring stiffer than" not in command("curve", file, "--set", "contacts.delay=0")[1]


def test_what_has_no_steady_sliding_is_refused(klein):
    with pytest.raises(ConfigError, match="without it there is no steady sliding"):
        SteadySliding(klein(contacts__reattach=False))
    ageing = {"law": "relax", "time": 1e-3, "young_force_ratio": 0.5, "young_relative_width": 0.1}
    with pytest.raises(ConfigError, match="a response of its own"):
        SteadySliding(klein(contacts__coupling="equal", contacts__ageing=ageing))
    with pytest.raises(ConfigError, match="needs a velocity"):
        SteadySliding(klein(), 0.0)
    chain = klein(slider={"kind": "layered", "mass": 1e-3, "stiffness": 97.0, "layers": 17})
    with pytest.raises(ConfigError, match="at most 16"):
        SteadySliding(chain)
    assert SteadySliding(klein(slider={"kind": "prescribed"})).leading_root is None
    assert math.isnan(SteadySliding(klein(slider={"kind": "prescribed"})).growth_rate)


def test_info_and_curve_report_steady_sliding(klein, tmp_path, command):
    file = tmp_path / "klein.toml"
    file.write_text(klein(curve={"length": 3 * klein().contacts.break_stretch}).to_toml())
    soft = ("--set", "slider.stiffness=200", "--set", "contacts.delay=3e-4")
    for name in ("info", "curve"):
        printed = command.output(name, file, *soft)
        assert "delay" in printed
        assert "inertia decide whether slips" in printed
        assert "is linearly unstable, with delay" in printed
        assert "but not for dephased contacts" in printed
        assert "no amplitude: only a run or mesoslip cycle shows it" in printed
    for velocity in ("1e-7", "3e-6"):
        printed = command("info", file, "--set", f"drive.velocity={velocity}")[1]
        assert "also for dephased contacts" in printed
    # Where `mesoslip cycle` refuses the configuration, or leaves something out.
    for change in ("contacts.reattach=false", "slider.kind=layered", "interaction.strength=0.1"):
        changes = ["slider.layers=2"] if "layered" in change else []
        changes += ["interaction.columns=60", "interaction.rows=68"] if "interac" in change else []
        options = [word for one in (change, *changes) for word in ("--set", one)]
        assert "mesoslip cycle" not in command("info", file, *options)[1]
    printed = command.output("info", file, "--set", "contacts.delay=0")
    assert "is linearly stable, as there is no delay" in printed
    assert "A large oscillation may be possible too" in printed
    quantities = mesoslip.derived(klein())
    assert quantities["steady_growth_rate"].value == SteadySliding(klein()).growth_rate
    assert quantities["steady_frequency"].unit == "1/s"
    neighbours = {"strength": 0.1, "columns": 60, "rows": 68}
    assert "steady_growth_rate" not in mesoslip.derived(klein(interaction=neighbours))
    # What takes long is left out.
    assert "steady_growth_rate" not in mesoslip.derived(klein(contacts__delay=1e4))
    for slider in ({"kind": "prescribed"}, {"kind": "quasistatic", "stiffness": 97.0}):
        assert "steady_growth_rate" not in mesoslip.derived(klein(slider=slider))


def test_stick_slip_above_the_stiffness_of_the_force_curve(klein, tmp_path, command):
    """The force curve of wide thresholds does not fall, K* = 0; delay makes them slip all the same,
    so that no sentence may call K < K* necessary."""
    config = klein(
        contacts__threshold__relative_width=0.5,
        contacts__delay=2e-3,
        contacts__initial="steady",
        contacts__count=2000,
        drive__velocity=1e-6,
        run__duration=3.0,
    )
    assert mesoslip.curve(config).attrs["K_star"] == 0
    assert int(mesoslip.regime(mesoslip.run(config))["regime"][0]) == STICK_SLIP
    file = tmp_path / "wide.toml"
    file.write_text(config.to_toml())
    printed = command("curve", file)[1]
    assert "with it there may be stick-slip nevertheless" in printed
    assert "necessary" not in printed + command("info", file)[1]


def test_overflow_is_reported(klein):
    """A mountain on a spring, driven at a metre in a second: no number, and no warning."""
    config = klein(
        drive__velocity=1.0,
        slider__mass=1e13,
        contacts__threshold={"law": "exponential", "relative_width": 1.0},
    )
    with pytest.raises(mesoslip.RunError, match="range of floating-point numbers"):
        _ = SteadySliding(config).unstable_count
    assert "steady_growth_rate" not in mesoslip.derived(config)
