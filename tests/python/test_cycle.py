"""The settled cycle of the master equation."""

import dataclasses
import json
import math

import mesoslip
import numpy as np
import pytest
from conftest import ROOT, at_end
from mesoslip.cycles import branch
from mesoslip.cycles.branch import adapted
from mesoslip.cycles.coordinates import PINNED, SLIDER, Coordinates
from mesoslip.cycles.cycle import _cycle_of, _disturbed, _refined, master_equation
from mesoslip.cycles.decay import Batch
from mesoslip.cycles.disturbance import MAX_RETURN, after_disturbance, multipliers
from mesoslip.cycles.section import Motion, Passage, extreme, time_of
from mesoslip.cycles.settling import Settled, _Settling, settle
from mesoslip.simulation.archive import Archive
from mesoslip.simulation.recorded_tables import TRACE_COLUMNS
from mesoslip.theory.contacts import contact_theory
from mesoslip.theory.contacts.plain_sliding import SteadySliding
from scipy.optimize import minimize_scalar
from scipy.special import ndtr

# Klein's case with broad thresholds, strong damping and a long delay: regular stick-slip.
REGULAR = (
    "run.engine=me",
    "contacts.delay=2ms",
    "contacts.threshold.relative_width=0.1",
    "slider.damping_ratio=1",
    "drive.velocity=3um/s",
    "output.slip_interval=0",
)
# Steps twice as long as by default, where numbers are compared more coarsely.
LONG_STEPS = "run.resolution=0.5"

# Narrow thresholds, slow drive, no back force, and a delay in which the slider comes to rest:
# nearly all contacts break together and attach together, at one displacement.
TOGETHER = (
    "contacts.coupling=equal",
    "contacts.back_force_ratio=0",
    "contacts.delay=0.3 s",
    "contacts.threshold.relative_width=0.05",
    LONG_STEPS,
    "slider.damping_ratio=0.5",
    "drive.velocity=0.1um/s",
)


def configuration(*changes: str) -> mesoslip.Config:
    return mesoslip.Config.load(ROOT / "runs" / "klein.toml", [*REGULAR, *changes])


@pytest.fixture(scope="module")
def regular() -> mesoslip.Cycle:
    return mesoslip.cycle(configuration())


def test_cycle_agrees_with_a_long_run(regular):
    config = configuration("run.duration=4s", "output.interval=4s")
    with mesoslip.Realization(config, estimates_errors=False) as run:
        at_end(run)
        slips = run.records("slips")[-11:]
    assert regular.motion == "periodic"
    assert regular.multiple == 1
    assert regular.period == pytest.approx(np.mean(np.diff(slips["start_time"])), rel=1e-4)
    assert regular.peak_force == pytest.approx(np.mean(slips["force_before"]), rel=1e-4)
    assert regular.low_force == pytest.approx(np.mean(slips["force_after"]), rel=1e-4)
    duration = np.mean(slips["end_time"] - slips["start_time"])
    assert regular.slips == 1
    assert regular.slip_share == pytest.approx(duration / regular.period, rel=1e-3)


def test_contacts_that_break_together():
    """Contacts one by one, which share nothing with the map, and the force of a bundle in closed
    form: F(X) = Nk X J(X) up to its maximum, from where the slip starts."""
    found = mesoslip.cycle(configuration(*TOGETHER), find_multipliers=False)
    assert found.motion == "periodic"
    one_by_one = configuration(
        *TOGETHER,
        "run.engine=eq",
        "contacts.count=50000",
        "run.duration=8.5s",
        "output.interval=2s",
    )
    with mesoslip.Realization(one_by_one) as run:
        at_end(run)
        slips = run.records("slips")
    peaks, times = slips["force_before"], slips["start_time"]
    assert len(slips) == 4
    assert found.peak_force == pytest.approx(peaks[-1], rel=1e-3)
    assert found.period == pytest.approx(times[-1] - times[-2], rel=1e-3)
    contacts, slider = one_by_one.contacts, one_by_one.slider
    width = contacts.threshold.relative_width
    top = minimize_scalar(lambda u: -u * ndtr((1 - u) / width), bounds=(0.5, 1), method="bounded")
    force = -top.fun * contacts.static_force
    displacement = top.x * contacts.static_force / contacts.stiffness
    period = (displacement + force / slider.stiffness) / 1e-7 + contacts.delay
    # The relaxed start has one origin. Later some 1 % of the contacts break before the slip, attach
    # before the others, and load earlier.
    assert peaks[0] == pytest.approx(force, rel=5e-3)
    assert 0.98 < found.peak_force / force < 1
    assert 0.98 < found.period / period < 1


