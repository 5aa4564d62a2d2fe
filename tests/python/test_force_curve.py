"""The force curve of the master equation against closed forms and an independent solution."""

import mesoslip
import numpy as np
import pytest
from conftest import long
from mesoslip import _core
from mesoslip.simulation.kernel import named
from mesoslip.theory.curve import curve_tree
from mesoslip.theory.derived import ESTIMATE_RANGE, derived, verdict
from mesoslip.theory.force_curve import ForceCurve
from mesoslip.theory.lives import law_parameters
from oracles import frozen_law, stationary_force
from scipy import integrate

EQUAL = {"contacts__coupling": "equal", "contacts__back_force_ratio": 0.0}
STRETCH = 9e-9
FORCE = 18e-6


def dispersion(width, law="gaussian"):
    return {"contacts__threshold": {"law": law, "relative_width": width}}


@pytest.mark.parametrize("law", ["gaussian", "lognormal", "weibull", "exponential"])
@pytest.mark.parametrize(
    ("coupling", "back"), [("scaled", 0.1), ("equal", 0.0), long("scaled", 0.0), long("equal", 0.1)]
)
def test_stationary_sliding_is_stationary(klein, law, coupling, back):
    """A start in the stationary state stays there, at the force of the closed form."""
    config = klein(
        contacts__coupling=coupling,
        contacts__back_force_ratio=back,
        contacts__initial="steady",
        **dispersion(0.3, law),
    )
    curve = ForceCurve(config)
    expected = stationary_force(config)
    assert curve.steady_force == pytest.approx(expected, rel=1e-9)
    np.testing.assert_allclose(curve.force(curve.samples), curve.steady_force, rtol=1e-10)
    assert np.ptp(curve.breaks(curve.samples)) <= 1e-9 * curve.breaks(0.0)
    assert curve.conservation_error < 1e-12


@pytest.mark.parametrize(
    "law", ["gaussian", "lognormal", "weibull", "exponential", long("uniform")]
)
def test_the_far_end_is_stationary_sliding(klein, law):
    curve = ForceCurve(
        klein(curve={"length": 400 * STRETCH, "tolerance": 1e-7}, **dispersion(0.3, law))
    )
    lacks = abs(curve.force(curve.samples[-1]) - curve.steady_force) / FORCE
    assert lacks < (1e-8 if law != "uniform" else 2 * curve.error + 2 * curve.conservation_error)


def test_the_first_generation_has_a_closed_form(klein):
    """dF/dX = Nk [J_c(X) - X P_c(X)] while only contacts of the first generation break."""
    curve = ForceCurve(klein(curve={"length": 1.4 * STRETCH}, **EQUAL, **dispersion(0.05)))
    u = np.linspace(0, 1.38, 500)
    law = frozen_law("gaussian", 0.05)
    expected = 2000 * (law.sf(u) - u * law.pdf(u))
    # Those that broke at the peak bear load again.
    expected += 2000 * law.cdf(u)
    np.testing.assert_allclose(curve.slope(u * STRETCH), expected, atol=1e-6)


def test_what_the_formulas_of_the_source_give(klein):
    """Model section 7, second column."""
    narrow = ForceCurve(klein(curve__length=3 * STRETCH, **EQUAL, **dispersion(0.01)))
    assert narrow.K_star[0] == pytest.approx(7.8e4, rel=0.003)
    assert narrow.critical_points[0].D0 == pytest.approx(0.970, abs=5e-4)
    wide = ForceCurve(klein(**EQUAL, **dispersion(0.1)))
    first = wide.critical_points[0]
    assert first.D0 == pytest.approx(0.796, abs=5e-4)
    assert first.D2 == pytest.approx(3.67e3, rel=2e-3)
    assert wide.peak[0] >= first.force
    # Without a second generation, F = Nk X J_c(X) + Nk (what attached since), to 8 digits.
    law = frozen_law("gaussian", 0.1)
    x = first.displacement / STRETCH
    again, _ = integrate.quad(lambda y: (x - y) * law.pdf(y), -1, x, epsabs=1e-13, limit=500)
    assert first.force / FORCE == pytest.approx(x * law.sf(x) + again, rel=1e-8)
    slope = law.sf(x) - x * law.pdf(x) + law.cdf(x)
    assert slope == pytest.approx(-97 / 2000, abs=1e-8)
    score = -(x - 1) / 0.1**2
    curvature = -law.pdf(x) - (1 + x * score) * law.pdf(x) + law.pdf(x)
    assert first.D2 == pytest.approx(-0.5 * curvature * 2000 / STRETCH * FORCE / 97**2, rel=1e-8)


