"""Sweeps whose runs go on from the end of the last one: `sweep.continue`."""

import dataclasses

import mesoslip
import numpy as np
import pytest
from conftest import at_end, klein_tables
from kinds import KINDS, configuration
from mesoslip import Config, ConfigError
from mesoslip.campaign.point import compute
from mesoslip.campaign.sweep import groups, run_sweep, task_of
from mesoslip.campaign.sweep_plan import Plan
from mesoslip.execution.stop import Stop
from mesoslip.execution.store import Store
from mesoslip.simulation.realization import Realization
from mesoslip.simulation.recorded_tables import COLUMNS

# Each way in which a slider moves and contacts are kept, once.
CHAINED = (
    "rigid",
    "rigid, me",
    "rigid, ageing",
    "rigid, thermal",
    "layered",
    "layered, me",
    "layered, adams, ramps",
    "prescribed, ramps",
    "quasistatic",
    "force",
)
MOTION = [
    COLUMNS["trace"].index(name)
    for name in ("velocity", "spring_force", "contact_force", "detached_contacts")
]
SHORT = klein_tables(
    contacts__count=40, run__duration=0.4, drive__velocity=1e-6, contacts__threshold__law="uniform"
)
VELOCITIES = [1e-6, 2e-6, 4e-6]


def finished(config, after=None):
    """A run to its end, and its end."""
    with Realization(config, 0, after=after, estimates_errors=False) as one:
        at_end(one)
        return one, one.end


def sweep_tables(**sweep):
    grid = {"drive.velocity": VELOCITIES}
    given = {"measures": ["mean_force", "breaks"], "continue": "drive.velocity", "grid": grid}
    return {**SHORT, "sweep": given | sweep}


@pytest.mark.parametrize("kind", CHAINED)
def test_a_chain_is_one_run_with_stages(kind):
    """To the bit: each run goes on from the end of the last, and counts from its own start."""
    assert kind in KINDS
    config = configuration(kind)
    whole, _ = finished(config)
    end, time, runs = None, 0.0, []
    for stage in config.to_dict()["drive"]["stage"]:
        one, end = finished(config.replace({"drive": {"stage": [stage]}}), end)
        first = round(time / config.output_interval)
        there = whole.trace[first : first + len(one.trace)]
        # At the change of the drive the whole run has a sample of before it.
        np.testing.assert_array_equal(one.trace[1:, MOTION], there[1:, MOTION])
        (row,) = one.records("stages")
        assert row["stage_start_time"] == 0
        assert row["start_displacement"] == 0
        assert one.trace[0, 0] == 0
        assert one.time == pytest.approx(stage["duration"], rel=1e-12)
        time += one.time
        runs.append(one)
    assert len(runs) > 2
    assert sum(one.breaks for one in runs) == pytest.approx(whole.breaks, rel=1e-13)
    assert sum(one.advances for one in runs) == whole.advances
    np.testing.assert_allclose(
        sum(one.energy_terms["break_loss"] for one in runs),
        whole.energy_terms["break_loss"],
        rtol=1e-12,
    )
    for one in runs:
        assert abs(one.energy_residual) <= max(
            config.contact_kind.residual_bound, config.slider.residual_bound(config)
        )
        np.testing.assert_array_equal(one.slips[:, 0], np.arange(len(one.slips)))


def test_slips_end_runs_of_a_chain():
    """As many in each run, though the kernel goes on counting."""
    changes = {"run__stop": {"slips": 2}, "drive": {"velocity": 1e-5}, "run__duration": 1.0}
    config = configuration("rigid", **changes)
    first, end = finished(config)
    second, _ = finished(config.replace({"drive.velocity": 1.3e-5}), end)
    assert len(first.slips) == len(second.slips) == 2
    assert 0 < second.slips[0, 1] < second.time


