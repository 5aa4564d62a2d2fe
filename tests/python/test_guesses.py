"""Each guess about a file, where it is wrong: it is printed, and one option overrules it."""

import mesoslip
import numpy as np
import pytest
from mesoslip.analysis.strokes.catalogue import strokes_of
from mesoslip.measured.understanding import understand

COUNT = 40
TIME = [f"{0.1 * n:.1f}" for n in range(COUNT)]
FORCE = [f"{2 + 0.5 * (n % 7)}" for n in range(COUNT)]
PATH = [f"{0.2 * n + 0.1 * (n % 3):.1f}" for n in range(COUNT)]


def file_of(path, header, *columns):
    rows = [",".join(row) for row in zip(*columns, strict=True)]
    path.write_text("\n".join([header, *rows, ""]), encoding="utf-8")
    return path


WRONG = {
    "the unit of the time": (
        ("time,force [N]", TIME, FORCE),
        "guess: 'time' has no unit: taken as seconds",
        {"headers": "time [ms], force [N]"},
        lambda guessed, right: guessed.time[-1] == pytest.approx(1e3 * right.time[-1]),
    ),
    "a weight": (
        ("time [s],force [g]", TIME, FORCE),
        "guess: 'force [g]': g taken as a weight, 0.00980665 N each",
        {"headers": "time [s], force [mN]"},
        lambda guessed, right: guessed.force[0] == pytest.approx(9.80665 * right.force[0]),
    ),
    "a force that is none over a normal force": (
        ("time [s],F/N", TIME, FORCE),
        "guess: 'F/N' taken as force over normal force, not as newtons",
        {"headers": "time [s], force [N]"},
        lambda guessed, right: guessed.is_friction and not right.is_friction,
    ),
    "a load beside a friction that pulls": (
        ("time [s],friction,load [N]", TIME, PATH, FORCE),
        "guess: 'load [N]' taken as the normal force, beside another force",
        {"headers": "time [s], -, force [N]"},
        lambda guessed, right: guessed.mean_normal_force and right.mean_normal_force is None,
    ),
    "whose displacement it is": (
        ("time [s],force [N],displacement [mm]", TIME, FORCE, PATH),
        "guess: 'displacement [mm]' taken as the displacement of the load point (drive)",
        {"headers": "time [s], force [N], displacement [mm]"},
        lambda guessed, right: guessed.load_point is not None and right.displacement is not None,
    ),
    "a number far from all others that is one": (
        ("time [s],force [N]", TIME, [*FORCE[:-1], "-999"]),
        "guess: column 'force [N]': -999 taken as missing in 1 lines: 41 (--missing)",
        {"missing": "none"},
        lambda guessed, right: right.force.size == guessed.force.size + 1,
    ),
    "a number near the others that is missing": (
        ("time [s],force [N]", TIME, [f"{-100 - n}" for n in range(COUNT - 1)] + ["-99.99"]),
        "guess: column 'force [N]': -99.99 on line 41 is used as a number (--missing)",
        {"missing": "-99.99, 0"},
        lambda guessed, right: right.force.size == guessed.force.size - 1,
    ),
    "rounded times of samples that follow each other otherwise": (
        ("time [s],force [N]", [str(n // 4) for n in range(COUNT)], FORCE),
        "guess: times are rounded to 1 s, with up to 4 samples to each; they are spread evenly",
        {"headers": "-, force [N]", "rate": "10 Hz"},
        lambda guessed, right: (guessed.time[-1], right.time[-1]) == (9.75, 3.9),
    ),
    "the part of a file": (
        ("time [s],force [N]", TIME[:15] + TIME[: COUNT - 15], FORCE),
        "guess: the clock starts again: 2 parts (1 lines 2 to 16; 2 lines 17 to 41); part 2",
        {"part": 1},
        lambda guessed, right: (guessed.time.size, right.time.size) == (25, 15),
    ),
    "samples even in time along the path of the load point": (
        ("piezo position [nm],force [N]", PATH, FORCE),
        "guess: samples are even in time, at 10 Hz, as the load point moves by 7.8 nm at 2 nm/s",
        {"rate": "20 Hz"},
        lambda guessed, right: guessed.time[-1] == pytest.approx(3.9) == 2 * right.time[-1],
    ),
}
# Options that a file needs to be read at all.
NEEDED = {"samples even in time along the path of the load point": {"velocity": "2 nm/s"}}


@pytest.mark.parametrize("name", WRONG)
def test_a_wrong_guess_is_printed_and_overruled(name, tmp_path):
    columns, text, options, is_right = WRONG[name]
    path = file_of(tmp_path / "a.csv", *columns)
    needed = NEEDED.get(name, {})
    guessed = understand(path, **needed).record
    right = understand(path, **needed, **options).record
    assert any(line.startswith(text) for line in guessed.report), guessed.report
    assert not any("guess:" in line for line in right.report), right.report
    assert is_right(guessed, right)


def test_missing_numbers_of_a_description_are_numbers(tmp_path):
    path = file_of(tmp_path / "a.csv", "time [s],force [N]", TIME, ["7.5", *FORCE[1:]])
    assert understand(path, missing=7.5).record.force.size == COUNT - 1
    with pytest.raises(mesoslip.ConfigError, match="--missing = '0;1': must be numbers between"):
        understand(path, missing="0;1")


def test_missing_numbers_are_left_out_of_thinned_files(tmp_path):
    rows = np.arange(4000)
    force = np.where(rows == 2000, 7.25, 2 + 0.01 * (rows % 3))
    path = file_of(
        tmp_path / "a.csv",
        "time [s],force [N]",
        *([f"{one:.3f}" for one in x] for x in (rows / 1e3, force)),
    )
    used, left_out = (
        understand(path, rate="100 Hz", **options).record.force
        for options in ({}, {"missing": 7.25})
    )
    assert np.nanmax(used) > 2.1
    assert np.nanmax(left_out) < 2.05


def test_a_guess_about_a_part_of_a_test_begins_as_one(tmp_path):
    paths = [
        file_of(tmp_path / f"{name}.csv", "time,force [N]", TIME, ["-999", *FORCE[1:]])
        for name in "ab"
    ]
    lines = understand(paths).record.report
    assert "guess: the clock of b.csv starts again: its times follow those of a.csv" in lines


def test_the_direction_of_a_force_in_strokes_is_overruled(tmp_path):
    """The load point of elastic strokes may be recorded with a delay, so that loops gain energy."""
    phase = np.arange(2000) / 200
    x, force = np.sin(2 * np.pi * phase), np.sin(2 * np.pi * (phase - 0.02))
    path = file_of(
        tmp_path / "a.csv",
        "time [s],force [N],load point [mm]",
        *([f"{one:.5f}" for one in row] for row in (phase, force, x)),
    )
    guessed, right = (
        strokes_of(mesoslip.read_trace(path, **options))
        for options in ({}, {"force_direction": "along"})
    )
    text = "guess: the force is against the motion"
    assert any(one.startswith(text) for one in guessed.notes)
    assert not any("guess" in one for one in right.notes)
    assert guessed.overall["loop_energy"].mean == -right.overall["loop_energy"].mean > 0