def test_all_solutions_of_the_instability(klein):
    curve = ForceCurve(klein(**EQUAL, **dispersion(0.2)))
    places = np.array([point.displacement for point in curve.critical_points])
    assert len(places) > 4
    np.testing.assert_allclose(curve.slope(places), -97, rtol=1e-9)
    assert np.all(np.diff(places) > 0)
    # Between the first two F' is below -K.
    assert curve.slope(places[:2].mean()) < -97
    assert not curve.stable


def test_a_stiff_spring_has_no_instability(klein):
    """An answer, not an error."""
    curve = ForceCurve(klein(slider__stiffness=3e5, curve__length=3 * STRETCH, **EQUAL))
    assert curve.stable
    assert curve.critical_points == ()
    summary = curve.summary()
    assert summary["X_c"] is None
    assert summary["D0"] is None
    assert summary["K_star"] == pytest.approx(77792.445, rel=1e-7)
    assert ForceCurve(klein(slider={"kind": "prescribed"}, **EQUAL)).stable


@pytest.mark.parametrize("initial", ["relaxed", "uniform", "steady"])
@pytest.mark.parametrize("coupling", ["scaled", "equal"])
def test_an_independent_solution(klein, initial, coupling):
    """Volterra's equation by the trapezoidal rule, with scipy's law and another choice of moments,
    and Richardson's extrapolation.
    """
    width, back = 0.2, 0.1
    config = klein(
        contacts__coupling=coupling,
        contacts__initial=initial,
        curve={"length": 2.5 * STRETCH},
        **dispersion(width),
    )
    curve = ForceCurve(config)
    results = [trapezoid(config, width, back, steps) for steps in (1000, 2000)]
    places = np.linspace(0, 2.5, 1001)
    fine, coarse = results[1][::2], results[0]
    expected = fine + (fine - coarse) / 3
    np.testing.assert_allclose(curve.force(places * STRETCH)[:-1] / FORCE, expected[:-1], atol=3e-6)


def trapezoid(config, width, back, steps):
    """F/F_s at equal steps up to 2.5 stretches by the trapezoidal rule and scipy's law."""
    law = frozen_law("gaussian", width)
    accepted = law.sf(back)
    u = np.linspace(back, 1 + 9 * width, 40001)
    weight = law.pdf(u) / accepted
    scaled = config.contacts.coupling == "scaled"
    k = np.sqrt(u) if scaled else np.ones_like(u)
    break_stretch, start = u / k, back / k
    life = break_stretch - start
    x = np.linspace(0, 2.5, steps + 1)

    def threshold(shift):
        """Threshold of contacts with (u - shift)/k(u) = x."""
        root = (x + np.sqrt(x**2 + 4 * shift)) / 2
        return root**2 if scaled else x + shift

    def density(shift):
        """Density of (u - shift)/k(u): of break stretches without a shift, of lives with f_b."""
        u_x = threshold(shift)
        slope = 2 * u_x / np.sqrt(x**2 + 4 * shift + 1e-300) if scaled else 1.0
        return np.where(u_x >= back, law.pdf(u_x) / accepted * slope, 0.0)

    def tail(values, shift):
        """E[values; (u - shift)/k(u) > x]."""
        sums = integrate.cumulative_trapezoid((values * weight)[::-1], -u[::-1], initial=0)[::-1]
        return np.interp(threshold(shift), u, sums)

    one = np.ones_like(u)
    kernel = density(back)
    newborn = back * tail(one, back) + x * tail(k, back)
    initial = config.contacts.initial
    if initial == "relaxed":
        rate = density(0.0)
        first = x * tail(k, 0.0)
    elif initial == "uniform":
        rate = tail(1 / break_stretch, 0.0)
        first = tail(k * break_stretch, 0.0) / 2 - x**2 * tail(k / break_stretch, 0.0) / 2
    else:
        mean_life = integrate.trapezoid(life * weight, u)
        rate = tail(one, back) / mean_life
        first = tail(k * (break_stretch**2 - start**2), back)
        first = (first - 2 * x * tail(k * start, back) - x**2 * tail(k, back)) / 2 / mean_life
    step = x[1]
    breaks = np.zeros_like(x)
    force = np.zeros_like(x)
    for n in range(steps + 1):
        sums = breaks[:n] * step
        if n > 0:
            sums[0] *= 0.5
        right = rate[n] + sums @ kernel[n:0:-1]
        breaks[n] = right / (1 - 0.5 * step * kernel[0]) if n > 0 else rate[0]
        force[n] = (
            first[n] + sums @ newborn[n:0:-1] + (0.5 * step * newborn[0] * breaks[n]) * (n > 0)
        )
    return force


