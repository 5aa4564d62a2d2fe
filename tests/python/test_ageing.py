"""Contacts that age: limits, independent models, the steady force, and what is refused."""

import functools
import itertools
import math

import mesoslip
import numpy as np
import pytest
from conftest import ROOT, at_end, drive_in_stages, long
from kinds import KINDS, configuration, pairwise
from mesoslip import Config, ConfigError
from mesoslip.output.tree import build_tree
from mesoslip.simulation.realization import Realization
from mesoslip.simulation.run_realizations import run_realizations
from mesoslip.theory.contacts import contact_theory
from mesoslip.theory.force_curve import ForceCurve
from oracles import Contacts, aged, ageing_force, fixed_step, stationary_force
from scipy import optimize, stats
from test_events import breaks

STATIC, STRETCH = 18e-6, 9e-9
# Most thresholds grow; those of the strongest fall, as the young are spread more widely.
RELAX = {"law": "relax", "time": 5e-3, "young_force_ratio": 0.5, "young_relative_width": 0.3}
WEAKEN = RELAX | {"young_force_ratio": 1.5, "young_relative_width": 0.2}
LOG = {"law": "log", "time": 1e-4, "growth": 0.05}
LAWS = {"relax": RELAX, "weaken": WEAKEN, "log": LOG}

# Forward, a hold, back beyond the start, forward again.
STAGES = [(0.02, 1e-6), (0.005, 0.0), (0.05, -1e-6), (0.03, 1e-6)]


def staged(factor: float = 1.0) -> dict[str, object]:
    drive = drive_in_stages(*((time, factor * velocity) for time, velocity in STAGES))
    return {"run__duration": None, "drive": drive, "output__interval": 1e-4}


PRESCRIBED = {"slider": {"kind": "prescribed"}, "contacts__coupling": "equal"}


def run_of(kind, **changes):
    config = configuration(kind, contacts__coupling="equal", **changes)
    return build_tree(run_realizations(config, executor=1))


without_ageing = functools.lru_cache(1)(run_of)
# Ageing that changes nothing.
SAME = {"law": "relax", "time": 1e-3, "young_force_ratio": 1.0, "young_relative_width": 0.1}


def may_age(kind):
    """Whether contacts of a short run can also age without being others."""
    config = configuration(kind)
    features = set() if config.run.engine == "me" else {"contacts.thermal"}
    is_formula = config.contacts.threshold.law != "table"
    return config.contact_features.keys() <= features and (
        is_formula and not config.contacts.newborn_width
    )


def kinds_and_laws():
    """Each kind with either law, by turns; make fuzz has both."""
    kinds = pairwise(filter(may_age, KINDS))
    short = [kind for kind in kinds if isinstance(kind, str)]
    turns = set(zip(short, itertools.cycle(["relax", "log"])))
    every = itertools.product(filter(may_age, KINDS), ["relax", "log"])
    return [pair if pair in turns else long(*pair) for pair in every]


@pytest.mark.usefixtures("no_step_errors")
@pytest.mark.parametrize(("kind", "law"), kinds_and_laws())
def test_young_like_old_is_without_ageing_to_the_bit(kind, law):
    same = SAME
    if law == "log":
        same = {"law": "log", "time": 1e-3, "growth": 0.0}
    one, other = without_ageing(kind), run_of(kind, contacts__ageing=same)
    assert one["breaks"].values.min() >= 48
    names = ("displacement", "velocity", "spring_force", "contact_force", "breaks")
    if kind == "prescribed, thermal":
        # In a uniform motion those that may age break by candidates, the others in closed form.
        np.testing.assert_allclose(one["breaks"], other["breaks"], rtol=0.1)
        for run in (one, other):
            assert np.max(np.abs(run["energy_residual"].values)) < 1e-12
        return
    if configuration(kind).run.engine == "me":
        # Populations that may age are not joined: see the test below.
        for name in names:
            scale = np.nanmax(np.abs(one[name].values))
            np.testing.assert_allclose(one[name], other[name], rtol=0, atol=4e-3 * scale)
        return
    for name in (*names, "energy_residual"):
        assert one[name].values.tobytes() == other[name].values.tobytes(), name


