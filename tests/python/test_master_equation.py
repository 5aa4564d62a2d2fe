"""The master equation under a moving slider, against its force curve and against N contacts."""

import numpy as np
import pytest
from conftest import at_end, drive_in_stages, long
from mesoslip.errors import ConfigError
from mesoslip.simulation import realization
from mesoslip.simulation.audit import failed_checks, step_errors
from mesoslip.simulation.realization import Realization
from mesoslip.theory.force_curve import ForceCurve
from oracles import frozen_law, stationary_force
from states import entries, reals, saved

FORCE = 18e-6
REVERSALS = drive_in_stages(
    (0.12, 1e-7), (0.05, -1e-7), (0.02, 0.0), (0.1, 2e-7), (0.2, -1.5e-7), (0.1, 1e-7)
)
PRESCRIBED = {"slider": {"kind": "prescribed"}}
LAYERS = {"mass": 1.47e-3, "stiffness": 97.0, "kind": "layered", "layers": 4}


def finish(config, advances=None, *, estimates_errors=False):
    return at_end(Realization(config, 0, estimates_errors=estimates_errors), advances)


def dispersion(width, law="gaussian"):
    return {"contacts__threshold": {"law": law, "relative_width": width}}


def off_the_curve(config):
    """Errors of the force in forward sliding without delay, over F_s."""
    keys = {"run.engine": "me", "contacts.delay": 0.0, "contacts.drag_rate": 0.0}
    config = config.replace(keys | {"slider": {"kind": "prescribed"}})
    trace, curve = finish(config).trace, ForceCurve(config)
    inside = trace[:, 2] < curve.samples[-1]
    return (trace[inside, 5] - curve.force(trace[inside, 2])) / FORCE


def back_and_forth(klein, **changes):
    return klein(run__duration=None, drive=REVERSALS, **PRESCRIBED, **dispersion(0.1), **changes)


@pytest.mark.parametrize(
    ("coupling", "initial"),
    [
        *(("scaled", "relaxed"), ("equal", "uniform"), ("scaled", "steady")),
        *(long("equal", "relaxed"), long("scaled", "uniform"), long("equal", "steady")),
    ],
)
def test_forward_sliding_is_the_force_curve(klein, coupling, initial):
    """Two ways to F(X), and the error falls with the square of the step."""
    changes = {"contacts__coupling": coupling, "contacts__initial": initial}
    changes |= {"run__duration": 0.5, "output__interval": 5e-4} | dispersion(0.1)
    errors = [
        np.sqrt(np.mean(off_the_curve(klein(**changes, run__resolution=one)) ** 2))
        for one in (0.25, 0.125)
    ]
    assert errors[1] < 2e-4
    assert errors[1] < 0.45 * errors[0]


@pytest.mark.parametrize(
    ("coupling", "width", "back_force_ratio"),
    [
        *(("equal", 0.05, 0.9), ("scaled", 0.3, 0.9), ("scaled", 0.05, 0.0), ("equal", 0.3, 0.0)),
        *(long("scaled", 0.05, 0.9), long("equal", 0.3, 0.9)),
        *(long("equal", 0.05, 0.0), long("scaled", 0.3, 0.0)),
        *(
            long(coupling, width, ratio)
            for coupling in ("scaled", "equal")
            for width in (0.05, 0.3)
            for ratio in (0.1, 0.5)
        ),
    ],
)
def test_steps_are_of_second_order(klein, coupling, width, back_force_ratio):
    """The greatest error, however strong the back force is."""
    changes = {"contacts__coupling": coupling, "contacts__back_force_ratio": back_force_ratio}
    changes |= {"run__duration": 0.3, "output__interval": 1e-4} | dispersion(width)
    errors = [
        np.max(np.abs(off_the_curve(klein(**changes, run__resolution=one))))
        for one in (0.25, 0.0625)
    ]
    assert errors[1] < 2.5e-4
    assert errors[1] < errors[0] / 10