def test_the_start_does_not_matter(regular):
    other = mesoslip.cycle(configuration(), start="steady", find_multipliers=False)
    assert other.period == pytest.approx(regular.period, rel=1e-4)
    again = mesoslip.cycle(configuration(), start=regular, find_multipliers=False)
    assert again.period == pytest.approx(regular.period, rel=2e-5)
    assert again.cycles < regular.cycles


def test_a_cycle_comes_back_though_small_changes_grow_at_first():
    """Period and peaks beside those from another start."""
    changes = (
        "drive.velocity=2.05um/s",
        "contacts.delay=1.071ms",
        "contacts.threshold.relative_width=0.124",
        "slider.stiffness=144.2",
        "slider.damping_ratio=1.117",
        LONG_STEPS,
    )
    found = mesoslip.cycle(configuration(*changes))
    assert found.is_stable
    assert abs(found.multipliers[0]) < 0.8
    assert found.error < 1e-4
    other = mesoslip.cycle(configuration(*changes), start="steady")
    assert found.period == pytest.approx(other.period, rel=2e-5)
    assert found.peak_force == pytest.approx(other.peak_force, rel=2e-5)


def test_multiplier_is_the_decay_of_a_perturbation(regular):
    motion = Motion(regular.config)
    coordinates = Coordinates(regular.config, motion.velocity)
    vector = coordinates.of(regular.state)
    # A tenth of the detached contacts, and of the velocity, beside what a sine adds to the pinned.
    change = 2e-3 * np.sin(np.arange(len(vector))) * vector / np.max(vector)
    change[2:] -= vector[2:] * change[2:].sum()
    words, changed, sizes = regular.state, coordinates.changed(regular.state, change), []
    for _ in range(9):
        one, two = (motion.next_passage(state, regular.section) for state in (words, changed))
        words, changed = one.words, two.words
        sizes.append(
            np.linalg.norm(coordinates.weigh(coordinates.of(changed) - coordinates.of(words)))
        )
    # The leading multipliers are complex: the changes decay unevenly.
    factor = (sizes[8] / sizes[1]) ** (1 / 7)
    assert regular.is_stable
    assert factor == pytest.approx(abs(regular.multipliers[0]), abs=0.15)


@pytest.mark.parametrize("leading", [0.7, -0.9, 0.6 + 0.5j])
def test_multipliers_of_a_linear_map(leading):
    """Changes along the leading directions, and along one that is forgotten sooner."""
    powers = leading ** np.arange(12)
    changes = np.stack([powers.real, powers.imag, 0.1 * 0.3 ** np.arange(12)], axis=1)
    found = multipliers(list(changes))
    assert len(found) == (2 if np.iscomplex(leading) else 1)
    assert abs(found[0]) == pytest.approx(abs(leading), rel=0.1)
    assert abs(np.angle(found[0])) == pytest.approx(abs(np.angle(leading)), abs=0.05)


class Scaled(Motion):
    """The regular cycle, with a force that deviates by a part times a factor to the passages."""

    def __init__(self, cycle, part, factor):
        super().__init__(cycle.config)
        self.cycle, self.part, self.factor = cycle, part, factor

    def next_passage(self, words, _level):
        self.part *= self.factor
        trace = self.cycle._trace.copy()
        trace["spring_force"] *= 1 + self.part
        return Passage(words, 0.0, self.cycle.period, trace, trace[:0])


@pytest.mark.parametrize(("part", "factor"), [(0.01, 0.6), (0.01, -0.7), (1e-4, 1.2), (0.01, 1.0)])
def test_a_cycle_is_stable_if_it_returns(regular, part, factor):
    rows = np.array([[regular.period, regular.peak_force, regular.low_force]])
    settled = Settled("periodic", 1, [], regular.section, regular.state, 0.0, 9, 1e-6, rows)
    back = after_disturbance(Scaled(regular, part, factor), settled)
    assert back.returns == (abs(factor) < 1)
    assert back.cycles == MAX_RETURN or back.returns