@pytest.mark.usefixtures("no_step_errors")
@pytest.mark.parametrize(
    "kind", ["layered, me", *map(long, ["rigid, me", "prescribed, me, ramps"])]
)
def test_joined_populations_converge_to_separate_ones(kind):
    """At steps that still have errors a thousand times as large."""
    joined, separate = (
        run_of(kind, run__resolution=1 / 16, **changes)
        for changes in ({}, {"contacts__ageing": SAME})
    )
    for name in ("displacement", "contact_force", "breaks"):
        scale = np.nanmax(np.abs(separate[name].values))
        np.testing.assert_allclose(joined[name], separate[name], rtol=0, atol=2e-7 * scale)


@pytest.mark.parametrize("engine", ["eq", "me"])
@pytest.mark.parametrize("limit", ["old", "young"])
def test_limits_of_fast_and_slow_ageing(klein, engine, limit):
    """With tau_a to 0 contacts are old from birth, with tau_a to infinity they stay young."""
    young = {"law": "relax", "young_force_ratio": 0.8, "young_relative_width": 0.1}
    changes = PRESCRIBED | staged() | {"run__engine": engine, "contacts__count": 100}
    changes["contacts__threshold__relative_width"] = 0.05
    if limit == "old":
        aged = klein(**changes, contacts__ageing=young | {"time": 1e-15})
        plain = klein(**changes)
    else:
        aged = klein(**changes, contacts__ageing=young | {"time": 1e15, "initial_age": 0.0})
        changes["contacts__threshold__relative_width"] = 0.1
        plain = klein(
            **changes, contacts__static_force=0.8 * STATIC, contacts__back_force_ratio=0.1 / 0.8
        )
    one, other = mesoslip.run(aged), mesoslip.run(plain)
    # The master equation has other steps: those of the old, and shorter ones in the hold.
    bound = 1e-9 if engine == "eq" else {"old": 1e-3, "young": 1e-2}[limit]
    assert float(one["breaks"][0]) == pytest.approx(float(other["breaks"][0]), rel=bound)
    difference = np.abs(one["contact_force"] - other["contact_force"]).values
    assert np.max(difference) < bound * STATIC


@pytest.mark.parametrize("law", [long("relax"), "weaken", "log"])
def test_prescribed_with_reversals_converges_to_events(klein, law):
    config = klein(
        **PRESCRIBED | staged(),
        contacts__count=12,
        contacts__threshold__relative_width=0.2,
        contacts__delay=2e-3,
        contacts__ageing=LAWS[law],
    )
    events = breaks(config)
    assert len(events) > 60
    force = mesoslip.run(config)["contact_force"].values[0]
    errors = []
    for step in (4e-6, 1e-6):
        trace, contacts = fixed_step(config, step)
        assert [one for _, one in contacts.events] == [one for _, one in events]
        late = [one[0] - other[0] for one, other in zip(contacts.events, events, strict=True)]
        assert np.max(np.abs(late)) < 6 * step
        errors.append(np.median(np.abs(trace[:, 5] - force)) / STATIC)
    assert errors[1] < 1e-4
    assert errors[0] / errors[1] > 2.5