@pytest.mark.parametrize("delay", [0.0, 5e-3])
@pytest.mark.parametrize("back_force_ratio", [0.1, 0.9])
def test_steps_are_of_second_order_through_reversals(klein, delay, back_force_ratio):
    """Back over ways that were made before, where the force has kinks, and in a hold."""
    traces = [
        finish(
            back_and_forth(
                klein,
                run__engine="me",
                run__resolution=resolution,
                contacts__delay=delay,
                contacts__back_force_ratio=back_force_ratio,
                contacts__coupling="equal",
            )
        ).trace[:, 5]
        for resolution in (0.0625, 0.5, 0.125)
    ]
    coarse, fine = (np.max(np.abs(trace - traces[0])) / FORCE for trace in traces[1:])
    assert fine < 1.5e-3
    assert fine < coarse / 8


def test_the_first_slip_with_a_strong_back_force(klein):
    """N = 10^6 contacts slip at 1.8571 s; steps of first order put it at 1.8716 s."""
    config = klein(
        run__engine="me",
        run__duration=2.0,
        contacts__back_force_ratio=0.9,
        **dispersion(0.05),
    )
    assert finish(config).slips[0, 1] == pytest.approx(1.8571, abs=1.5e-3)


@pytest.mark.parametrize("resolution", [0.5, 0.25])
def test_the_first_slip_of_a_soft_slider(klein, resolution):
    """It creeps in small oscillations before; fine steps put the slip at 1.45966 s."""
    config = klein(
        run__engine="me",
        run__duration=1.65,
        run__resolution=resolution,
        contacts__coupling="equal",
        contacts__back_force_ratio=0.4,
        contacts__delay=1e-3,
        **dispersion(0.2, "uniform"),
    )
    assert finish(config).slips[0, 1] == pytest.approx(1.45966, abs=3e-4)


@pytest.mark.parametrize("layers", [1, 4])
def test_rounding_errors_decide_nothing(klein, layers):
    """Lengths that are longer by 1e-12 change the force by little more than that."""
    spring = {"mass": 1.47e-3, "stiffness": 97.0}
    slider = {"slider": spring | {"kind": "layered", "layers": layers}} if layers > 1 else {}
    forces = []
    for scale in (1.0, 1 + 1e-12):
        config = klein(
            run__engine="me",
            run__duration=0.04,
            drive__velocity=1e-5 * scale,
            contacts__coupling="equal",
            contacts__stiffness=2000 / scale,
            **dispersion(0.1),
            **slider,
        )
        forces.append(finish(config).trace[:, 5])
    assert np.max(np.abs(forces[1] - forces[0])) < 1e-9 * FORCE


def test_a_hold_is_no_staircase(klein):
    """Contacts attach a few at a time while the slider rests."""
    stages = [{"duration": 0.3, "velocity": 1e-7}, {"duration": 0.03, "velocity": 0.0}]
    config = klein(
        run__engine="me",
        run__duration=None,
        drive={"stage": stages},
        contacts__delay=20e-3,
        output__interval=1e-4,
        **PRESCRIBED,
        **dispersion(0.1),
    )
    trace = finish(config).trace
    resting = trace[:, 0] > 0.3
    assert np.max(np.abs(np.diff(trace[resting, 6]))) < 0.01 * 4080
    assert trace[-1, 6] < 1e-6


