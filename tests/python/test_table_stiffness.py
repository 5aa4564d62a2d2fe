"""Threshold tables with a stiffness for each threshold."""

import mesoslip
import numpy as np
import pytest
from conftest import drive_in_stages, klein_tables, long, problem_of
from mesoslip import Config, ConfigError
from mesoslip.configuration.threshold_laws.table import stretch_cells
from mesoslip.theory.contacts.plain_sliding import SteadySliding
from mesoslip.theory.force_curve import ForceCurve
from mesoslip.theory.life_transforms import LifeTransforms

pytestmark = pytest.mark.usefixtures("no_step_errors")

PRESCRIBED = {
    "contacts__delay": 0.0,
    "contacts__drag_rate": 0.0,
    "contacts__back_force_ratio": 0.2,
    "slider": {"kind": "prescribed"},
    "run__duration": None,
    "output": {},
}
FORWARD = {"run__drive_displacement": 5e-8}
# Far enough back that contacts break there, and forward again.
BACK_AND_FORTH = {
    "run__duration": 0.013,
    "drive": drive_in_stages((0.005, 4e-6), (0.004, -6e-6), (0.004, 5e-6)),
}
RANDOM = np.random.default_rng(3)
THRESHOLDS = RANDOM.uniform(0.5, 1.5, 200)
STIFFNESSES = {
    "uncorrelated": RANDOM.uniform(0.4, 2.5, 200),
    "anti-correlated": THRESHOLDS**-1.5,
}
WEIGHTS = RANDOM.integers(1, 4, 200)


def table(thresholds, stiffnesses=None, weights=None) -> dict[str, object]:
    law: dict[str, object] = {"law": "table", "samples": list(map(float, thresholds))}
    if stiffnesses is not None:
        law["stiffnesses"] = list(map(float, stiffnesses))
    if weights is not None:
        law["weights"] = list(map(float, weights))
    return law