@pytest.mark.parametrize("law", ["weaken", *map(long, ["relax", "log"])])
def test_rigid_with_reversals_converges_to_events(klein, law):
    config = klein(
        **staged(10.0),
        contacts__coupling="equal",
        contacts__count=12,
        contacts__threshold__relative_width=0.2,
        contacts__delay=2e-3,
        contacts__ageing=LAWS[law],
    )
    tree = mesoslip.run(config)
    events = breaks(config)
    # Among them are breaks both ways and in the hold; what follows is sensitive to rounding.
    first = 40
    late = []
    for step in (4e-6, 1e-6):
        _, contacts = fixed_step(config, step)
        assert [one for _, one in contacts.events[:first]] == [one for _, one in events[:first]]
        pairs = zip(contacts.events[:first], events[:first], strict=True)
        late.append(np.max([abs(one[0] - other[0]) for one, other in pairs]))
        assert late[-1] < 20 * step
    assert late[0] / late[1] > 2
    assert float(tree["force_error"][0]) < 1e-10 * STATIC
    assert abs(float(tree["energy_residual"][0])) < 1e-12


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("velocity", [1e-8, 1e-6, 1e-5, -1e-5])
def test_a_break_is_where_force_and_threshold_meet(klein, law, velocity):
    """One contact, born again and again; the times between breaks by root finding."""
    config = klein(
        **PRESCRIBED,
        drive__velocity=velocity,
        run__duration=20 * STRETCH / abs(velocity),
        output__interval=STRETCH / abs(velocity),
        contacts__count=1,
        contacts__delay=0.0,
        contacts__threshold__relative_width=0.1,
        contacts__ageing=LAWS[law],
    )
    realization = Realization(config, 0)
    births, lives = [], []
    while not realization.finished:
        realization.advance(1)
        renewals = realization.contacts["renewals"][0]
        if renewals > len(births):
            births.append(realization.time)
            if len(births) > 1:
                lives.append(births[-1] - births[-2])
    assert len(lives) >= 10
    oracle = Contacts(config)
    speed = abs(velocity) / STRETCH
    for number, life in enumerate(lives):
        oracle.renewal[0] = number + 1
        z = (oracle.draw(0) - 1) / 0.1

        def gap(time: float, z=z) -> float:
            mean, width = aged(config, time)
            return mean + width * z - 0.1 - speed * time

        expected = optimize.brentq(gap, 0.0, 5 / speed, xtol=1e-300, rtol=1e-15)
        assert life == pytest.approx(expected, rel=1e-11, abs=1e-14 * births[-1])


def test_contacts_that_weaken_break_at_rest(klein):
    """Stretched to between the old and the young threshold they let go in the hold, when due."""
    config = klein(
        **PRESCRIBED,
        run__duration=None,
        drive=drive_in_stages((1e-3, 1.2 * STRETCH / 1e-3), (1.0, 0)),
        output__interval=1e-2,
        contacts__count=50,
        contacts__threshold__relative_width=0.05,
        contacts__reattach=False,
        contacts__ageing=WEAKEN | {"time": 0.05, "young_relative_width": 0.05, "initial_age": 0.0},
    )
    u = Realization(config, 0).contacts["break_stretch"] / (1.5 * STRETCH)
    expected = [
        (0.05 * math.log(0.5 * one / (1.2 - one)), contact)
        for contact, one in enumerate(u)
        if one < 1.2
    ]
    events = breaks(config)
    assert [one for _, one in events] == [one for _, one in sorted(expected)]
    assert len(events) == 50
    times = [time for time, _ in sorted(expected)]
    np.testing.assert_allclose([time for time, _ in events], times, rtol=1e-11)


@pytest.mark.parametrize("turn", [0.0, 0.02])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_populations_that_weaken_break_at_rest(klein, sign, turn):
    """In either direction, after a small motion back too, which the force is against then."""
    stretches = [1.2 + turn, -turn] if turn > 0 else [1.2]
    stages = [{"duration": 1e-4, "velocity": sign * one * STRETCH / 1e-4} for one in stretches]
    config = klein(
        **PRESCRIBED,
        run__engine="me",
        run__duration=None,
        run__resolution=0.01,
        drive={"stage": [*stages, {"duration": 0.3, "velocity": 0}]},
        output__interval=1e-2,
        contacts__threshold__relative_width=0.05,
        contacts__reattach=False,
        contacts__ageing=WEAKEN | {"time": 0.05, "young_relative_width": 0.05, "initial_age": 0.0},
    )
    tree = mesoslip.run(config)
    # Contacts of the configured thresholds u have broken at the times at which
    # u (1 + exp(-t/tau_a)/2) = 1.2.
    limit = 1.2 / (1 + 0.5 * np.exp(-tree["time"].values[1:] / 0.05))
    broken = stats.norm.cdf((limit - 1) / 0.05)
    share = tree["detached_contacts"].values[0, 1:] / config.contacts.count
    np.testing.assert_allclose(share, broken, atol=0.015)
    assert abs(float(tree["energy_residual"][0])) < 1e-9