@pytest.mark.parametrize(
    ("law", "velocity"),
    [
        *(("gaussian", 1e-6), ("weibull", 1e-6), ("gaussian", 2e-5), ("exponential", 2e-5)),
        *(long(law, 1e-6) for law in ("uniform", "lognormal", "exponential")),
        *(long(law, 2e-5) for law in ("uniform", "lognormal", "weibull")),
    ],
)
def test_the_delay_weakens_the_force(klein, law, velocity):
    """F(v) of model section 4, with delay and drag."""
    config = klein(
        run__engine="me",
        run__duration=2e-6 / velocity,
        run__resolution=0.1,
        drive__velocity=velocity,
        contacts__initial="steady",
        output__interval=2e-9 / velocity,
        **PRESCRIBED,
        **dispersion(0.3, law),
    )
    trace = finish(config).trace
    late = trace[len(trace) // 2 :]
    assert np.mean(late[:, 5]) == pytest.approx(stationary_force(config, velocity), rel=2e-4)


@pytest.mark.parametrize(
    ("coupling", "counts"), [("scaled", (100, 3000, 100_000)), ("equal", (1000, 30_000))]
)
def test_many_contacts_tend_to_it(klein, coupling, counts):
    """Reversals, delay and drag: what N contacts differ by falls as N^(-1/2)."""
    exact = finish(
        back_and_forth(klein, run__engine="me", run__resolution=0.0625, contacts__coupling=coupling)
    ).trace[:, 5]
    scaled = []
    for count in counts:
        config = back_and_forth(klein, contacts__count=count, contacts__coupling=coupling)
        error = finish(config).trace[:, 5] - exact
        scaled.append(np.sqrt(np.mean(error**2) * count) / FORCE)
    # One realization each: the size of its fluctuation is itself a matter of chance.
    assert max(scaled) < 0.5
    assert min(scaled) > 0.05


def test_contacts_that_survived_do_not_break_below_it(klein):
    """After a reversal the memoryless rate P(x) is wrong, and N contacts decide so.

    Reloading within what has been borne breaks nothing; the memoryless form breaks contacts at the
    rate P = P_c/J_c again.
    """
    width = 0.1
    stages = [
        {"duration": 0.088, "velocity": 1e-7},
        {"duration": 0.02, "velocity": -1e-7},
        {"duration": 0.02, "velocity": 1e-7},
    ]
    changes = {
        "run__duration": None,
        "drive": {"stage": stages},
        "contacts__coupling": "equal",
        "contacts__reattach": False,
        "contacts__drag_rate": 0.0,
        **PRESCRIBED,
        **dispersion(width),
    }
    remembering = finish(klein(run__engine="me", run__resolution=0.1, **changes)).trace
    contacts = finish(klein(contacts__count=1_000_000, **changes)).trace
    law = frozen_law("gaussian", width)
    top = 0.088e-7 / 9e-9
    memory = top * law.sf(top) / law.sf(0.1)
    memoryless = memory * law.sf(top) / law.sf(top - 0.02e-7 / 9e-9)
    # Forward they agree.
    first = int(0.088 / 1e-3)
    assert remembering[first, 5] / FORCE == pytest.approx(memory, abs=2e-4)
    # Back at the same place: the same force with memory, much less without.
    assert remembering[-1, 5] / FORCE == pytest.approx(memory, abs=2e-4)
    assert contacts[-1, 5] / FORCE == pytest.approx(memory, abs=3e-3)
    assert memoryless < memory - 0.1


def test_the_first_slip_of_klein(klein):
    """N contacts tend to it in the slip as well: the catalogue's first line, error ~ N^(-1/2)."""
    config = klein(run__engine="me", run__duration=2.5)
    exact = finish(config).slips[0]
    assert exact[3] == pytest.approx(17.727e-6, rel=1e-4)
    errors = []
    for count in (1000, 10_000, 100_000):
        slip = finish(klein(run__duration=2.5, contacts__count=count)).slips[0]
        errors.append(abs(slip[3] - exact[3]) / FORCE * np.sqrt(count))
        assert abs(slip[5] - exact[5]) / exact[5] < 3 / np.sqrt(count)
    assert max(errors) < 3


def test_steps_of_narrow_thresholds_are_long_and_find_the_second_slip(klein):
    """By contacts that attached in the first one, at a place for each step."""
    runs = [
        finish(klein(run__engine="me", run__duration=4.5, run__resolution=one))
        for one in (0.5, 0.25, 0.125)
    ]
    times = np.array([one.slips[1][1] for one in runs])
    assert abs(times[1] - times[2]) < 2e-6
    assert abs(times[0] - times[2]) < 1e-4
    # Steps by the resolution alone: 80 000, and a second slip that is off by 1e-4 s.
    assert runs[1].advances < 40_000


@pytest.mark.parametrize("engine_slider", [{}, PRESCRIBED])
def test_contacts_are_conserved(klein, engine_slider):
    """Pinned and detached ones together are N, to rounding, after slips and reversals."""
    changes = {"run__duration": 4.0, **engine_slider}
    realization = Realization(klein(run__engine="me", **changes), 0)
    while realization.time < 3.9 and not realization.finished:
        realization.advance(20_000)
        if realization.ending:
            break
        state = saved(realization)
        count = int(state.words[entries(state.words)["count"][0]][0])
        moments = reals(state, "left")[:count]
        pinned = moments[:, 0].sum()
        assert moments.min() >= 0
        assert pinned + realization.detached == pytest.approx(4080, abs=4080 * 1e-12)
    assert realization.breaks > 4080


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"contacts__coupling": "equal"},
        {"contacts__initial": "steady"},
        {"contacts__initial": "uniform"},
        {"contacts__delay": 0.0},
        {"contacts__threshold": {"law": "exponential", "relative_width": 0.5}},
    ],
)
def test_energy_balance_closes_with_the_step(klein, changes):
    """To rounding, with the work by which steps differ from the contacts, which is little."""
    realization = finish(klein(run__engine="me", run__duration=2.2, **changes))
    assert abs(realization.energy_residual) < 1e-10
    assert 0 < abs(realization.step_work) < 1e-6


