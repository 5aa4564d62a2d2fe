"""Interaction as a mean field: lives on a lattice, and the master equation with their tables."""

import json

import mesoslip
import numpy as np
import pytest
from conftest import ROOT
from mesoslip import Config
from mesoslip.campaign.mean_field import FIRST, STEADY

LATTICE = ROOT / "runs" / "source" / "S25d.toml"
# At the same distance from each other.
SMALL = [
    "interaction.columns=20",
    "interaction.rows=20",
    "contacts.count=400",
    "contacts.area=9.8e-12 m^2",
    "run.seed=3",
]


def lattice(strength, *changes):
    """The source's lattice of fewer contacts, with another strength of the interaction."""
    return Config.load(LATTICE, [*SMALL, f"interaction.strength={strength}", *changes])


@pytest.fixture(scope="module")
def strong():
    """The mean field of equal contacts with strong interaction."""
    return mesoslip.mean_field(lattice(0.3, "contacts.coupling=equal", "run.realizations=2"))


def slow(config, length):
    """Displacement in mean breaking stretches of the lattice, and contact force over F_s."""
    tables = config.to_dict()
    tables["run"] |= {"duration": 1.0}
    tables["drive"] = {"velocity": length * 9e-8}
    tables["slider"] = {"kind": "prescribed"}
    tables["contacts"] |= {"delay": 0.0, "drag_rate": 0.0}
    tables["output"] = {"interval": 1e-3}
    tree = mesoslip.run(tables)
    return tree["displacement"].values[0] / 9e-8, tree["contact_force"].values.mean(axis=0) / 18e-6


def test_contacts_that_do_not_interact():
    """Breaks are at the thresholds and births at the back force, as configured."""
    config = lattice(0, "contacts.coupling=equal", "run.realizations=2")
    field = mesoslip.mean_field(config)
    lives, stretch = field.lives, config.contacts.break_stretch
    births = lives.birth_stretch[lives.number > 0]
    assert births == pytest.approx(np.full(births.size, 0.1 * stretch), rel=1e-9)
    assert np.all(lives.birth_stretch[lives.number == 0] == 0)
    first = lives.break_stretch[lives.number == 0] / stretch
    assert first.size == 2 * config.contacts.count
    law = config.contacts.threshold.above(0.1)
    for threshold in (0.6, 1.0, 1.4):
        expected = float(law.survival(threshold))
        assert np.mean(first > threshold) == pytest.approx(
            expected, abs=4 * np.sqrt(expected * (1 - expected) / first.size)
        )
    equation = field.config()
    assert equation.contacts.back_force_ratio * equation.contacts.static_force == pytest.approx(
        0.1 * 18e-6, rel=2e-3
    )
    assert equation.contacts.newborn_width < 1e-9
    assert equation.contacts.threshold.relative_width == pytest.approx(0.3, rel=0.05)


def test_forces_of_scaled_contacts():
    """Equal contacts of the tables bear the force of the lattice, whose stiffnesses differ."""
    parts = []
    field = mesoslip.mean_field(lattice(0.1, "run.realizations=2"), progress=parts.append)
    assert parts == sorted(parts)
    assert parts[-1] == 1
    assert any(0.4 < one < 0.6 for one in parts)
    assert field.lives.stiffness.std() > 0.05 * field.lives.stiffness.mean()
    assert field.summary["renewal_force"][0] == pytest.approx(field.settled_force, rel=0.01)


def test_steady_force_of_the_master_equation(strong):
    """That of the lattice, by the renewal formula and by the equation."""
    force = strong.settled_force / 18e-6
    assert strong.summary["renewal_force"][0] / 18e-6 == pytest.approx(force, rel=0.01)
    displacement, run = slow(strong.config(STEADY), 6)
    assert run[displacement > 4].mean() == pytest.approx(force, rel=0.01)


def test_first_peak(strong):
    """Tables of the first loading give the peak of a relaxed start; those of steady sliding, of
    other neighbours, do not."""
    displacement, force = slow(strong.lattice.replace({"run.realizations": 4}), 1)
    first, steady = (slow(strong.config(one), 1)[1].max() for one in (FIRST, STEADY))
    # On a small lattice the avalanche that spans it starts late.
    assert first == pytest.approx(force.max(), rel=0.1)
    assert steady < 0.85 * force.max()
    assert displacement[-1] == pytest.approx(1)


def test_interaction_makes_the_thresholds_narrower():
    widths = [
        mesoslip.mean_field(lattice(one, "contacts.coupling=equal")).summary
        for one in (0.03, 0.1, 0.3)
    ]
    absolute = [one["mean_break_stretch"][0] * one["break_stretch_width"][0] for one in widths]
    assert absolute[0] > absolute[1] > absolute[2]
    assert all(abs(one["correlation"][0]) < 0.2 for one in widths)


def test_files(strong, tmp_path):
    """A written configuration is the same as that in memory; its table has both densities."""
    path, table = strong.write(tmp_path / "field.toml", FIRST)
    written, expected = Config.load(path), strong.config(FIRST)
    widths = [one.contacts.threshold.relative_width for one in (written, expected)]
    assert widths[0] == pytest.approx(widths[1])
    assert written.contacts.static_force == expected.contacts.static_force
    assert written.interaction is None
    columns = np.genfromtxt(table, delimiter=",", names=True)
    births = strong.config(FIRST).contacts
    assert columns["weight"].sum() == pytest.approx(1)
    assert np.average(columns["threshold"], weights=columns["newborn_weight"]) == pytest.approx(
        births.back_force_ratio, abs=0.005
    )


def test_command(command, tmp_path):
    changes = [part for one in SMALL for part in ("--set", one)]
    out = tmp_path / "field.toml"
    printed = command.output("mean-field", LATTICE, *changes, "-o", out)
    assert "mean stretch at breaking" in printed
    assert Config.load(out).run.engine == "me"
    _, printed, _ = command("mean-field", LATTICE, *changes, "--json")
    assert 0 < json.loads(printed)["break_stretch_width"] < 0.3


@pytest.mark.parametrize(
    ("config", "output", "words"),
    [
        (LATTICE, "field.nc", ["field.nc", "must end in .toml"]),
        (ROOT / "runs" / "klein.toml", "field.toml", ["interaction", "needed"]),
    ],
)
def test_mistakes(command, tmp_path, config, output, words):
    changes = [part for one in SMALL for part in ("--set", one)] if config == LATTICE else []
    errors = command.refusal("mean-field", config, *changes, "-o", tmp_path / output)
    assert all(word in errors for word in words)


def test_too_few_lives():
    tiny = lattice(0.1, "interaction.columns=4", "interaction.rows=4", "contacts.count=16")
    with pytest.raises(mesoslip.RunError, match="a table needs 1000"):
        mesoslip.mean_field(tiny)