def test_contacts_that_became_old_are_as_those_that_were(klein):
    """A hold until thresholds do not change any more, then a motion as of contacts of any age."""
    stages = [
        {"duration": 0.05, "velocity": 0},
        {"duration": 0.3e-2, "velocity": STRETCH / 1e-2},
        {
            "duration": 1e-2,
            "start_velocity": STRETCH / 1e-2,
            "end_velocity": 2 * STRETCH / 1e-2,
        },
    ]
    young, old = (
        breaks(
            klein(
                **PRESCRIBED,
                run__duration=None,
                drive={"stage": stages},
                output__interval=1e-3,
                contacts__count=150,
                contacts__threshold__relative_width=0.05,
                contacts__reattach=False,
                contacts__ageing=RELAX
                | {"time": 1e-3, "young_force_ratio": 0.98, "young_relative_width": 0.2}
                | age,
            )
        )
        for age in ({"initial_age": 0.0}, {})
    )
    assert len(old) == 150
    assert young == old


def steady(law: str, width: float, velocity: float, **changes: object) -> dict[str, object]:
    """A run from the steady state of the old to that at a velocity."""
    return {
        **PRESCRIBED,
        "drive__velocity": velocity,
        "contacts__initial": "steady",
        "contacts__delay": 0.0,
        "contacts__drag_rate": 0.0,
        "contacts__threshold": {"law": law, "relative_width": width},
        "contacts__ageing": RELAX | {"time": 1e-2},
        **changes,
    }


VELOCITIES = [1e-8, 1e-7, 1e-6, 1e-5, 1e-4]


@pytest.mark.parametrize(("law", "width"), [("gaussian", 0.1), ("uniform", 0.2), ("weibull", 0.15)])
@pytest.mark.parametrize("velocity", [1e-8, long(1e-7), 1e-6, long(1e-5), 1e-4])
def test_steady_force_of_many_contacts(klein, law, width, velocity):
    """Block averages of N contacts against the integral over first passages."""
    period = STRETCH / velocity
    config = klein(
        **steady(law, width, velocity, contacts__count=1000, run__seed=7),
        run__duration=90 * period,
        output__interval=0.01 * period,
    )
    force = mesoslip.run(config)["contact_force"].values[0][1000:9000]
    blocks = force.reshape(20, -1).mean(axis=1)
    error = blocks.std(ddof=1) / math.sqrt(20)
    assert error < 2e-3 * STATIC
    assert abs(blocks.mean() - ageing_force(config, velocity)) < 4 * error


@pytest.mark.parametrize(
    ("law", "width", "bound", "velocity"),
    [
        (*law, velocity)
        if velocity == (1e-4 if law[0] == "uniform" else 1e-8)
        else long(*law, velocity)
        for law in (("gaussian", 0.1, 4e-6), ("uniform", 0.2, 3e-5), ("weibull", 0.15, 1e-5))
        for velocity in VELOCITIES
    ],
)
def test_steady_force_of_the_master_equation(klein, law, width, bound, velocity):
    """To five digits; the error falls with the square of the resolution."""
    period = STRETCH / velocity
    config = klein(
        **steady(law, width, velocity, run__engine="me", run__resolution=0.1),
        run__duration=25 * period,
        output__interval=0.003 * period,
    )
    tree = mesoslip.run(config)
    force = tree["contact_force"].values[0][-2000:]
    assert force.mean() == pytest.approx(ageing_force(config, velocity), rel=bound)
    assert abs(float(tree["energy_residual"][0])) < 1e-6