def test_detached_contacts_of_next_to_no_number_do_no_harm(klein):
    """All contacts used to attach in one step behind a packet of 5e-324 contacts: -36 %."""
    config = klein(
        run__engine="me",
        run__resolution=0.5,
        run__duration=0.3,
        slider__damping_ratio=0.007,
        slider__stiffness=161.04,
        drive__velocity=3.5646e-10,
        contacts__back_force_ratio=0.9,
        contacts__delay=1e-2,
        contacts__coupling="equal",
        contacts__initial="steady",
        contacts__static_force=4.0429e-7,
        contacts__stiffness=7774.5,
        **dispersion(0.01, "lognormal"),
    )
    realization = finish(config)
    assert abs(realization.energy_residual) < 1e-9
    assert abs(realization.step_work) < 5e-4


@pytest.mark.parametrize("slider", [PRESCRIBED, {}, {"slider": LAYERS}])
def test_the_work_of_steps_is_of_second_order(klein, slider):
    """And the rest of the balance rounding errors, whatever contacts do."""
    works = []
    for resolution in (0.5, 0.125):
        config = klein(
            run__engine="me",
            run__resolution=resolution,
            run__duration=None,
            drive={"stage": [{"duration": time, "velocity": 1e-5} for time in (0.03, 0.005)]},
            contacts__coupling="equal",
            contacts__back_force_ratio=0.7,
            contacts__delay=1e-3,
            **slider,
            **dispersion(0.1),
        )
        realization = finish(config)
        assert abs(realization.energy_residual) < 1e-8
        works.append(abs(realization.step_work))
    assert works[1] < works[0] / 8


def test_a_hold_bears_what_the_contacts_do(klein):
    """Contacts that attached just before it and are due are no reason for another force."""
    trace = finish(
        back_and_forth(
            klein,
            run__engine="me",
            contacts__delay=5e-3,
            contacts__back_force_ratio=0.9,
            contacts__coupling="equal",
            output__interval=5e-5,
        )
    ).trace
    around = (trace[:, 0] > 0.168) & (trace[:, 0] < 0.172)
    assert np.max(np.diff(trace[around, 5])) < 0


@pytest.mark.parametrize(
    "changes",
    [
        {"contacts__coupling": "equal", "contacts__delay": 1e-3},
        {"contacts__back_force_ratio": 0.7},
        PRESCRIBED,
    ],
)
def test_estimated_errors_are_those_of_a_run(klein, changes):
    """Within a factor of 5, by the same run with steps a fifth as long."""
    runs = []
    for resolution in (0.25, 0.05):
        config = klein(
            run__engine="me",
            run__resolution=resolution,
            run__duration=0.03,
            drive__velocity=1e-5,
            output__interval=1e-5,
            **dispersion(0.2),
            **changes,
        )
        runs.append(finish(config, estimates_errors=resolution == 0.25))
    run, fine = runs
    starts, fine_starts = run.slips[:, 1], fine.slips[:, 1]
    assert len(starts) == len(fine_starts)
    before = run.trace[:, 0] < np.min([*starts, *fine_starts, 1.0])
    error = np.max(np.abs(run.trace[before, 5] - fine.trace[before, 5]))
    assert error / 5 < run.force_error < 5 * error
    if len(starts):
        late = np.max(np.abs(starts - fine_starts))
        assert late / 5 < run.slip_time_error < 5 * late
    else:
        assert run.slip_time_error == 0