def test_a_run_that_goes_on_has_twins():
    """A twin counts from the start of its run too."""
    _, end = finished(configuration("rigid", drive={"velocity": 1e-5}, run__duration=0.05))
    config = configuration("rigid", drive={"velocity": 2e-5}, run__duration=0.05)
    with Realization(config, 0, after=end) as one:
        one.advance_to(0.02)
        with one.twin(0.0) as twin:
            one.advance_to(0.06)
            twin.advance_to(0.06)
            assert one.finished
            assert twin.time == one.time == pytest.approx(0.05)
            there = one.trace[-len(twin.trace) :]
            np.testing.assert_array_equal(twin.trace, there)
            assert twin.displacement == one.displacement


@pytest.mark.parametrize("ratio", [0.0, 0.2])
def test_another_spring_bears_the_same_force(ratio):
    """Contacts that do not break: a damped oscillator, by its matrix exponential."""
    from scipy.linalg import expm

    mass, springs, stiffness, velocity = 1.47e-3, (97.0, 300.0), 2000.0, 1e-6
    config = Config.from_dict(
        klein_tables(
            run__duration=0.02,
            contacts__coupling="equal",
            output__interval=1e-3,
            drive__velocity=velocity,
            slider={"mass": mass, "stiffness": springs[0], "damping_ratio": ratio},
        )
    )
    _, end = finished(config)
    one, _ = finished(config.replace({"slider.stiffness": springs[1]}), end)
    trace = one.records("trace")
    assert trace["spring_force"][0] == pytest.approx(end_force(end.config), rel=1e-12)
    # X, V, W and the spring's stretch, which grows with the drive.
    start = [0.0, trace["velocity"][0], damper_mean(config), trace["spring_force"][0], 1.0]
    offset = trace["contact_force"][0]
    spring = springs[1]
    damping = one.config.slider.oscillator.damping
    matrix = np.zeros((5, 5))
    matrix[0, 1] = 1
    matrix[1] = [-stiffness / mass, -damping, damping, 1 / mass, -offset / mass]
    matrix[2, 1:3] = damping, -damping
    matrix[3, 1], matrix[3, 4] = -spring, spring * velocity
    for sample in trace:
        expected = expm(matrix * sample["time"]) @ start
        assert sample["displacement"] == pytest.approx(expected[0], abs=1e-9 * 1e-8)
        assert sample["spring_force"] == pytest.approx(expected[3], rel=1e-9)
    assert abs(one.energy_residual) < 1e-9


def end_force(config):
    """Spring force at the end of a run from its start."""
    return finished(config)[0].records("trace")["spring_force"][-1]


def damper_mean(config):
    """Running mean of the velocity W at the end of a run: dW/dt = η (V − W)."""
    fine = config.replace({"output.interval": 1e-6})
    trace = finished(fine)[0].records("trace")
    rate = config.slider.oscillator.damping
    from scipy.integrate import simpson

    weight = rate * np.exp(-rate * (trace["time"][-1] - trace["time"]))
    return float(simpson(weight * trace["velocity"], x=trace["time"]))


def test_a_sweep_up_and_down(tmp_path):
    """Its points are those of one run with stages; resumed, it is the same."""
    stages = [*VELOCITIES, *VELOCITIES[::-1]]
    drive = {"stage": [{"duration": 0.4, "velocity": one} for one in stages]}
    whole = Config.from_dict(SHORT | {"drive": drive, "run": SHORT["run"] | {"duration": 2.4}})
    plan = Plan.from_dict(sweep_tables(order="up and down", discard=0.0))
    interval = plan.config(0).output_interval
    trace = finished(whole.replace({"output.interval": interval}))[0].records("trace")
    with Store(tmp_path, "points") as store:
        done = run_sweep(plan, store=store)
        assert (done.computed, done.stored) == (6, 0)
        data = done.dataset
        assert data["mean_force"].dims == ("drive.velocity", "direction", "realization")
        assert data["direction"].values.tolist() == ["up", "down"]
        for number, one in enumerate(stages):
            inside = (trace["time"] > 0.4 * number - 1e-9) & (
                trace["time"] < 0.4 * (number + 1) + 1e-9
            )
            point = data.sel({"drive.velocity": one, "direction": "up" if number < 3 else "down"})
            expected = np.mean(trace["spring_force"][inside])
            assert float(point["mean_force"].item()) == pytest.approx(expected, rel=1e-12)
        up, down = (data["mean_force"].sel(direction=one).values for one in ("up", "down"))
        assert not np.array_equal(up[:2], down[:2])
        # Without one of its points the chain is computed again, but for those that are there.
        (group,) = groups(plan)
        (tmp_path / f"{group.names(0)[2]}.json").unlink()
        again = run_sweep(plan, store=store, executor=mesoslip.Threads(1))
        assert (again.computed, again.stored) == (1, 5)
        np.testing.assert_array_equal(again.dataset["mean_force"], data["mean_force"])
        # Points of the start of a chain are those of a shorter one; others are not.
        shorter = groups(Plan.from_dict(sweep_tables(order="up", discard=0.0)))[0]
        assert shorter.names(0) == group.names(0)[:3]
        alone = groups(Plan.from_dict(sweep_tables(order="down", discard=0.0)))[0]
        assert not set(alone.names(0)) & set(group.names(0))


