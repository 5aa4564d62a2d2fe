"""Closed forms, conservation, and what a result must not depend on."""

import mesoslip
import numpy as np
import pytest
from conftest import at_end, drive_in_stages, long
from mesoslip.configuration.threshold_laws import LAWS as LAWS_BY_NAME
from mesoslip.simulation.realization import Realization
from mesoslip.simulation.recorded_tables import ENERGY_COLUMNS
from oracles import stationary_force

LAWS = {"gaussian": 0.2, "uniform": 0.3, "lognormal": 0.5, "weibull": 0.5, "exponential": 0.8}
PRESCRIBED = {"slider": {"kind": "prescribed"}, "output__interval": 1e-3}
LIKE_OTHERS = {"lognormal", "weibull"}


def mean_force(config, skip: float) -> tuple[float, float]:
    """Mean contact force after a time, over time and realizations, and its standard error."""
    tree = mesoslip.run(config)
    late = tree["contact_force"].values[:, tree["time"].values > skip]
    means = late.mean(axis=1)
    return float(means.mean()), float(means.std(ddof=1) / np.sqrt(len(means)))


@pytest.mark.parametrize("coupling", ["scaled", long("equal")])
@pytest.mark.parametrize("law", LAWS)
def test_slow_sliding_gives_the_stationary_force(klein, law, coupling):
    config = klein(
        **PRESCRIBED,
        run={"duration": 1.0, "realizations": 16},
        drive__velocity=5e-8,
        contacts__count=1000,
        contacts__delay=0.0,
        contacts__initial="steady",
        contacts__coupling=coupling,
        contacts__threshold={"law": law, "relative_width": LAWS[law]},
    )
    mean, error = mean_force(config, -1.0)
    expected = stationary_force(config)
    assert error < 0.01 * expected
    assert abs(mean - expected) < 4 * error


@pytest.mark.parametrize(
    ("law", "coupling"),
    [
        *(long(law, "scaled") if law in LIKE_OTHERS else (law, "scaled") for law in LAWS),
        *(("gaussian", "equal") if law == "gaussian" else long(law, "equal") for law in LAWS),
    ],
)
def test_the_delay_weakens_the_force_with_velocity(klein, law, coupling):
    config = klein(
        **PRESCRIBED,
        run={"duration": 0.2, "realizations": 16},
        drive__velocity=1e-5,
        contacts__count=500,
        contacts__delay=1e-3,
        contacts__drag_rate=2e16,
        contacts__initial="steady",
        contacts__coupling=coupling,
        contacts__threshold={"law": law, "relative_width": LAWS[law]},
    )
    # By then every contact has broken dozens of times.
    mean, error = mean_force(config, 0.1)
    expected = stationary_force(config, 1e-5)
    assert error < 0.01 * expected
    assert abs(mean - expected) < 4 * error
    assert abs(expected / stationary_force(config) - 1) > 0.1


@pytest.mark.parametrize(
    "changes",
    [
        {"run__duration": 30.0},
        {"contacts__count": 1},
        {"contacts__count": 2, "contacts__delay": 0.0, "slider__damping_ratio": 0.0},
        {"contacts__drag_rate": 2e16, "contacts__delay": 1e-2},
        {
            "contacts__count": 10**6,
            "drive__velocity": 1e-5,
            "run__duration": 0.02,
            "output__interval": 1e-4,
        },
        {"slider": {"kind": "prescribed"}, "run__duration": 1.0},
        {"contacts__threshold": {"law": "exponential", "relative_width": 1.0}},
        {"drive": drive_in_stages((4.0, 1e-7), (1.0, 0.0), (7.0, -2e-7))},
    ],
    ids=["30 s", "one", "two", "strong drag", "million", "prescribed", "exponential", "stages"],
)
def test_energy_balance_closes(klein, changes):
    tree = mesoslip.run(klein(**changes))
    assert abs(tree["energy_residual"].values[0]) < 1e-10
    assert tree["breaks"].values[0] > 0
    assert tree["energy/drive_work"].values[0] != 0


def test_displacements_are_absolute(klein):
    """The kernel's origin moves along with the slider; what is recorded does not."""
    tree = mesoslip.run(klein(drive__velocity=1e-6, run__duration=1.0))
    drive, displacement = tree["drive_displacement"].values[0], tree["displacement"].values[0]
    np.testing.assert_allclose(drive, 1e-6 * tree["time"].values, rtol=1e-12)
    np.testing.assert_allclose(
        tree["spring_force"].values[0], 97 * (drive - displacement), atol=1e-9 * 18e-6
    )
    assert displacement[-1] > 64 * 9e-9


def test_a_pinned_slider_follows_the_drive_by_its_stiffness(klein):
    """Before any break F = Nk X, and the slider hangs between two springs."""
    tree = mesoslip.run(klein(contacts__coupling="equal", run__duration=1.5))
    displacement, drive = tree["displacement"].values[0], tree["drive_displacement"].values[0]
    assert tree["breaks"].values[0] == 0
    np.testing.assert_allclose(tree["contact_force"].values[0], 2000 * displacement, atol=1e-19)
    # After the ringing of the start, the damping, which acts on fluctuations only, has no part.
    late = tree["time"].values > 0.8
    np.testing.assert_allclose(displacement[late], drive[late] * 97 / 2097, rtol=1e-6)