def rows(kind: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Weights, thresholds and stiffnesses of a table, the means of the latter being 1."""
    weight = WEIGHTS / WEIGHTS.sum()
    stiffness = STIFFNESSES[kind]
    threshold = THRESHOLDS / np.sum(weight * THRESHOLDS)
    return weight, threshold, stiffness / np.sum(weight * stiffness)


@pytest.fixture(name="uneven")
def uneven_contacts(klein):
    """Configuration of a table of thresholds and stiffnesses without a relation to each other."""

    def configuration(kind: str = "uncorrelated", **changes) -> Config:
        law = table(THRESHOLDS, STIFFNESSES[kind], WEIGHTS)
        changes = {"contacts__coupling": "table"} | PRESCRIBED | changes
        return klein(contacts__threshold=law, **changes)

    return configuration


def force_of(config: Config) -> np.ndarray:
    output = mesoslip.run(config)
    assert np.max(np.abs(output["energy_residual"])) < 1e-12
    return output["spring_force"].values.ravel()


@pytest.mark.parametrize("engine", ["eq", "me"])
@pytest.mark.parametrize(
    "changes",
    [FORWARD | {"contacts__initial": "steady", "contacts__newborn_width": 0.05}, BACK_AND_FORTH],
)
def test_one_stiffness_is_that_of_equal_contacts(klein, engine, changes):
    changes = PRESCRIBED | changes | {"run__engine": engine}
    same = table(THRESHOLDS, np.full(200, 3.0))
    ours = force_of(klein(contacts__threshold=same, contacts__coupling="table", **changes))
    equal = {"contacts__threshold": table(THRESHOLDS), "contacts__coupling": "equal"}
    theirs = force_of(klein(**equal, **changes))
    np.testing.assert_allclose(ours, theirs, atol=1e-10 * np.max(theirs))


def test_stiffness_as_the_root_of_the_threshold_is_scaled(klein):
    """To the error of the cells, which falls faster than the distance of samples."""
    errors = []
    for number in (100, 1000):
        area = 0.2 - np.log1p(-(np.arange(number) + 0.5) / number)
        area /= area.mean()
        root = np.sqrt(area)
        laws = (
            {"contacts__threshold": table(area, root), "contacts__coupling": "table"},
            {"contacts__threshold": table(area), "contacts__coupling": "scaled"},
        )
        # N k is that of the mean threshold for scaled contacts, and of all contacts for a table.
        total = (2000 * root.mean(), 2000.0)
        dragged = {"contacts__drag_rate": 2e11, "contacts__delay": 5e-4, "drive__velocity": 1e-4}
        slow, fast = (
            [
                klein(**law, **PRESCRIBED | changes | {"contacts__stiffness": stiffness})
                for law, stiffness in zip(laws, total, strict=True)
            ]
            for changes in (FORWARD | {"run__engine": "me"}, FORWARD | dragged)
        )
        ours, theirs = (force_of(one) for one in slow)
        scale = np.max(theirs)
        ours_fast, theirs_fast = (SteadySliding(one) for one in fast)
        rates = np.array([50j, 1e4j, 1e3 + 1e3j])
        response = theirs_fast.response_at(rates)
        errors.append(
            [
                np.max(np.abs(ours - theirs)) / scale,
                abs(ours_fast.force / theirs_fast.force - 1),
                np.max(np.abs(ours_fast.response_at(rates) / response - 1)),
            ]
        )
    assert np.all(np.array(errors[0]) < 3e-3)
    assert np.all(np.array(errors[1]) < 6e-4)
    assert errors[1][0] < errors[0][0] / 5


@pytest.mark.parametrize("kind", STIFFNESSES)
def test_first_loading_and_steady_force_are_sums_over_the_rows(uneven, kind):
    """F(X) = sum of w k X over rows with X < f/k; to the half of a cell that a row spreads over."""
    weight, threshold, stiffness = rows(kind)
    fibres = uneven(
        kind,
        run__engine="me",
        contacts__back_force_ratio=0.0,
        contacts__reattach=False,
        run__resolution=0.02,
        **FORWARD,
    )
    static, unit = fibres.contacts.static_force, fibres.contacts.break_stretch
    output = mesoslip.run(fibres)
    x = output["drive_displacement"].values.ravel() / unit
    pinned = x[:, None] < threshold / stiffness
    sums = x * np.sum(np.where(pinned, weight * stiffness, 0), axis=1)
    forces = output["spring_force"].values.ravel() / static
    assert np.mean(np.abs(forces - sums)) < 3e-3
    # Nearer to those of the cells, in which the rows are spread.
    cells = stretch_cells(tuple(THRESHOLDS), tuple(WEIGHTS), tuple(STIFFNESSES[kind]))
    part = np.clip((cells.edges[1:] - x[:, None]) / np.diff(cells.edges), 0, 1)
    sums = x * np.sum(part * cells.weights * cells.stiffnesses, axis=1)
    assert np.mean(np.abs(forces - sums)) < 1e-4

    back = 0.2
    stretch, attached = threshold / stiffness, back / stiffness
    work = np.sum(weight * stiffness * (stretch**2 - attached**2)) / 2
    steady = static * work / np.sum(weight * (stretch - attached))
    assert mesoslip.derived(uneven(kind, **FORWARD))["F_steady"].value == pytest.approx(
        steady, rel=1e-3
    )


@pytest.mark.parametrize("kind", STIFFNESSES)
@pytest.mark.parametrize(
    "changes",
    [
        long(FORWARD | {"contacts__initial": "uniform"}),
        FORWARD | {"contacts__initial": "steady", "contacts__newborn_width": 0.05},
        BACK_AND_FORTH,
    ],
)
def test_engines_agree_as_the_root_of_the_number(uneven, kind, changes):
    me = force_of(uneven(kind, **changes, run__engine="me"))
    for number in (1000, 32_000):
        eq = force_of(uneven(kind, **changes, contacts__count=number))
        error = np.sqrt(np.mean((eq - me) ** 2)) / np.max(np.abs(me))
        assert error < 1.1 / np.sqrt(number)


def test_engines_agree_in_stick_slip(uneven):
    """Slips with delay and drag; breaks in both directions while the slider rings."""
    changes = {
        "slider": {"kind": "rigid", "mass": 1.47e-3, "stiffness": 97.0, "damping_ratio": 0.05},
        "contacts__delay": 1e-3,
        "contacts__drag_rate": 2e11,
        "contacts__initial": "steady",
        "drive": {"velocity": 2e-5},
        "run__duration": 0.05,
        "output": {"interval": 1e-4},
    }
    me = mesoslip.run(uneven(**changes, run__engine="me"))["spring_force"].values.ravel()
    eq = mesoslip.run(uneven(**changes, contacts__count=16_000))["spring_force"].values.ravel()
    assert np.max(np.abs(eq - me)) < 0.04 * np.max(me)


@pytest.mark.parametrize(("initial", "tolerance"), [("relaxed", 5e-3), ("steady", 1e-3)])
def test_the_force_curve_is_that_of_a_run(klein, initial, tolerance):
    """Run and curve have different errors, of steps of populations and of panels."""
    config = klein(
        contacts__threshold=table([1, 2, 3, 4, 2.5, 1.7], [1, 4, 2, 3, 2, 5]),
        contacts__coupling="table",
        contacts__initial=initial,
        curve={"length": 2.5e-8, "tolerance": 1e-3},
        **PRESCRIBED | {"run__engine": "me", "run__drive_displacement": 2.5e-8},
    )
    output = mesoslip.run(config.replace({"run.resolution": 0.05}))
    curve = ForceCurve(config)
    assert curve.conservation_error < 1e-4
    x = output["drive_displacement"].values.ravel()[:-1]
    force = output["spring_force"].values.ravel()[:-1] / config.contacts.static_force
    found = curve.force(x) / config.contacts.static_force
    assert np.max(np.abs(found - force)) < tolerance
    at = np.linspace(0, 1.3 * curve.scales.longest * config.contacts.break_stretch, 4001)
    density, atom = curve.stretch_density(at, 1e-8)
    assert np.sum(density) * at[1] + atom == pytest.approx(1, abs=5e-3)


def test_transforms_of_lives_are_sums_over_the_rows(uneven):
    weight, threshold, stiffness = rows("uncorrelated")
    life = (threshold - 0.2) / stiffness
    transforms = LifeTransforms(
        uneven(**FORWARD), uneven(**FORWARD).contacts.threshold.relative_width
    )
    s = np.array([0.3, 1 + 2j, 3j])
    factor = weight * np.exp(-s[:, None] * life)
    found = transforms.transforms(s)
    square = np.sum(weight * stiffness**2)
    for value, of_row in (
        (found.life, 1.0),
        (found.stiffness, stiffness),
        (found.broken_force, threshold),
        (found.mass, stiffness**2 / square),
    ):
        np.testing.assert_allclose(value, np.sum(factor * of_row, axis=1), rtol=2e-2, atol=2e-3)
    averages = transforms.averages
    assert averages.mean_life == pytest.approx(np.sum(weight * life), rel=1e-3)
    assert averages.stiffness == pytest.approx(1, rel=1e-12)
    assert averages.mass == pytest.approx(1, rel=1e-12)


def test_cells_keep_the_means_of_the_rows():
    """Also of equal rows, of rows that break at one stretch, and of more rows than cells."""
    cells = stretch_cells((1.0, 2.0, 4.0, 4.0, 3.0), None, (1.0, 2.0, 1.0, 1.0, 1.0))
    assert len(cells.weights) == 5
    # Two of the rows break at the stretch 1, and share the cell around it.
    assert cells.stiffnesses[1] == pytest.approx(2 * cells.stiffnesses[0])
    many = np.random.default_rng(1).uniform(0.5, 2, (2, 30_000))
    cells = stretch_cells(tuple(many[0]), None, tuple(many[1]))
    assert len(cells.weights) <= 4000
    middle = (cells.edges[1:] + cells.edges[:-1]) / 2
    assert np.sum(cells.weights * cells.stiffnesses) == pytest.approx(1, rel=1e-12)
    assert np.sum(cells.weights * cells.stiffnesses * middle) == pytest.approx(1, rel=1e-12)
    stretch = many[0] / many[1] * many[1].mean() / many[0].mean()
    assert np.sum(cells.weights * middle) == pytest.approx(np.mean(stretch), rel=2e-3)


def test_a_file_with_stiffnesses_sets_the_coupling(tmp_path):
    (tmp_path / "rows.csv").write_text(
        "area [um^2], stiffness [N/mm], weight\n1.0, 2, 1\n2.5, 3, 2\n4, 3, 0\n"
    )
    tables = klein_tables()
    tables["contacts"]["threshold"] = {"law": "table", "file": str(tmp_path / "rows.csv")}
    config = Config.from_dict(tables)
    assert config.contacts.coupling == "table"
    assert config.contacts.threshold.stiffnesses == (2, 3, 3)
    again = Config.from_toml(config.to_toml())
    assert again == config
    assert again.contacts.coupling == "table"
    gaussian = {"law": "gaussian", "relative_width": 0.1}
    with pytest.raises(ConfigError, match='otherwise "scaled" or "equal"'):
        config.replace({"contacts.threshold": gaussian})
    back = config.replace({"contacts.threshold": gaussian, "contacts.coupling": "equal"})
    assert back.contacts.threshold.stiffnesses is None


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("threshold,stiffness\n1,1\n2,-2\n", "line 3: the stiffness must be positive (is -2)"),
        ("threshold,stiffness\n1,0\n2,0\n", "line 2: the stiffness must be positive (is 0)"),
        ("threshold,stiffness\n1,1\n2,nan\n", "line 3"),
        ("threshold,stiffness\n1,1\n2,\n", "line 3: the stiffness is missing"),
        ("threshold,stiffness\n1,1\n", "must have at least two rows of numbers (has 1)"),
        ("threshold,stiffness\n1,2\n2,4\n", "must not all be proportional to the thresholds"),
        ("threshold,stiffness [um]\n1,2\n2,3\n", "the column stiffness: has the unit um"),
        ("area,stiffness,stiffness\n1,2,3\n2,3,4\n", "two columns stiffness"),
    ],
)
def test_what_is_wrong_with_a_file(tmp_path, text, words):
    path = tmp_path / "rows.csv"
    path.write_text(text)
    tables = klein_tables(contacts__threshold={"law": "table", "file": str(path)})
    problem = problem_of(tables)
    assert problem.key == "contacts.threshold.file"
    assert words in problem.message


EVEN = table([1, 2], [1, 1])


@pytest.mark.parametrize(
    ("changes", "key", "words"),
    [
        ({"contacts__threshold": table([1, 2], [1])}, "threshold.stiffnesses", "as many values"),
        ({"contacts__threshold": table([1, 2], [1, -1])}, "threshold.stiffnesses", "be positive"),
        (
            {"contacts__threshold": {"law": "gaussian", "relative_width": 1, "stiffnesses": [1]}},
            "threshold.stiffnesses",
            'law = "table"',
        ),
        ({"contacts__threshold": table([1, 2])}, "coupling", "needs contacts.threshold with"),
        ({"contacts__threshold": EVEN, "contacts__coupling": "scaled"}, "coupling", '"table"'),
        (
            {"contacts__threshold": EVEN, "contacts__thermal": {"rate": 1e3, "force_ratio": 0.1}},
            "coupling",
            'must be "equal" with contacts.thermal',
        ),
        (
            {
                "contacts__threshold": EVEN,
                "contacts__ageing": {"law": "log", "time": 1.0, "growth": 0.1},
            },
            "coupling",
            'must be "equal" for contacts that age',
        ),
    ],
)
def test_what_is_wrong_with_the_keys(changes, key, words):
    problem = problem_of(klein_tables(**{"contacts__coupling": "table"} | changes))
    assert problem.key == f"contacts.{key}"
    assert words in problem.message