def test_a_motion_that_does_not_return_settles_again(regular):
    """An unstable cycle is not the motion, but what a disturbance of it leads to; one to which it
    comes back slowly is."""

    def settled(period, multiple=1):
        rows = np.tile([period, 2.0, 1.0], (multiple, 1))
        return Settled("periodic", multiple, [], regular.section, regular.state, 0.0, 9, 1e-6, rows)

    never = Scaled(regular, 0.01, 1.0)
    # The same cycle again.
    found, back, cycles = _disturbed(never, settled(0.1), lambda *_: settled(0.1), 1e-4)
    assert back.returns
    assert cycles == 18 + MAX_RETURN
    # Another one each time.
    others = iter([settled(0.2), settled(0.3), settled(0.4)])
    found, back, _ = _disturbed(never, settled(0.1), lambda *_: next(others), 1e-4)
    assert not back.returns
    assert found.rows[0, 0] == 0.4


def test_the_spread_of_an_irregular_motion_has_its_periods():
    """Of passages between the same extremes, a fifth of which take longer."""
    durations = np.where(np.arange(80) % 5, 1.0, 1.5)
    rows = np.stack([durations, np.full(80, 2.0), np.full(80, 1.0)], axis=1)
    words = np.empty(0, dtype=np.int64)
    settled = Settled("irregular", 1, [], None, words, 80.0, 80, math.nan, rows)
    found = _cycle_of(configuration(), settled, None, None)
    assert found.spread == pytest.approx(np.std(durations[20:]) / np.mean(durations[20:]))


def test_two_small_changes_may_be_by_accident():
    """Three passages of nearly one peak, before one that differs by fifty times their changes."""
    run = _Settling(Motion(configuration()), None, None, 1e-5, 0.0)
    peaks = [2.0, 2.00001, 2.000015, 2.0005, 2.00050001, 2.00050001, 2.00050001]
    rows = [np.array([1.0, peak, 1.0]) for peak in peaks]
    settled = []
    for count in range(1, len(rows) + 1):
        run._rows = rows[:count]
        settled.append(run._is_settled(1))
    assert settled == 6 * [False] + [True]


@pytest.mark.parametrize(("factor", "is_far"), [(0.96, True), (1.0, False)])
def test_the_error_of_a_slow_return_is_the_distance_to_its_limit(regular, factor, is_far):
    """Of a cycle of three passages with a peak that deviates by less and less in each, or by as
    much to both sides."""
    run = _Settling(Motion(configuration()), None, None, 1e-5, 0.0)
    cycles = np.arange(39) // 3
    deviation = 1e-3 * factor**cycles * (1.0 if is_far else (-1.0) ** cycles)
    run._rows = [
        np.array([1.0, 2.0 + 0.1 * (one % 3) + deviation[one], 1.0]) for one in range(len(cycles))
    ]
    found = run.result("periodic", regular.state)
    assert found.multiple == 3
    amplitude = run._rows[-1][1] - run._rows[-1][2]
    left = deviation[-1] / amplitude
    assert found.error == pytest.approx(left, rel=0.3)


def test_smooth_sliding_and_irregular_motion_are_told_apart():
    smooth = mesoslip.cycle(configuration("contacts.delay=0", LONG_STEPS))
    assert smooth.motion == "smooth"
    assert smooth.smooth_stable
    assert smooth.amplitude == 0
    assert "smooth sliding" in smooth.verdict
    irregular = mesoslip.cycle(configuration("slider.damping_ratio=0.2", LONG_STEPS))
    assert irregular.motion == "irregular"
    assert irregular.spread > 0.02
    assert sum(irregular.durations) < irregular.followed
    assert "stays irregular for" in irregular.verdict
    assert f"confirmed in {irregular.cycles} at resolution 0.5" in irregular.verdict
    assert irregular.coarse_cycles > irregular.cycles
    assert irregular.is_stable is None


@pytest.mark.parametrize(("motion", "is_start"), [("smooth", True), ("periodic", False)])
def test_what_long_steps_hand_over(motion, is_start, monkeypatch):
    """No decayed motion, and no amplitudes but those of an irregular one; progress does not go
    back."""
    handed, parts = [], []

    def settled(which, words, level, *, batches, **options):
        if which.config.run.resolution == 1:
            found = settle(which, words, level, batches=batches, **options)
            return dataclasses.replace(found, motion=motion, batches=[Batch(0.0, 1.0, 0.1, False)])
        handed.append((words is None, len(batches)))
        return settle(which, words, level, batches=batches, **options)

    monkeypatch.setattr(mesoslip.cycles.cycle, "settle", settled)
    mesoslip.cycle(configuration(LONG_STEPS), find_multipliers=False, progress=parts.append)
    assert handed == [(is_start, 0)]
    assert parts == sorted(parts)
    assert parts[-1] > 0.5