def test_the_order_of_convergence(klein):
    """The error falls with the power of the number of points, until rounding."""
    law = named(law_parameters(klein(**EQUAL, **dispersion(0.2))))

    def force_at_end(points, width):
        point, _, _, force, *_, status, _ = _core.force_curve(
            *law, 0.0, width, round(1.2 / width), points
        )
        assert status == 0
        polynomial = np.polynomial.Polynomial.fit(point, force[:, -1], points - 1, domain=[0, 1])
        return polynomial(1.0)

    exact = force_at_end(14, 0.1)
    for points in (2, 4):
        errors = [abs(force_at_end(points, width) - exact) for width in (0.1, 0.05, 0.025)]
        orders = np.log2(np.array(errors[:-1]) / errors[1:])
        assert np.all(orders > points - 0.5), orders


def test_the_error_estimate_holds(klein):
    rough = ForceCurve(klein(curve={"tolerance": 1e-3}, **dispersion(0.2)))
    fine = ForceCurve(klein(curve={"tolerance": 1e-13}, **dispersion(0.2)))
    assert rough.panels <= fine.panels
    x = fine.samples
    assert np.max(np.abs(rough.force(x) - fine.force(x))) / FORCE <= rough.error
    assert rough.digits <= fine.digits


@pytest.mark.parametrize(
    ("coupling", "initial", "newborn_width"),
    [
        *(("scaled", "relaxed", 0.0), ("equal", "steady", 0.0), ("equal", "uniform", 2e-10)),
        *(long("equal", "relaxed", 0.0), long("scaled", "steady", 0.0)),
        *(long(coupling, "uniform", 0.0) for coupling in ("scaled", "equal")),
        *(long(coupling, "relaxed", 2e-10) for coupling in ("scaled", "equal")),
        long("scaled", "uniform", 2e-10),
    ],
)
def test_the_distribution_of_stretches(klein, coupling, initial, newborn_width):
    """Its integral is 1, and with equal stiffness its first moment is the force."""
    curve = ForceCurve(
        klein(
            contacts__coupling=coupling,
            contacts__initial=initial,
            curve={"newborn_width": newborn_width},
            **dispersion(0.15),
        )
    )
    x = np.linspace(-3e-9, 20e-9, 8001 if newborn_width == 0 else 501)
    for displacement in (3e-9, 25e-9):
        density, atom = curve.stretch_density(x, displacement)
        assert np.all(density >= 0)
        # Edges of the density fall between points.
        assert integrate.trapezoid(density, x) + atom == pytest.approx(1, abs=3e-3)
        if coupling == "equal":
            force = integrate.trapezoid(density * x, x) + atom * displacement
            assert 2000 * force == pytest.approx(float(curve.force(displacement)), rel=3e-3)


def test_the_potential_is_that_of_the_forces(klein):
    curve = ForceCurve(klein(**dispersion(0.1)))
    x = np.linspace(1e-9, 100e-9, 200)
    step = 1e-13
    slope = (curve.potential(x + step, 5e-8) - curve.potential(x - step, 5e-8)) / (2 * step)
    expected = curve.force(x) - 97 * (5e-8 - x)
    np.testing.assert_allclose(slope, expected, atol=1e-4 * FORCE)
    assert curve.potential(0.0, 5e-8) == pytest.approx(0.5 * 97 * 5e-8**2)


def test_a_fibre_bundle_breaks_once(klein):
    """Without attaching again, F = Nk X J_c(X)."""
    curve = ForceCurve(klein(contacts__reattach=False, **EQUAL, **dispersion(0.2)))
    u = np.linspace(0, 3, 300)
    expected = u * frozen_law("gaussian", 0.2).sf(u)
    np.testing.assert_allclose(curve.force(u * STRETCH) / FORCE, expected, atol=1e-6)
    assert curve.force(5 * STRETCH) == pytest.approx(0, abs=1e-15)