@pytest.mark.parametrize("law", ["gaussian", "uniform", "lognormal", "weibull", "exponential"])
def test_steady_force_of_info_is_that_of_the_integral(klein, law):
    config = klein(**steady(law, 0.3, 1e-6))
    for velocity in VELOCITIES:
        assert contact_theory(config).steady_force(velocity) == pytest.approx(
            ageing_force(config, velocity), rel=1e-11
        )
    assert contact_theory(config).steady_force(0.0) == pytest.approx(
        contact_theory(config).steady_force(1e-11), rel=1e-9
    )
    assert contact_theory(config).steady_force(math.inf) == pytest.approx(
        contact_theory(config).steady_force(1.0), rel=1e-6
    )
    assert contact_theory(config).mean_life(0.0) == pytest.approx(
        contact_theory(config).mean_life(1e-11), rel=1e-9
    )
    plain = klein(
        **steady(law, 0.3, 1e-6, contacts__delay=5e-4, contacts__drag_rate=2e11)
        | {"contacts__ageing": LOG | {"growth": 0.0}}
    )
    assert contact_theory(plain).steady_force(1e-6) == pytest.approx(
        stationary_force(plain, 1e-6), rel=1e-11
    )


@pytest.mark.parametrize("slider", ["prescribed", long("rigid")])
def test_many_contacts_come_to_the_master_equation(klein, slider):
    """A velocity step, a hold and a restart: the difference falls as N^(-1/2)."""
    changes = staged(5.0) | {
        "contacts__coupling": "equal",
        "contacts__threshold__relative_width": 0.2,
        "contacts__ageing": RELAX,
    }
    if slider == "prescribed":
        changes |= PRESCRIBED
    else:
        # A spring stiff enough for sliding to be smooth: slips come at random times.
        changes |= {"slider__stiffness": 5000.0}
    infinite = mesoslip.run(klein(**changes, run__engine="me"))
    counts = np.array([100, 400, 1600])
    errors = []
    for count in counts:
        many = mesoslip.run(klein(**changes, contacts__count=int(count), run__realizations=8))
        difference = many["contact_force"].values - infinite["contact_force"].values
        errors.append(np.sqrt(np.mean(difference**2)) / STATIC)
    slope = np.polyfit(np.log(counts), np.log(errors), 1)[0]
    assert -0.58 < slope < -0.42
    assert errors[-1] < 0.02


@pytest.mark.parametrize("engine", ["eq", "me"])
def test_restart_peak_grows_with_the_logarithm_of_the_hold(klein, engine):
    """Contacts that have been held for so much longer are stronger by growth ln(10) a decade."""
    peaks = []
    for hold in (0.1, 1.0, 10.0, 100.0):
        stages = [(0.2, 1e-6), (hold, 0.0), (0.02, 1e-6)]
        config = klein(
            **PRESCRIBED,
            run__engine=engine,
            run__duration=None,
            drive=drive_in_stages(*stages),
            output__interval=1e-4,
            contacts__count=4000,
            contacts__initial="steady",
            contacts__threshold__relative_width=0.2,
            contacts__ageing=LOG | {"time": 1e-3, "growth": 0.02},
        )
        tree = mesoslip.run(config)
        restarted = tree["time"].values > 0.2 + hold
        peaks.append(tree["contact_force"].values[0][restarted].max() / STATIC)
    steps = np.diff(peaks)
    assert np.all(steps > 0.01)
    assert steps[-1] == pytest.approx(steps[-2], rel=0.1)


@pytest.mark.parametrize(("growth", "width"), [(0.005, 0.1), (0.02, 0.1), (0.02, 0.2), (0.05, 0.1)])
def test_restart_peak_is_that_of_its_formula(klein, growth, width):
    """For N to infinity; between holds it grows by a little less than the thresholds do."""
    holds = [1.0, 100.0]
    stages = [{"duration": 0.2, "velocity": 1e-6}]
    for hold in holds:
        stages += [{"duration": hold, "velocity": 0.0}, {"duration": 0.1, "velocity": 1e-6}]
    config = klein(
        **PRESCRIBED,
        run__engine="me",
        run__resolution=0.2,
        run__duration=None,
        drive={"stage": stages},
        output__interval=1e-2,
        contacts__delay=0.0,
        contacts__initial="steady",
        contacts__threshold__relative_width=width,
        contacts__ageing=LOG | {"time": 1e-3, "growth": growth},
    )
    stages = mesoslip.run(config)["stages"].to_dataset()
    peaks = stages["max_force"].values[[2, 4]]
    steady_sliding = contact_theory(config).steady_force(1e-6)
    expected = np.array([contact_theory(config).restart_peak(1e-6, hold) for hold in holds])
    assert contact_theory(config).restart_peak(1e-6, 0.0) == pytest.approx(steady_sliding, rel=1e-9)
    np.testing.assert_allclose(
        peaks - steady_sliding, expected - steady_sliding, rtol=0.02, atol=2e-4 * STATIC
    )
    slope = np.diff(expected)[0] / STATIC / math.log(holds[1] / holds[0])
    assert 0.93 * growth < slope < 1.05 * growth