def test_a_motion_that_long_steps_may_mislead_begins_at_its_own_start(monkeypatch):
    """Where a cycle of long steps does not return, the next resolution is followed from the start,
    and its cycle is disturbed in turn."""
    started, disturbed = [], []

    def settled(which, words, *arguments, **options):
        started.append((which.config.run.resolution, words is None))
        return settle(which, words, *arguments, **options)

    def after(which, found):
        disturbed.append(which.config.run.resolution)
        back = after_disturbance(which, found)
        return back._replace(returns=len(disturbed) > 1, multipliers=(0.95,))

    monkeypatch.setattr(mesoslip.cycles.cycle, "settle", settled)
    monkeypatch.setattr(mesoslip.cycles.cycle, "after_disturbance", after)
    found = mesoslip.cycle(configuration(LONG_STEPS))
    assert started == [(1.0, True), (0.5, True)]
    assert disturbed == [1.0, 0.5]
    assert found.is_stable
    assert found.coarse_cycles == 0
    # By the last changes alone it would be less than the tolerance.
    assert found.error > 1e-5
    assert "long steps" not in found.verdict
    assert "leads away" in dataclasses.replace(found, is_stable=False).verdict


@pytest.mark.parametrize("chunk", [40, 2000])
def test_a_passage_does_not_depend_on_when_it_is_sought(regular, chunk, monkeypatch):
    motion = Motion(regular.config)
    found = motion.next_passage(regular.state, regular.section)
    monkeypatch.setattr(mesoslip.cycles.section, "CHUNK", chunk)
    again = Motion(regular.config).next_passage(regular.state, regular.section)
    # Which is sought near the end of the one before.
    repeated = motion.next_passage(regular.state, regular.section)
    for one in (again, repeated):
        assert np.array_equal(found.words, one.words)
        assert found.time == one.time


def test_extremes_do_not_depend_on_where_samples_lie():
    """A parabola through three of them is off by up to 9e-4 of the amplitude."""
    stiffness, velocity, amplitude, rate = 97.0, 1e-6, 1e-5, 200.0
    phase = np.linspace(0, 2 * np.pi, 32, endpoint=False)
    dense = np.linspace(0, 2 * np.pi, 1_000_001)
    wave = np.sin(dense) + 0.3 * np.sin(2 * dense + 1)
    for offset in np.linspace(0, 2 * np.pi / 32, 7):
        angle = phase + offset
        force = amplitude * (np.sin(angle) + 0.3 * np.sin(2 * angle + 1))
        slope = amplitude * rate * (np.cos(angle) + 0.6 * np.cos(2 * angle + 1))
        trace = np.zeros(len(angle), [(name, float) for name in TRACE_COLUMNS])
        trace["time"], trace["spring_force"] = angle / rate, force
        trace["drive_displacement"] = velocity * trace["time"]
        trace["displacement"] = trace["drive_displacement"] - force / stiffness
        trace["velocity"] = velocity - slope / stiffness
        found = np.array([extreme(trace, 1), extreme(trace, -1)]) / amplitude
        assert found == pytest.approx([wave.max(), wave.min()], abs=2.5e-5)


@pytest.mark.parametrize("resolution", [0.5, 0.125])
def test_cycles_at_resolutions_between(regular, resolution):
    config = regular.config.replace({"run.resolution": resolution})
    settled = settle(Motion(config), regular.state, regular.section)
    words, count = _refined(config, settled, settled.words)
    assert count == (0 if resolution == 0.5 else 6)
    moved = time_of(words) - time_of(settled.words)
    assert moved == pytest.approx(count * regular.period, rel=1e-3)