def test_a_rough_law_reports_its_digits(klein):
    """A uniform law has kinks in its force: fewer digits, and as many as it says."""
    curve = ForceCurve(klein(**dispersion(0.2, "uniform")))
    assert 5 <= curve.digits <= 9
    again = ForceCurve(klein(curve={"tolerance": 1e-4}, **dispersion(0.2, "uniform")))
    x = np.linspace(0, 19 * STRETCH, 1000)
    assert np.max(np.abs(curve.force(x) - again.force(x))) / FORCE <= again.error + curve.error


@pytest.mark.parametrize(
    ("width", "newborn_width"),
    [
        *((0.2, 9e-10), long(0.01, 9e-11)),
        *(long(0.05, 9e-10), long(0.05, 2e-9), long(0.2, 9e-11), long(0.2, 2e-9)),
    ],
)
def test_newborns_of_any_spread_are_conserved(klein, width, newborn_width):
    near = {"newborn_width": newborn_width, "length": 4 * STRETCH}
    curve = ForceCurve(klein(curve=near, **dispersion(width)))
    assert curve.conservation_error < 1e-6
    assert curve.error >= curve.conservation_error


def test_a_spring_just_too_soft(klein):
    """The two solutions next to K* are found however close they are."""
    near = {"curve__length": 3 * STRETCH}
    stiffness = ForceCurve(klein(**near)).K_star[0]
    curve = ForceCurve(klein(slider__stiffness=stiffness * (1 - 1e-8), **near))
    assert not curve.stable
    assert len(curve.critical_points) == 2


def test_a_curve_too_long_is_refused(klein):
    from mesoslip import ConfigError

    with pytest.raises(ConfigError, match=r"curve\.length"):
        ForceCurve(klein(curve={"length": 1.0}))


@pytest.mark.parametrize(
    ("law", "width", "back"),
    [
        *(("weibull", 2.0, 0.1), long("weibull", 1.3, 0.0)),
        *(("weibull", 1.0, 0.1), ("exponential", 1.0, 0.0)),
        *(long("weibull", 2.0, 0.0), long("weibull", 1.3, 0.1)),
        *(long("weibull", 1.0, 0.0), long("exponential", 1.0, 0.1)),
    ],
)
def test_a_force_that_only_rises_has_no_peak_and_no_instability(klein, law, width, back):
    """Lives the likelier to end the younger they are, equal contacts: ages only grow, K* = 0."""
    changes = {"contacts__coupling": "equal", "contacts__back_force_ratio": back}
    curve = ForceCurve(klein(**changes, **dispersion(width, law)))
    assert not curve.falls
    assert curve.K_star == (0.0, np.inf)
    assert curve.stable
    assert curve.critical_points == ()
    summary = curve.summary()
    assert summary["K_star"] == 0.0
    assert summary["K_star_displacement"] is summary["F_peak"] is summary["X_peak"] is None
    assert "does not fall" in curve.verdict
    # The widest law is far from stationary at the end of the curve, and it is said.
    assert ("longer curve.length" in curve.verdict) == (width > 1.5)
    assert curve_tree(curve).attrs["comment"] == curve.verdict


def test_a_stationary_start_has_no_peak(klein):
    curve = ForceCurve(klein(contacts__initial="steady", **dispersion(0.2)))
    assert not curve.falls
    assert curve.K_star[0] == 0.0
    assert "longer" not in curve.verdict


@pytest.mark.parametrize(("length", "is_early"), [(4e-9, True), (8.6e-9, True), (18e-8, False)])
def test_a_curve_that_ends_early_is_said_to(klein, length, is_early):
    """Before the peak, and before the steepest fall, near the mean breaking stretch of 9 nm."""
    curve = ForceCurve(klein(curve__length=length, **EQUAL, **dispersion(0.05)))
    assert ("longer curve.length" in curve.verdict) == is_early