def test_without_reattachment_the_slider_is_free_in_the_end(klein):
    """All contacts broken, the drag is that of the whole film: F_d = N m eta v_d."""
    config = klein(contacts__reattach=False, contacts__drag_rate=2e14, run__duration=4.0)
    tree = mesoslip.run(config)
    assert tree["breaks"].values[0] == 4080
    assert tree["detached_contacts"].values[0, -1] == 4080
    # The thresholds' mean of mass is that of u, 1 within its standard error.
    expected = 956 * 1e-10 * 3.5e-9 * 2e14 * 1e-7
    late = tree["time"].values > 3.5
    np.testing.assert_allclose(tree["spring_force"].values[0, late].mean(), expected, rtol=2e-3)


@pytest.mark.parametrize("initial", ["relaxed", "steady", "uniform"])
def test_a_run_starts_at_rest_in_balance(klein, initial):
    tree = mesoslip.run(klein(contacts__initial=initial, run__duration=0.01))
    first = tree.to_dataset().isel(realization=0, time=0)
    assert first["displacement"] == 0
    assert first["velocity"] == 0
    np.testing.assert_allclose(first["spring_force"], first["contact_force"], rtol=1e-12)
    if initial == "relaxed":
        assert first["contact_force"] == 0
    else:
        # Half the breaking stretch, with x_b = 0.1 x_s below it in the steady state.
        mean = {"steady": 0.55, "uniform": 0.5}[initial]
        np.testing.assert_allclose(first["contact_force"], mean * 18e-6, rtol=0.03)


def test_contacts_are_conserved(klein):
    realization = Realization(klein(run__duration=2.2), 0)
    while not realization.finished:
        realization.advance(5000)
        pinned = np.count_nonzero(realization.contacts["stiffness"])
        assert 0 <= pinned <= 4080
    trace = realization.trace
    assert pinned + trace[-1, 6] == 4080
    renewals = realization.contacts["renewals"].sum()
    assert renewals == realization.breaks


def test_results_do_not_depend_on_how_they_are_computed(klein):
    """Segments, threads and other realizations leave every number as it is."""
    config = klein(run__duration=2.2, run__realizations=3, output__slip_interval=1e-4)
    alone = klein(run__duration=2.2, output__slip_interval=1e-4)
    together = mesoslip.run(config, executor=2)
    one_by_one = mesoslip.run(config, executor=1)
    single = mesoslip.run(alone)
    piecewise = at_end(Realization(alone, 0), 997)
    for name in ("displacement", "velocity", "spring_force", "contact_force"):
        np.testing.assert_array_equal(together[name].values, one_by_one[name].values)
        np.testing.assert_array_equal(together[name].values[0], single[name].values[0])
        assert not np.array_equal(together[name].values[0], together[name].values[1])
    np.testing.assert_array_equal(piecewise.trace[:, 4], single["spring_force"].values[0])
    np.testing.assert_array_equal(
        piecewise.slip_trace[:, 4], single["slip_traces/spring_force"].values
    )
    for name, term in zip(ENERGY_COLUMNS, piecewise.energy, strict=True):
        if name in {"step_work", "separation_loss"}:
            # Contacts one by one have no steps, and none separates under a constant load.
            assert term == 0
        elif name not in {"gross_work", "residual"}:
            assert single["energy"][name].values[0] == term


def test_segments_end_when_much_was_recorded(klein):
    """What was recorded is taken away before it is much, however long a segment may be."""
    realization = Realization(klein(run__duration=0.5, output__interval=5e-6), 0)
    longest = 0
    while not realization.finished:
        before = len(realization.rows("trace"))
        realization.advance(10**12)
        longest = max(longest, len(realization.rows("trace")) - before)
    assert longest < 25_000
    assert len(realization.trace) == 100_001


def test_samples_do_not_change_a_run(klein):
    """The motion is the same however often one looks."""
    coarse = mesoslip.run(klein(run__duration=2.2, output__interval=1e-2))
    fine = mesoslip.run(klein(run__duration=2.2, output__interval=1e-3, output__slip_interval=1e-4))
    np.testing.assert_array_equal(
        coarse["spring_force"].values, fine["spring_force"].values[:, ::10]
    )


def test_the_seed_matters(klein):
    one = mesoslip.run(klein(run__duration=2.2))
    other = mesoslip.run(klein(run__duration=2.2, run__seed=2))
    assert not np.array_equal(one["spring_force"].values, other["spring_force"].values)


def test_threshold_laws_are_those_of_scipy():
    from oracles import frozen_law

    assert {name for name, law in LAWS_BY_NAME.items() if not law.is_sampled} == LAWS.keys()
    for law, width in LAWS.items():
        ours, theirs = mesoslip.ThresholdLaw(law, width, 0.1), frozen_law(law, width)
        above = theirs.sf(0.1)
        probability = np.array([1e-12, 1e-3, 0.3, 0.5, 0.9, 0.9999])
        thresholds = theirs.isf(probability * above)
        np.testing.assert_allclose(ours.quantile(probability), thresholds, rtol=1e-10)
        np.testing.assert_allclose(ours.survival(thresholds), probability, rtol=1e-9, atol=1e-15)
        np.testing.assert_allclose(
            ours.density(thresholds), theirs.pdf(thresholds) / above, rtol=1e-7
        )
        assert ours.survival(0.05) == 1
        assert ours.density(0.05) == 0