@pytest.mark.long
def test_the_motion_is_that_of_a_run_where_two_are_possible():
    """A cycle of three passages that differ by a percent, beside one of a single passage from which
    small disturbances return."""
    config = configuration(
        "drive.velocity=6.559 um/s",
        "contacts.delay=1.901 ms",
        "contacts.threshold.relative_width=0.1038",
        "slider.stiffness=80.74 N/m",
        "slider.damping_ratio=1.402",
    )
    found = mesoslip.cycle(config)
    assert found.multiple == 3
    duration = 100 * found.period
    long = config.replace({"run.duration": duration, "output.interval": duration})
    with mesoslip.Realization(long, estimates_errors=False) as run:
        while not run.finished:
            run.advance()
        slips = run.records("slips")[-4:]
    assert found.period == pytest.approx(np.ptp(slips["start_time"]), rel=1e-4)
    assert found.peak_force == pytest.approx(np.max(slips["force_before"]), rel=1e-3)


def test_a_closed_cycle_is_not_irregular_though_long_steps_say_so(regular, monkeypatch):
    def settled(motion, *arguments, **options):
        found = settle(motion, *arguments, **options)
        if motion.config.run.resolution < 1:
            return found
        peak, low = found.rows[-1, 1:]
        batch = Batch(0.0, peak - low, 0.1 * peak, is_linear=False)
        return dataclasses.replace(found, motion="irregular", batches=[batch] * 3)

    monkeypatch.setattr(mesoslip.cycles.cycle, "settle", settled)
    found = mesoslip.cycle(configuration(), find_multipliers=False)
    assert found.motion == "periodic"
    # Both are still approaching the period of a long run, from either side.
    assert found.period == pytest.approx(regular.period, rel=3e-5)


def test_a_cycle_that_settles_slowly_is_not_irregular(regular):
    """Period and peaks alternate, less and less; the mean amplitude stays the same throughout."""

    class Made(Motion):
        number, factor = 0, -0.93

        def next_passage(self, words, _level):
            self.number += 1
            trace = regular._trace.copy()
            trace["spring_force"] *= 1 + 0.02 * self.factor**self.number
            end = self.number * regular.period
            return Passage(words, end - regular.period, end, trace, trace[:0])

        def advance(self, words, _duration):
            return words, regular._trace

    batch = Batch(0.0, regular.amplitude, 0.01 * regular.amplitude, is_linear=False)
    made = Made(regular.config)
    found = settle(made, regular.state, regular.section, batches=[batch] * 2, is_stable=False)
    assert found.motion == "periodic"
    assert made.number > 40
    # Few passages are more where the changes shrink, and may then be enough.
    for factor, number in ((-1.02, 9), (-0.93, 27)):
        brief = Made(regular.config)
        brief.factor = factor
        assert settle(brief, regular.state, regular.section, max_passages=9).motion == "irregular"
        assert brief.number == number
    brief = Made(regular.config)
    brief.factor = -0.7
    assert settle(brief, regular.state, regular.section, max_passages=9).motion == "periodic"
    assert 9 < brief.number < 40


@pytest.mark.parametrize(("growth", "motion"), [(1.0, "periodic"), (1.05, "irregular")])
def test_a_fine_structure_is_that_of_a_cycle_unless_it_grows(regular, growth, motion):
    class Made(Motion):
        number = 0

        def next_passage(self, words, _level):
            self.number += 1
            trace = regular._trace.copy()
            part = 1e-3 * math.sin(2.4 * self.number) * growth ** (self.number - 30)
            trace["spring_force"] *= 1 + part
            end = self.number * regular.period
            return Passage(words, end - regular.period, end, trace, trace[:0])

    made = Made(regular.config)
    found = settle(made, regular.state, regular.section, max_passages=30)
    assert found.motion == motion
    assert 30 <= made.number < 40


def test_a_state_is_the_same_after_taking_it_apart(regular):
    archive = Archive(regular.state)
    assert np.array_equal(archive.words(), regular.state)
    # Nothing of the motion before waits in it: a kernel stops where much does.
    for section in ("slip trace", "stages"):
        assert archive.numbers(section, "rows").size == 0, section


def test_changes_of_a_state_are_those_asked_for(regular):
    coordinates = Coordinates(regular.config, Motion(regular.config).velocity)
    vector = coordinates.of(regular.state)
    assert vector[2:].sum() == pytest.approx(1, rel=1e-9)
    change = 1e-2 * vector * np.cos(np.arange(len(vector)))
    change[2:] -= vector[2:] * change[2:].sum()
    got = coordinates.of(coordinates.changed(regular.state, change)) - vector
    assert got == pytest.approx(change, abs=1e-7)