@pytest.mark.parametrize("name", ["velocity-step", "slide-hold-slide", "steady-force"])
def test_ready_runs_run(name):
    """With few contacts, up to their second change of the drive."""
    config = Config.load(ROOT / "runs" / f"{name}.toml")
    stages = config.drive_parts
    short = sum(one.duration for one in stages[:2]) + 0.5 * stages[2].duration
    # The last stage does not go on.
    assert config.duration == pytest.approx(config.drive.length)
    config = Config.load(
        ROOT / "runs" / f"{name}.toml",
        [
            "contacts.count=200",
            "run.realizations=1",
            f"run.duration={short}",
            f"output.interval={4 * config.output_interval}",
        ],
    )
    tree = mesoslip.run(config)
    assert abs(float(tree["energy_residual"][0])) < 1e-10
    found = mesoslip.response(tree, fit=False)
    assert found["steady"].to_dataset().sizes["velocity_stage"] >= 2


@pytest.mark.parametrize(
    ("ageing", "changes", "key", "message"),
    [
        (RELAX, {"contacts__coupling": "scaled"}, "contacts.coupling", "must be 'equal'"),
        (RELAX | {"growth": 0.1}, {}, "contacts.ageing.growth", "is for law = 'log'"),
        ({"law": "relax", "time": 1.0}, {}, "contacts.ageing.young_force_ratio", "needed"),
        ({"law": "log", "time": 1.0}, {}, "contacts.ageing.growth", "needed for law = 'log'"),
        ({"law": "log", "growth": 0.1}, {}, "contacts.ageing.time", "missing"),
        (LOG | {"law": "linear"}, {}, "contacts.ageing.law", "'relax' or 'log'"),
        (LOG | {"growth": -0.1}, {}, "contacts.ageing.growth", "greater than or equal"),
        (LOG | {"time": 0.0}, {}, "contacts.ageing.time", "greater than"),
        (
            RELAX | {"young_force_ratio": 0.09},
            {},
            "contacts.back_force_ratio",
            "of the thresholds of young contacts are above the back force",
        ),
        (
            RELAX,
            {"interaction": {"strength": 0.1, "columns": 60, "rows": 68}},
            "interaction",
            "is not for ageing contacts",
        ),
        (
            RELAX | {"initial_age": 1.0},
            {"contacts__initial": "steady"},
            "contacts.ageing.initial_age",
            "needs contacts.initial = 'relaxed'",
        ),
    ],
)
def test_bad_input_is_one_message(klein, ageing, changes, key, message):
    changes = {"contacts__coupling": "equal"} | changes
    with pytest.raises(ConfigError) as error:
        klein(**changes, contacts__ageing=ageing)
    assert [problem.key for problem in error.value.problems] == [key]
    assert message in error.value.problems[0].message.replace('"', "'")


def test_a_force_curve_is_refused_and_info_reports_of_young_and_old(klein):
    config = klein(contacts__coupling="equal", contacts__ageing=RELAX)
    with pytest.raises(ConfigError, match=r"contacts\.ageing: has no force curve"):
        ForceCurve(config)
    printed = mesoslip.derived(config)
    assert printed["young_static_force"].value == pytest.approx(0.5 * STATIC)
    assert printed["young_relative_width"].value == pytest.approx(0.3)
    assert printed["ageing_velocity"].value == pytest.approx(STRETCH / 5e-3)
    forces = [printed[name].value for name in ("F_steady", "F_steady_drive", "F_steady_young")]
    assert forces == sorted(forces, reverse=True)
    printed = mesoslip.derived(klein(contacts__coupling="equal", contacts__ageing=LOG))
    assert printed["growth_per_decade"].value == pytest.approx(0.05 * math.log(10))
    # Without an end of growing there is no limit of slow sliding.
    assert "F_steady" not in printed