@pytest.mark.parametrize(
    ("contacts", "slider", "velocity", "duration", "spread"),
    [
        # Contacts that broke before break together when the slider comes back, in its third slip
        # and its second one.
        (("weibull", 0.142, "scaled", "steady", 4.9e-4, 0.244), (188, 0.48), 2.47e-6, 0.08, 4e-6),
        (("weibull", 0.138, "equal", "steady", 3.1e-4, 0.348), (42.8, 0.16), 1.93e-6, 0.27, 6e-5),
        # Steps longer than a series of the slider reached, above resolution 0.39.
        (
            ("gaussian", 0.0763, "scaled", "uniform", 3.63e-4, 0.41),
            (42.9, 0.59),
            1.06e-6,
            0.58,
            2e-5,
        ),
        # A kink of the initial density, at the lowest threshold.
        (("uniform", 0.25, "equal", "uniform", 3e-3, 0.486), (444, 0.066), 3.8e-6, 0.017, 8e-6),
    ],
)
def test_errors_of_slip_times_do_not_depend_on_accidents(
    klein, contacts, slider, velocity, duration, spread
):
    """The error of the last slip over the squared resolution, as steps become a little longer."""
    law, width, coupling, initial, delay, back_force = contacts
    last = {}
    for resolution in (0.125, 0.25, 0.3, 0.35, 0.42, 0.46, 0.5):
        config = klein(
            run__engine="me",
            run__resolution=resolution,
            run__duration=duration,
            drive__velocity=velocity,
            slider__stiffness=slider[0],
            slider__damping_ratio=slider[1],
            contacts__threshold={"law": law, "relative_width": width},
            contacts__coupling=coupling,
            contacts__initial=initial,
            contacts__delay=delay,
            contacts__back_force_ratio=back_force,
            output__interval=duration,
        )
        last[resolution] = finish(config, estimates_errors=False).slips[-1, 1]
    fine = last.pop(0.125)
    errors = [(time - fine) / (one**2 - 0.125**2) for one, time in last.items()]
    assert np.ptp(errors) < spread


def test_segments_do_not_matter(klein):
    """The same numbers to the bit, also when the arrays grow on the way."""
    config = klein(run__engine="me", run__duration=2.2, output__slip_interval=1e-4)
    whole = finish(config)
    pieces = finish(config, 777)
    assert np.array_equal(whole.trace, pieces.trace)
    assert np.array_equal(whole.slip_trace, pieces.slip_trace)
    assert np.array_equal(whole.energy, pieces.energy)


def test_backward_mirrors_forward(klein):
    forward = finish(klein(run__engine="me", run__duration=2.2)).trace
    backward = finish(klein(run__engine="me", run__duration=2.2, drive__velocity=-1e-7)).trace
    np.testing.assert_allclose(backward[:, 1:6], -forward[:, 1:6], rtol=0, atol=1e-18)
    np.testing.assert_array_equal(backward[:, 6], forward[:, 6])


def test_without_attaching_the_force_ends(klein):
    realization = finish(klein(run__engine="me", contacts__reattach=False, run__duration=3.0))
    assert realization.breaks == pytest.approx(4080, rel=1e-12)
    assert realization.trace[-1, 6] == pytest.approx(4080, rel=1e-12)


def test_samples_do_not_change_a_run(klein):
    config = {"run__engine": "me", "run__duration": 2.2}
    coarse = finish(klein(output__interval=1e-2, **config))
    fine = finish(klein(output__interval=1e-3, **config))
    np.testing.assert_array_equal(coarse.trace[:, 1:], fine.trace[::10, 1:])
    assert np.array_equal(coarse.energy, fine.energy)


def test_detached_contacts_attach_while_the_slider_rests(klein):
    """A hold after fast sliding, when most contacts are detached, and a way back after it."""
    stages = [(0.07, 2.4e-6), (0.05, 0.0), (0.1, -4e-7)]
    changes = {
        "run__duration": None,
        "drive": drive_in_stages(*stages),
        "contacts__delay": 5e-3,
        "contacts__coupling": "equal",
        "contacts__back_force_ratio": 0.3,
        "contacts__initial": "steady",
        **PRESCRIBED,
        **dispersion(0.17, "lognormal"),
    }
    exact = finish(klein(run__engine="me", **changes)).trace
    contacts = finish(klein(contacts__count=100_000, **changes)).trace
    assert np.sqrt(np.mean((exact[:, 5] - contacts[:, 5]) ** 2)) < 5e-3 * FORCE
    np.testing.assert_allclose(exact[:, 6] / 4080, contacts[:, 6] / 1e5, atol=0.05)
    resting = (exact[:, 0] > 0.08) & (exact[:, 0] < 0.11)
    assert np.all(exact[resting, 6] < 1e-6)