def test_branches_go_on_from_the_value_before(regular):
    found = mesoslip.branches(configuration(), "contacts.delay", [1.9e-3, 2e-3])
    assert found["motion"].values.tolist() == [[1, 1], [1, 1]]
    assert found["period"].values[:, 1] == pytest.approx(regular.period, rel=1e-4)
    assert found["peak_force"].values[:, 1] == pytest.approx(regular.peak_force, rel=1e-4)
    assert np.all(found["growth_rate"] > 0)
    with pytest.raises(mesoslip.ConfigError, match=r"contacts\.delay"):
        mesoslip.branches(configuration(), "contacts.count", [10, 20])


def test_the_end_of_an_oscillation_is_found(regular, monkeypatch):
    """Going down only: upwards the oscillation begins where smooth sliding gets unstable."""
    limit = 1.234e-3

    def settled(config, *_, **__):
        motion = "periodic" if config.contacts.delay > limit else "smooth"
        return dataclasses.replace(regular, config=config, motion=motion)

    monkeypatch.setattr(branch, "_next", settled)
    found = mesoslip.branches(configuration(), "contacts.delay", [1e-3, 2e-3, 3e-3])
    assert found["end_direction"].values.tolist() == [1]
    (value,), (beyond,) = found["end_value"].values, found["end_beyond"].values
    assert beyond <= limit < value < 1.01 * beyond
    assert found["end_value"].attrs["units"] == "s"
    assert found["end_amplitude_ratio"].values == pytest.approx(regular.amplitude_ratio)
    labels = [line.get_label() for line in mesoslip.plot(found).axes[0].lines]
    assert "end of the oscillation" in labels


@pytest.mark.parametrize(("alternation", "multiple"), [(0.0, 1), (0.05, 2)])
def test_passages_that_differ_by_their_errors_are_of_one_cycle(regular, alternation, multiple):
    """And those of a cycle of two differ by more."""
    run = _Settling(Motion(regular.config), None, None, 1e-5, 0.0)
    rng = np.random.default_rng(3)
    found = []
    for number in range(40):
        errors = 1 + 1e-5 * rng.standard_normal(3)
        run._rows.append(errors * np.array([0.1, 1e-5 * (1 + alternation * (number % 2)), 2e-6]))
        found.append(run._multiple())
    settled = {one for one, error in found[8:] if error < 1e-5}
    assert settled <= {multiple}
    assert run._spread()[0] == multiple


@pytest.mark.parametrize("phase", np.linspace(0, np.pi, 9))
def test_the_error_by_a_known_decay(phase):
    """Where changes turn, two of them may be small by accident."""
    run = _Settling(Motion(configuration()), None, None, 1e-5, 0.0, decay=0.6)
    multiplier, period = 0.6 * np.exp(0.9j), 0.1
    for number in range(20):
        distance = 1e-3 * float(np.real(multiplier**number * np.exp(1j * phase)))
        run._rows.append(np.array([period * (1 + distance), 1e-5, 2e-6]))
        if number > 2:
            multiple, error = run._multiple()
            assert multiple == 1
            assert abs(distance) < 2 * error
            assert error < 20 * 1e-3 * 0.6**number


@pytest.mark.parametrize(("alternation", "multiple"), [(1e-3, 1), (1e-2, 2)])
def test_the_fine_structure_makes_no_longer_cycles(regular, alternation, multiple):
    """Passages alternate exactly, by less than what is settled all the same, and by more."""
    run = _Settling(Motion(regular.config), None, None, 1e-5, 0.0)
    for number in range(12):
        run._rows.append(np.array([0.1 * (1 + alternation * (number % 2)), 1e-5, 2e-6]))
    found = run.result("periodic", regular.state).shortest()
    assert found.multiple == multiple
    assert found.error == pytest.approx(alternation if multiple == 1 else 0.0, rel=2e-3)


def test_a_cycle_of_four_whose_halves_are_alike_is_one_of_two(regular):
    """As when an alternation dies away slowly: the changes over four passages settle first."""
    run = _Settling(Motion(regular.config), None, None, 1e-5, 0.0)
    for number in range(12):
        part = 0.05 * (number % 2) + 2e-4 * (number % 4 > 1)
        run._rows.append(np.array([0.1 * (1 + part), 1e-5, 2e-6]))
    found = run.result("periodic", regular.state).shortest()
    assert found.multiple == 2
    assert found.error == pytest.approx(2e-4, rel=0.1)