def test_other_axes_are_other_chains():
    grid = {"drive.velocity": VELOCITIES[::-1], "contacts.delay": [1e-4, 5e-4]}
    for order, expected in (("up", VELOCITIES), ("listed", VELOCITIES[::-1])):
        plan = Plan.from_dict(sweep_tables(grid=grid, order=order))
        chains = [[plan.values(one) for one in chain] for chain in plan.chains()]
        assert len(chains) == 2
        for chain, delay in zip(chains, grid["contacts.delay"], strict=True):
            assert [one["drive.velocity"] for one in chain] == expected
            assert {one["contacts.delay"] for one in chain} == {delay}


def test_a_failure_ends_its_chain_only():
    """What comes after it has nothing to go on from; a measure that fails ends nothing."""
    plan = Plan.from_dict(sweep_tables(order="up"))
    task = task_of(plan, groups(plan)[0], 0)
    wrong = {
        **task.configs[1],
        "slider": {"kind": "layered", "mass": 1e-3, "stiffness": 97.0, "layers": 2},
    }
    broken = dataclasses.replace(task, configs=(task.configs[0], wrong, task.configs[2]))
    first, second, third = compute(broken, Stop(None))
    assert first.measures
    assert "'rigid slider' where this version of the program has" in second.failure
    assert third.failure == "the run from which it starts failed"
    raising = (
        "half",
        "def half(tree):\n    return 1 / (tree['breaks'].values[0] > 1e6)\n",
        "own.py",
    )
    outcomes = compute(dataclasses.replace(task, measures=(raising,)), Stop(None))
    assert ["half" in one.failure for one in outcomes] == [True] * 3
    stopped = Stop(None)
    stopped.set()
    assert compute(task, stopped) == ()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"continue": "contacts.delay"}, r"continue = 'contacts.delay': must be one of drive"),
        ({"continue": "drive.force"}, r"continue = 'drive.force': needs values in \[sweep.grid\]"),
        ({"measures": ["lyapunov_exponent"]}, "lyapunov_exponent is measured in another run"),
        ({"continue": None, "order": "up"}, "order of sweep.continue, which is missing"),
        (
            {"run": {"duration": 0.4, "stop": {"displacement": 1e-8}}},
            "ends a run where no other can start",
        ),
        (
            {
                "continue": "slider.stiffness",
                "grid": {"slider.stiffness": [50, 100], "slider.kind": ["quasistatic"]},
            },
            "slider.stiffness needs a slider of kind 'rigid', not 'quasistatic'",
        ),
    ],
)
def test_what_cannot_go_on_is_refused(changes, message):
    given = sweep_tables()
    for key, value in changes.items():
        (given if key == "run" else given["sweep"])[key] = value
    given["sweep"] = {key: one for key, one in given["sweep"].items() if one is not None}
    with pytest.raises(ConfigError, match=message):
        _ = Plan.from_dict(given).keys