@pytest.mark.parametrize(
    ("law", "width"), [("lognormal", 3.0), ("weibull", 0.8), ("gaussian", 0.1)]
)
@pytest.mark.parametrize("initial", ["steady", "uniform"])
def test_initial_states_of_wide_laws(klein, law, width, initial):
    """The force at the start is that of the force curve, however far the tail of a law reaches."""
    config = klein(
        run__engine="me",
        run__duration=0.01,
        contacts__coupling="equal",
        contacts__back_force_ratio=0.0,
        contacts__initial=initial,
        **PRESCRIBED,
        **dispersion(width, law),
    )
    expected = stationary_force(config) if initial == "steady" else 0.5 * FORCE
    assert finish(config).trace[0, 5] == pytest.approx(expected, rel=0.01)


@pytest.mark.parametrize(
    ("law", "width", "delay", "coupling"),
    [
        ("gaussian", 0.3, 1e-5, "scaled"),
        ("weibull", 0.3, 1e-5, "scaled"),
        ("exponential", 0.5, 5e-4, "scaled"),
        ("lognormal", 0.2, 5e-4, "equal"),
        ("uniform", 0.5, 0.0, "equal"),
    ],
)
@pytest.mark.parametrize("initial", ["steady", "uniform", "relaxed"])
def test_turning_points_do_not_stall(klein, law, width, delay, coupling, initial):
    """Newborns of wide laws break at once, on whichever way the slider goes on."""
    stages = [(0.1, 8e-7), (0.1, 3e-7), (0.05, 0.0), (0.2, -6e-7)]
    realization = finish(
        klein(
            run__engine="me",
            run__duration=None,
            drive=drive_in_stages(*stages),
            contacts__delay=delay,
            contacts__coupling=coupling,
            contacts__back_force_ratio=0.3,
            contacts__initial=initial,
            **dispersion(width, law),
        )
    )
    assert realization.finished
    assert abs(realization.energy_residual) < 0.01


@pytest.mark.parametrize("resolution", [0.25, 0.5, 1.0])
@pytest.mark.parametrize(
    ("law", "width", "coupling", "initial", "velocity"),
    [
        ("uniform", 0.577, "equal", "uniform", -6.89e-4),
        ("uniform", 0.577, "equal", "uniform", 6.89e-4),
        ("uniform", 0.05, "equal", "steady", 6.89e-4),
        ("weibull", 0.3, "equal", "steady", 6.89e-4),
    ],
)
def test_a_start_at_rest_does_not_stall(klein, law, width, coupling, initial, velocity, resolution):
    """Contacts at their thresholds break at once, under a force that is 0 up to rounding."""
    config = klein(
        run__engine="me",
        run__resolution=resolution,
        run__duration=5e-6,
        drive__velocity=velocity,
        slider__mass=0.00605,
        slider__stiffness=22371839080.45977,
        contacts__count=147,
        contacts__static_force=13.4,
        contacts__stiffness=38505747126.43678,
        contacts__delay=2e-7,
        contacts__coupling=coupling,
        contacts__initial=initial,
        output__interval=1e-7,
        **dispersion(width, law),
    )
    realization = Realization(config, 0, estimates_errors=False)
    realization.advance(4000)
    assert realization.finished
    assert abs(realization.energy_residual) < 1e-6


def test_the_mass_of_detached_contacts_is_that_of_those_which_broke(klein):
    """Strong drag and a law whose mean threshold is not 1, as small ones cannot attach."""
    changes = {
        "run__duration": 0.15,
        "drive__velocity": 2e-5,
        "contacts__back_force_ratio": 0.3,
        "contacts__initial": "steady",
        "output__interval": 1e-4,
        **PRESCRIBED,
        **dispersion(0.8, "lognormal"),
    }
    config = klein(run__engine="me", contacts__drag_rate=2e14, **changes)
    force = finish(config).trace[750:, 5].mean()
    assert force == pytest.approx(stationary_force(config, 2e-5), rel=1e-3)
    assert force > 1.1 * stationary_force(klein(contacts__drag_rate=0.0, **changes), 2e-5)


def slips_of_strong_back_force(klein, resolution, **changes):
    """A run in which detached contacts attach with a large force, which amplifies every error."""
    return finish(
        klein(
            run__engine="me",
            run__resolution=resolution,
            output__interval=1e-4,
            contacts__back_force_ratio=0.7,
            contacts__coupling="equal",
            **changes,
        )
    )


