"""The onset of slip against closed forms and scipy's integrator."""

import mesoslip
import numpy as np
import pytest
from mesoslip import ConfigError, RunError
from mesoslip.theory.force_curve import ForceCurve
from mesoslip.theory.slip_onset import EXPANSION_ERROR, end_of_expansion, solve
from scipy import integrate

SOURCE = {
    "contacts__coupling": "equal",
    "contacts__back_force_ratio": 0.0,
    "contacts__drag_rate": 0.0,
    "slider__damping_ratio": 0.0,
}


def test_melting_without_damping_is_a_free_oscillation():
    """x = D0 (1 - cos τ) + D1 τ, until the spring force has dropped by 2 D0."""
    d_0, d_1 = 0.94, 2.1e-3
    onset = solve("melting", (d_0, d_1, 0.0, 0.0))
    assert onset.ended
    assert onset.time[-1] == pytest.approx(np.pi, rel=1e-7)
    np.testing.assert_allclose(onset.force_drop, -d_0 * (1 - np.cos(onset.time)), atol=1e-8)


def test_melting_starts_quadratically_and_breaking_cubically():
    """Claim C14: the short-time laws of section 6 of the model."""
    coefficients = (0.796, 2.1e-3, 3.67e3, 2.6e5)
    melting = solve("melting", coefficients, interval=1e-3)
    early = slice(20, 60)
    time, drop = melting.time[early], -melting.force_drop[early]
    assert np.polyfit(np.log(time), np.log(drop), 1)[0] == pytest.approx(2, abs=0.01)
    np.testing.assert_allclose(drop / (0.5 * 0.796 * time**2), 1, rtol=1e-3)
    # The cubic law is that of the first term alone.
    linear = solve("sequential", (0.0, 2.1e-3, 0.0, 0.0), end_displacement=1.0, interval=1e-2)
    time = linear.time
    expected = 2.1e-3 * time**3 / 6
    np.testing.assert_allclose(-linear.force_drop, expected, atol=1e-8)


@pytest.mark.parametrize("equation", ["sequential", "melting"])
@pytest.mark.parametrize(("damping", "drag"), [(0.2, 0.0), (1.0, 0.5), (0.2, 1e3)])
def test_another_integrator(equation, damping, drag):
    d = (0.796, 2.1e-3, 3.67e3, 2.6e5)
    onset = solve(equation, d, damping=damping, drag=drag, end_displacement=5e-3)

    def rates(time, y):
        x, velocity, mean = y
        memory = damping * (velocity - mean)
        if equation == "sequential":
            return [velocity, d[1] * time + d[2] * x**2 + d[3] * x**3 - memory, memory]
        return [velocity, d[0] + d[1] * time - x - drag * velocity - memory, memory]

    other = integrate.solve_ivp(
        rates,
        (0, onset.time[-1]),
        [0, d[1], d[1]],
        method="Radau",
        rtol=1e-10,
        atol=1e-13,
        t_eval=onset.time,
    )
    np.testing.assert_allclose(onset.displacement, other.y[0], rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(onset.mean_velocity, other.y[2], rtol=1e-6, atol=1e-9)


def test_the_expansion_ends_where_it_is_wrong(klein):
    curve = ForceCurve(klein(**SOURCE))
    critical = curve.critical_points[0]
    end = end_of_expansion(curve)

    def error(distance):
        expansion = (
            critical.force
            - 97 * distance
            + critical.curvature * distance**2 / 2
            + critical.third_derivative * distance**3 / 6
        )
        return abs(expansion - curve.force(critical.displacement + distance)) / 18e-6

    assert error(end) == pytest.approx(EXPANSION_ERROR, rel=1e-6)
    assert np.all([error(part * end) < EXPANSION_ERROR for part in np.linspace(0, 0.999, 50)])


def test_onset_of_klein(klein):
    tree = mesoslip.onset(klein(**SOURCE))
    assert tree.attrs["alpha"] == pytest.approx(14.2, abs=0.05)
    assert tree.attrs["D1"] == pytest.approx(2.10e-3, abs=5e-6)
    assert tree.attrs["beta"] == pytest.approx(1.436, abs=1e-3)
    sequential = tree["sequential"].to_dataset()
    assert sequential["onset_displacement"][-1] == pytest.approx(tree.attrs["expansion_end"])
    assert "2 % of" in tree.attrs["comment"] or "0.02 of" in tree.attrs["comment"]


def test_there_is_no_onset_in_smooth_sliding(klein):
    tree = mesoslip.onset(klein(slider__stiffness=3e5, **SOURCE))
    assert tree.attrs["stable"] == "true"
    assert not tree.children
    assert "no onset" in tree.attrs["comment"]


def test_an_onset_needs_a_slider_that_can_slip(klein):
    near = {"curve": {"length": 3 * klein().contacts.break_stretch}}
    with pytest.raises(ConfigError, match=r"slider\.kind"):
        mesoslip.onset(klein(slider={"kind": "prescribed"}))
    with pytest.raises(ConfigError, match="drive"):
        mesoslip.onset(klein(drive__velocity=0.0, **near))


def test_a_film_too_viscous_to_let_the_force_drop(klein):
    near = {"length": 3 * klein().contacts.break_stretch}
    tree = mesoslip.onset(klein(contacts__drag_rate=2e19, curve=near))
    assert set(tree.children) == {"sequential"}
    assert "S47 has no solution" in tree.attrs["comment"]
    assert "beta" not in tree.attrs


def test_a_failure_of_cvode_is_an_error_and_prints_nothing(capfd):
    coefficients = (0.796, 2.1e-3, 1e200, 1e300)
    with pytest.raises(RunError, match=r"^CVODE failed \(integration, code -4\): At t = 0 "):
        solve("sequential", coefficients, end_displacement=1e200, interval=1.0)
    assert capfd.readouterr() == ("", "")