def test_contacts_of_the_start_could_attach_when_they_were_young(klein):
    """They were born as well: their young thresholds are above the back force."""
    ageing = {"law": "relax", "time": 0.05, "young_force_ratio": 0.4, "young_relative_width": 0.5}
    config = klein(
        contacts__count=2000,
        contacts__coupling="equal",
        contacts__back_force_ratio=0.3,
        contacts__threshold__relative_width=0.2,
        contacts__ageing=ageing,
    )
    contacts = config.contacts
    limit = Realization(config, 0).contacts["break_stretch"] / contacts.break_stretch
    young = contacts.ageing.threshold(limit, 0.2, 0.0)
    assert young.min() > 0.3
    assert young.min() < 0.31


def test_visits_of_contacts_are_work(klein):
    """Where an advance visits many contacts, here those with falling thresholds, a segment of a run
    has fewer advances: 2500 if visits were no work."""
    config = klein(
        run__duration=0.1,
        contacts__count=5000,
        contacts__coupling="equal",
        contacts__threshold__relative_width=0.1,
        contacts__ageing=RELAX | {"time": 1.0, "young_force_ratio": 0.9},
        drive={"velocity": 1e-5},
        output={"interval": 0.01},
    )
    with Realization(config, 0) as realization:
        realization.advance_to(0.02)
        before = realization.advances
        realization.advance(work=5000.0)
        assert 1 <= realization.advances - before < 1000


def test_few_contacts_are_visited_before_any_breaks(klein):
    """In the stick phase from a relaxed start, with narrow thresholds, all contacts are about as
    close to breaking: a window looks at a few of them."""
    config = klein(
        run__duration=1.0,
        contacts__count=20_000,
        contacts__coupling="equal",
        contacts__ageing={"law": "log", "time": 1e-3, "growth": 0.05},
        output={"interval": 0.01},
    )
    with Realization(config, 0) as realization:
        realization.advance_to(0.7)
        assert realization.breaks == 0
        realization.advance(work=5000.0)
        assert realization.finished


@pytest.mark.parametrize(
    ("changes", "most"), [({}, 2.2), ({"contacts__thermal": {"rate": 1e4, "force_ratio": 0.02}}, 3)]
)
def test_a_rigid_slider_hardly_stops_where_nothing_happens(klein, changes, most):
    """Where it meets the threshold of one of few contacts follows from its equation of motion, so
    there are two advances for a break and the birth after it. By its acceleration, and bounds on
    what changes that, there are 2.6. Activated contacts have some 0.8 ends of windows of their
    candidates more."""
    config = klein(
        run__duration=0.2,
        drive={"velocity": 4.3e-3},
        slider={"mass": 0.02, "stiffness": 1e3, "damping_ratio": 0.1},
        contacts__count=80,
        contacts__static_force=0.16,
        contacts__stiffness=3e4,
        contacts__delay=4e-5,
        contacts__coupling="equal",
        contacts__threshold__relative_width=0.11,
        contacts__initial="steady",
        contacts__ageing={"law": "log", "time": 1e-3, "growth": 5e-3},
        output={"interval": 0.01},
        **changes,
    )
    with Realization(config, 0) as realization:
        at_end(realization)
        assert realization.breaks > 5000
        assert realization.advances < most * realization.breaks


@pytest.mark.parametrize("count", [1, 5])
def test_few_contacts_break_very_often(count):
    """The energy closes over hundreds of lives of each contact, in one steady motion."""
    run = Realization(
        configuration(
            "prescribed, ageing",
            contacts__count=count,
            drive={"velocity": 1e-5},
            run__duration=1.0,
            output__interval=0.5,
        ),
        0,
    )
    at_end(run)
    assert run.breaks > 400 * count
    assert abs(run.energy_residual) < 1e-12