def test_errors_before_and_after_a_slip_are_stated_and_of_second_order(klein):
    """With breaks even in time, not with the motion, a slip was 0.2 ms late (stated: 0.01)."""
    coarse, run, fine = (
        slips_of_strong_back_force(
            klein,
            resolution,
            run__duration=0.12,
            drive__velocity=3.88e-6,
            slider__stiffness=49.4,
            slider__damping_ratio=0.53,
            contacts__delay=3.6e-4,
            **dispersion(0.148, "uniform"),
        )
        for resolution in (0.5, 0.25, 0.0625)
    )
    stated = step_errors(run.trace, run.slips, coarse.trace, coarse.slips)
    error = abs(run.slips[0, 1] - fine.slips[0, 1])
    assert error < 3e-5
    assert 1 / 3 < stated.slip_time / error < 3
    time, forces = fine.trace[:, 0], [one.trace[:, 5] for one in (coarse, run, fine)]
    before, after = time < coarse.slips[0, 1] - 1e-3, time > coarse.slips[0, 1] + 1e-3
    assert 1 / 3 < stated.force / np.max(np.abs(forces[1] - forces[2])[before]) < 3
    rms = [np.sqrt(np.mean((one - forces[2])[after] ** 2)) for one in forces[:2]]
    assert 1.5 < np.log2(rms[0] / rms[1]) < 3


def test_steps_longer_than_the_delay_expect_all_that_attaches(klein):
    """With births in proportion to the length of a shortened step, a slip was 17 us early."""
    starts = [
        slips_of_strong_back_force(
            klein,
            resolution,
            run__duration=0.09,
            drive__velocity=1.1e-6,
            slider__stiffness=243.0,
            slider__damping_ratio=0.65,
            contacts__delay=7e-5,
            **dispersion(0.058, "uniform"),
        ).slips[0, 1]
        for resolution in (0.25, 0.0625)
    ]
    assert starts[0] == pytest.approx(starts[1], abs=1e-5)


def test_contacts_that_join_others_break_at_all_their_thresholds(klein):
    """While a soft slider creeps: with joint populations that had broken up to the thresholds of
    their first contacts, the displacement was of first order (ratio 2.1)."""
    displacements = [
        slips_of_strong_back_force(
            klein,
            resolution,
            run__duration=0.168,
            drive__velocity=1.94e-6,
            slider__stiffness=43.0,
            slider__damping_ratio=0.5,
            contacts__delay=0.0,
            **dispersion(0.13),
        ).trace[-200:, 2]
        for resolution in (0.25, 0.125, 0.0625)
    ]
    changes = [np.sqrt(np.mean(one**2)) for one in np.diff(displacements, axis=0)]
    assert changes[0] > 3 * changes[1]


def test_a_tolerance_of_the_force_chooses_the_resolution(klein, monkeypatch):
    """The run is that with the resolution, in one segment or several; a miss is reported."""
    changes = {
        "run__engine": "me",
        "run__duration": 0.03,
        "drive__velocity": 1e-5,
        "output__interval": 1e-4,
        **dispersion(0.2),
    }
    config = klein(run__force_tolerance=5e-5, **changes)
    run = finish(config, 400, estimates_errors=True)
    assert run.resolution < 0.25
    assert run.force_error < 5e-5 * FORCE
    assert not failed_checks(config, [run])
    same = finish(klein(run__resolution=run.resolution, **changes), estimates_errors=True)
    assert np.array_equal(run.trace, same.trace)
    assert (run.force_error, run.slip_time_error) == (same.force_error, same.slip_time_error)

    monkeypatch.setattr(realization, "MIN_RATIO", 0.9)
    config = klein(run__force_tolerance=1e-9, **changes)
    run = finish(config, estimates_errors=True)
    assert run.resolution == pytest.approx(0.9**2 * 0.25)
    assert "at most 1e-09; a smaller run.resolution helps" in "".join(failed_checks(config, [run]))


def test_contacts_one_by_one_refuse_a_tolerance(klein):
    with pytest.raises(ConfigError, match=r"force_tolerance.*needs engine \"me\""):
        klein(run__force_tolerance=1e-4)