def test_a_weak_fall_is_a_fall(klein):
    """A law whose hazard grows a little: a fall of 10^-5 F_s, of a curve with 10 digits."""
    changes = {"contacts__coupling": "equal", "contacts__back_force_ratio": 0.1}
    curve = ForceCurve(klein(**changes, **dispersion(0.8, "weibull")))
    assert curve.falls
    assert 0 < curve.K_star[0] < 0.1
    assert curve.peak[0] > curve.steady_force


def test_a_base_is_in_series_with_the_spring(klein):
    """A stiff spring on a soft base is unstable: in a run the contact force falls by half within
    some ms, in which the drive moves the spring by a hundredth of that."""
    base = {"mass": 14.7e-3, "stiffness": 1000.0, "damping": 100.0}
    layered = {"kind": "layered", "mass": 1.47e-3, "stiffness": 2e5, "layers": 2, "base": base}
    changes = {
        "contacts.threshold.relative_width": 0.1,
        "contacts.delay": 0.0,
        "contacts.coupling": "equal",
        "drive.velocity": 1e-6,
        "run.engine": "me",
        "run.duration": 0.028,
        "output.interval": 1e-4,
        "output.slip_interval": 0.0,
    }
    config = klein(slider={**layered, "layer_damping": 100.0}).replace(changes)
    curve = ForceCurve(config)
    assert not curve.stable
    assert curve.K_star[0] < config.spring_stiffness
    alone = ForceCurve(klein(slider__stiffness=1 / (1 / 2e5 + 1 / 1000)).replace(changes))
    assert curve.critical_points[0] == pytest.approx(alone.critical_points[0], rel=1e-9)
    assert ForceCurve(klein(slider__stiffness=2e5).replace(changes)).stable
    assert "below the estimate" in verdict(config)
    force = mesoslip.run(config, executor=1)["contact_force"].values[0]
    top = int(np.argmax(force))
    assert force[top] == pytest.approx(curve.peak[0], rel=2e-2)
    assert np.min(force[top : top + 70]) < 0.5 * force[top]


@pytest.mark.parametrize("law", ["gaussian", "uniform", *map(long, ["lognormal", "weibull"])])
@pytest.mark.parametrize(
    ("width", "coupling"),
    [(0.01, "equal"), (0.1, "scaled"), long(0.01, "scaled"), long(0.1, "equal")],
)
def test_the_estimate_is_as_near_as_the_verdict_states(klein, law, width, coupling):
    config = klein(
        contacts__threshold={"law": law, "relative_width": width},
        contacts__coupling=coupling,
        curve={"length": 3 * STRETCH, "tolerance": 1e-4},
    )
    estimate = derived(config)["K_star_estimate"].value
    low, high = ESTIMATE_RANGE
    assert low < ForceCurve(config).K_star[0] / estimate < high


def test_the_verdict_compares_with_the_estimate(klein):
    config = klein()
    estimate = derived(config)["K_star_estimate"].value
    low, high = ESTIMATE_RANGE
    for factor, words in (
        (low / 1.1, "below the estimate"),
        (1.1 * low, "times the estimate"),
        (high / 1.1, "times the estimate"),
        (1.1 * high, "above the estimate"),
    ):
        assert words in verdict(config.replace({"slider.stiffness": factor * estimate}))


def test_verdicts_say_what_they_do_not_mean(klein, command, tmp_path):
    """K < K* is neither necessary nor sufficient for stick-slip with delay: K = 200 N/m and 0.3 ms
    slide smoothly after 5 s."""
    near = {"curve__length": 3 * STRETCH}
    soft = klein(slider__stiffness=200.0, contacts__delay=3e-4, **near)
    assert "decide whether slips continue" in ForceCurve(soft).verdict
    assert "delay" in ForceCurve(soft).verdict
    assert "necessary" not in ForceCurve(soft).verdict
    stiff = ForceCurve(klein(slider__stiffness=1e6, **near))
    assert stiff.stable
    assert "slow sliding" in stiff.verdict
    assert "stick-slip nevertheless" in stiff.verdict
    assert "follows the drive" in ForceCurve(klein(slider={"kind": "prescribed"}, **near)).verdict
    path = tmp_path / "soft.toml"
    path.write_text(soft.to_toml())
    for name in ("curve", "onset", "info"):
        printed = command(name, path)[1]
        assert "decide whether" in printed
        assert "necessary" not in printed
    assert "with a delay" in command("info", path, "--set", "slider.stiffness=1e6")[1]
