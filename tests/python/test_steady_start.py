"""Starts in the stationary state of slow sliding, against the weighted laws by scipy."""

import time

import numpy as np
import pytest
from conftest import long
from mesoslip.simulation.realization import Realization
from oracles import frozen_law, stationary_force, uniforms
from scipy import stats

LAWS = {
    "gaussian": [0.01, 0.2, 0.6],
    "uniform": [0.3, 0.55],
    "lognormal": [0.2, 2.0],
    "weibull": [0.3, 1.5],
    "exponential": [0.4, 1.0],
}
NODE, WEIGHT = (0.5 * one for one in np.polynomial.legendre.leggauss(500))
NODE = NODE + 0.5
CASES = [
    (law, width, coupling, back)
    for law, widths in LAWS.items()
    for width in widths
    for coupling in ("equal", "scaled")
    for back in (0.0, 0.1)
]


def start(klein, law, width, coupling, back, count, **changes):
    """The configuration, and relative thresholds and stretches over f_s/k of its contacts."""
    config = klein(
        slider={"kind": "prescribed"},
        contacts__count=count,
        contacts__initial="steady",
        contacts__coupling=coupling,
        contacts__back_force_ratio=back,
        contacts__threshold={"law": law, "relative_width": width},
        **changes,
    )
    contacts = Realization(config, 0).contacts
    static, stiffness = config.contacts.contact_static_force, config.contacts.contact_stiffness
    limit = contacts["break_stretch"] * stiffness / static
    threshold = limit if coupling == "equal" else limit**2
    stretch = -contacts["origin"] * stiffness / static
    return config, threshold, stretch, limit, contacts


def weighted_survival(law, width, coupling, back):
    """E[x_s - x_b; u > U]/E[x_s - x_b] by quadrature over the probability of the plain law."""
    plain = frozen_law(law, width)
    whole = plain.sf(back)

    def above(threshold):
        # Thresholds are far away or come close to 0 at the ends: densely there.
        end = plain.sf(max(threshold, back))
        u = plain.isf(end * NODE**2 * (3 - 2 * NODE))
        way = u - back if coupling == "equal" else (u - back) / np.sqrt(u)
        return end * np.sum(WEIGHT * 6 * NODE * (1 - NODE) * way)

    mean = above(back if whole < 1 else max(0.0, plain.support()[0]))
    return lambda threshold: above(threshold) / mean


@pytest.mark.parametrize(("law", "width", "coupling", "back"), CASES)
def test_a_contact_is_drawn_by_the_two_deviates_of_its_key(klein, law, width, coupling, back):
    """The weighted law at a threshold is the first deviate; the second places the stretch."""
    _, threshold, stretch, limit, _ = start(klein, law, width, coupling, back, 40, run__seed=5)
    survival = weighted_survival(law, width, coupling, back)
    for contact in range(40):
        first, second = uniforms(5, 0, contact, 0)
        assert survival(threshold[contact]) == pytest.approx(first, rel=1e-6, abs=1e-7)
        newborn = back if coupling == "equal" else back / np.sqrt(threshold[contact])
        expected = newborn + second * (limit[contact] - newborn)
        assert stretch[contact] == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("coupling", [long("equal"), "scaled"])
@pytest.mark.parametrize("law", LAWS)
def test_the_start_is_stationary(klein, law, coupling):
    """Thresholds, places between attaching and breaking, and the force, of 30 000 contacts."""
    count, width, back = 30_000, LAWS[law][-1], 0.1
    config, threshold, stretch, limit, contacts = start(klein, law, width, coupling, back, count)
    # The survival function between quantiles of the sample, where it is smooth, linearly.
    knots = np.quantile(threshold, np.linspace(0, 1, 200))
    survival = weighted_survival(law, width, coupling, back)
    table = np.array([survival(one) for one in knots])
    kolmogorov = stats.kstest(threshold, lambda u: 1 - np.interp(u, knots, table))
    assert kolmogorov.pvalue > 1e-3
    newborn = back if coupling == "equal" else back / np.sqrt(threshold)
    place = (stretch - newborn) / (limit - newborn)
    assert stats.kstest(place, "uniform").pvalue > 1e-3
    assert abs(stats.spearmanr(threshold, place).statistic) < 4 / np.sqrt(count)
    force = -contacts["stiffness"] * contacts["origin"]
    expected = stationary_force(config)
    assert abs(force.sum() - expected) < 4 * force.std() * np.sqrt(count)


def test_contacts_do_not_depend_on_how_many_there_are(klein):
    few, many = (start(klein, "lognormal", 1.0, "scaled", 0.1, n)[1] for n in (10, 50))
    np.testing.assert_allclose(few, many[:10], rtol=1e-12)


def test_a_wide_law_is_drawn_in_no_time(klein):
    """By rejection this took 2 ms a contact and more."""
    begin = time.perf_counter()
    start(klein, "lognormal", 5.0, "equal", 0.0, 50_000)
    assert time.perf_counter() - begin < 5