def elastic_force(words) -> float:
    """Force of the pinned contacts of a state [N]."""
    archive = Archive(words)
    stiffness, offset = (archive.number(PINNED, one) for one in ("stiffness", "offset"))
    return stiffness * archive.number(SLIDER, "displacement") - offset


def test_motion_goes_on_at_another_temperature():
    """The steady force is that of the closed form, before and after."""
    cold, warm = (
        configuration(
            "contacts.coupling=equal",
            "contacts.initial=steady",
            "contacts.delay=0.1ms",
            "contacts.thermal.rate=1e5",
            f"contacts.thermal.force_ratio={one}",
            "slider.stiffness=30 kN/m",
            "run.resolution=1",
        )
        for one in (0.01, 0.1)
    )
    words, before = Motion(cold).advance(None, 20e-3)
    changed = adapted(words, cold, warm)
    assert elastic_force(changed) == pytest.approx(elastic_force(words), rel=1e-9)
    after = Motion(warm).advance(changed, 40e-3)[1]
    forces = [contact_theory(one).steady_force(3e-6) for one in (cold, warm)]
    assert forces[1] < 0.95 * forces[0]
    found = [float(np.mean(one["contact_force"][len(one) // 2 :])) for one in (before, after)]
    assert found == pytest.approx(forces, rel=0.01)


def test_motion_goes_on_though_all_contacts_are_detached():
    fast = configuration("drive.velocity=20 um/s", "slider.stiffness=30 kN/m", "run.resolution=1")
    words, trace = Motion(fast).advance(None, 4e-3)
    assert trace["detached_contacts"][-1] == pytest.approx(fast.contacts.count)
    slow = fast.replace({"drive.velocity": 3e-6})
    after = Motion(slow).advance(adapted(words, fast, slow, modulation=0.02), 4e-3)[1]
    assert after["detached_contacts"].min() < 0.9 * slow.contacts.count
    assert np.isfinite(after["contact_force"]).all()


@pytest.mark.parametrize(
    ("change", "damping"),
    [
        ("slider.stiffness=150 N/m", 319.44),  # sqrt(K / M), as the damping ratio is 1
        ("slider.mass=3 g", 179.81),
        ("slider.damping_ratio=0.3", 77.063),
    ],
)
def test_another_slider_keeps_velocities_and_forces(regular, change, damping):
    """The damper pulls by its rate times the difference of two velocities, which stays."""
    other = regular.config.replace(change)
    early = Archive(regular.state)
    late = Archive(adapted(regular.state, regular.config, other))
    gap = late.number(SLIDER, "drive value") - late.number(SLIDER, "displacement")
    force = other.spring_stiffness * gap
    assert force == pytest.approx(regular.section.force, rel=1e-6)
    assert late.number(SLIDER, "velocity") == early.number(SLIDER, "velocity")
    difference = early.number(SLIDER, "damper") / math.sqrt(97 / 1.47e-3)
    damper = late.number(SLIDER, "damper")
    assert damper == pytest.approx(damping * difference, rel=1e-4)
    # What is left of spring and contacts accelerates the slider and pulls at the damper.
    net = [
        one.slider.oscillator.mass * (state.number(SLIDER, "acceleration") + pull)
        for one, state, pull in (
            (regular.config, early, early.number(SLIDER, "damper")),
            (other, late, damper),
        )
    ]
    assert net[1] == pytest.approx(net[0], abs=1e-5 * force)


@pytest.mark.usefixtures("quick_pictures")
def test_command(command, tmp_path):
    file = tmp_path / "regular.toml"
    file.write_text(configuration(LONG_STEPS).to_toml())
    output = tmp_path / "cycle.nc"
    printed = command.output("cycle", file, "-o", output)
    assert "periodic" in printed
    assert "smooth sliding is linearly unstable" in printed
    summary = json.loads(command.output("cycle", file, "--start", output, "--json"))
    assert summary["smooth_stable"] is False
    tree = mesoslip.open_output(output)
    assert summary["period"] == pytest.approx(tree.attrs["period"], rel=2e-5)
    trace = tree["trace"].to_dataset()
    assert float(trace["time"][-1]) == pytest.approx(tree.attrs["period"], rel=0.01)
    assert command("plot", output, "-o", tmp_path / "cycle.png")[0] == 0
    assert command("report", output, "-o", tmp_path / "cycle.html")[0] == 0


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ("--set slider.kind=prescribed", ["slider.kind", "rigid"]),
        ("--set contacts.reattach=false", ["contacts.reattach"]),
        ("--set drive.velocity=0", ["drive", "constant velocity"]),
        ("--continue slider.stifness=100N/m:200N/m:3", ["did you mean 'slider.stiffness'"]),
        ("--continue slider.stiffness=100N/m:200N/m", ["KEY=FROM:TO:POINTS"]),
        ("--continue slider.stiffness=100N/m:200N/m:²", ["KEY=FROM:TO:POINTS"]),
        ("--continue slider.stiffness=100N/m:200N/m:1000000000", ["too many points"]),
        ("--continue nothing=1:2:3", ["unknown key"]),
        ("--continue slider.stiffness=200N/m:100N/m:3", ["slider.stiffness", "ascending"]),
        ("--continue contacts.count=100:200:3", ["contacts.count", "must be one of"]),
    ],
)
def test_what_has_no_cycle_or_cannot_be_followed(command, tmp_path, given, words):
    file = tmp_path / "regular.toml"
    file.write_text(configuration().to_toml())
    errors = command.refusal("cycle", file, *given.split())
    assert all(word in errors for word in words)


def test_a_reversed_drive_has_the_mirror_image(regular):
    found = mesoslip.cycle(configuration("drive.velocity=-3um/s"), find_multipliers=False)
    for name in ("period", "peak_force", "low_force", "slips", "slip_share", "peak_velocity"):
        assert getattr(found, name) == getattr(regular, name), name


def test_interaction_is_left_out():
    config = mesoslip.Config.load(
        ROOT / "runs" / "klein.toml",
        ["interaction.strength=0.1", "interaction.columns=60", "interaction.rows=68"],
    )
    assert master_equation(config).interaction is None


# A stiff spring and broad thresholds: an oscillation of steady sliding that grows or decays slowly.
WEAKLY_DAMPED = (
    "slider.mass=3.2 g",
    "slider.damping_ratio=none",
    "slider.damping=12",
    "contacts.static_force=55 uN",
    "contacts.stiffness=4 kN/m",
    "contacts.delay=0.8 ms",
    "contacts.threshold.relative_width=0.2",
    "contacts.initial=steady",
    LONG_STEPS,
    "drive.velocity=0.8 um/s",
)


def test_slow_decay_at_the_rate_of_linear_theory():
    """Near the linear boundary smooth sliding is found before the oscillation has decayed; the rate
    is that of the roots of Z(λ) + Λ(λ), which share nothing with a run."""
    config = master_equation(configuration(*WEAKLY_DAMPED, "slider.stiffness=38 kN/m"))
    growth = SteadySliding(config).growth_rate
    assert -6 < growth < 0
    motion = Motion(config)
    words, sizes, window = None, [], 0.1
    for _ in range(6):
        words, trace = motion.advance(words, window)
        sizes.append(np.std(trace["spring_force"]))
    assert math.log(sizes[-1] / sizes[-2]) / window == pytest.approx(growth, rel=0.03)
    found = mesoslip.cycle(config)
    assert found.motion == "smooth"
    # Less than a third of the passages until it is below a thousandth of the static force.
    assert found.cycles < 30
    unstable = master_equation(configuration(*WEAKLY_DAMPED, "slider.stiffness=30 kN/m"))
    assert SteadySliding(unstable).growth_rate > 0
    oscillating = mesoslip.cycle(unstable, find_multipliers=False, max_cycles=24)
    assert oscillating.amplitude_ratio > 0.1


@pytest.mark.long
def test_slow_decay_is_not_irregular_motion():
    """An oscillation of 12 % of the static force that takes a second to decay, 500 periods of it:
    the first passages change little from one to the next."""
    changes = ("contacts.threshold.relative_width=0.1", "drive.velocity=0.4 um/s")
    config = master_equation(configuration(*WEAKLY_DAMPED, *changes, "slider.stiffness=38 kN/m"))
    found = mesoslip.cycle(config, max_cycles=24)
    assert found.motion == "smooth"
    assert found.smooth_stable
