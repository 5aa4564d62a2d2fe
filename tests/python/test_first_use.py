"""Measured stick-slip in any unit, direction and time, from the file to the picture."""

import json
from dataclasses import dataclass

import mesoslip
import numpy as np
import pytest
from conftest import long
from mesoslip.analysis.regime.result import IRREGULAR, STICK_SLIP

TEETH = 30


@dataclass(frozen=True)
class Laboratory:
    """How a laboratory writes the same experiment."""

    header: str
    size: float = 1.0  # of the column, for a newton
    rate: float = 1.0  # of the drive, and of the sampling
    sign: int = 1
    stiffness: str = "500 N/m"
    unit: float = 1.0  # of the output, for a newton


LABORATORIES = {
    "newtons": Laboratory("force [N]"),
    "millinewtons": Laboratory("Shear_Force (mN)", 1e3),
    "reversed": Laboratory("force [N]", sign=-1),
    "coefficients": Laboratory("mu", 0.5, stiffness="2.5e-4 1/um", unit=0.5),
    "ten times as fast": Laboratory("force [N]", rate=10.0),
}


def write(path, laboratory, wander=0.0):
    """A sawtooth of 30 teeth with noise and impulses, loaded by 500 N/m at 100 um/s."""
    rng = np.random.default_rng(1)
    time = 2e-3 * np.arange(500 * TEETH)
    force = 1.0 + np.interp(time % 1.0, [0, 0.98, 1.0], [0.0, 0.049, 0.0])
    force += wander * np.sin(2 * np.pi * time / time[-1])
    force += 5e-4 * rng.standard_normal(time.size)
    at = rng.choice(np.arange(50, time.size - 50, 25), 60, replace=False)
    force[at] += 0.03 * rng.choice([-1, 1], at.size)
    rows = np.column_stack([time / laboratory.rate, laboratory.sign * laboratory.size * force])
    np.savetxt(
        path,
        rows,
        "%.9g",
        ",",
        header=f"time [s],{laboratory.header}",
        comments="",
        encoding="utf-8",
    )
    return path


@pytest.mark.parametrize("laboratory", LABORATORIES.values(), ids=LABORATORIES)
def test_the_same_slips_however_they_are_written(tmp_path, laboratory):
    tree = mesoslip.read_trace(
        write(tmp_path / "teeth.csv", laboratory),
        velocity=laboratory.sign * laboratory.rate * 1e-4,
        stiffness=laboratory.stiffness,
    )
    slips = mesoslip.slips(tree)
    assert slips.sizes["slip"] == TEETH - 1 or slips.sizes["slip"] == TEETH
    drop = np.median(slips["force_drop"]) / laboratory.unit
    assert laboratory.sign * drop == pytest.approx(0.049, rel=0.04)
    assert np.median(slips["loading_stiffness"][1:]) / laboratory.unit == pytest.approx(
        500, rel=0.01
    )
    assert np.median(slips["waiting_time"][1:]) * laboratory.rate == pytest.approx(1, rel=0.01)
    found = mesoslip.regime(tree)
    assert found["regime"] == STICK_SLIP
    # No static force is known.
    assert found["relative_amplitude"].attrs["long_name"].endswith("over the maximum force")
    assert found["period"] * laboratory.rate == pytest.approx(1, rel=0.01)
    # Impulses would be 15 mm/s in one to two samples of a hundred; those in slips remain.
    speed = laboratory.sign * tree["velocity"].values[0] / laboratory.rate
    assert np.mean(np.abs(speed) > 8e-3) < 1e-3


def test_slips_are_the_cycles_where_the_strength_wanders(tmp_path):
    """By more than slips are deep: the percentiles of the force say little."""
    path = write(tmp_path / "wander.csv", LABORATORIES["newtons"], wander=0.15)
    found = mesoslip.regime(mesoslip.read_trace(path, velocity=1e-4, stiffness="500 N/m"))
    assert found["regime"].item() in {STICK_SLIP, IRREGULAR}
    assert found["cycles"] >= TEETH / 2 - 2
    assert found["period"] == pytest.approx(1, rel=0.02)


@pytest.mark.usefixtures("quick_pictures")
@pytest.mark.parametrize("name", [long("newtons"), "coefficients"])
def test_commands_from_the_file_to_the_page(tmp_path, command, monkeypatch, name):
    monkeypatch.chdir(tmp_path)
    laboratory = LABORATORIES[name]
    write(tmp_path / "teeth.csv", laboratory)
    options = ["--velocity", "100 um/s", "--stiffness", laboratory.stiffness]
    assert command("trace", "teeth.csv", *options)[0] == 0
    printed = command.output("regime", "out/teeth.nc")
    assert "% of the maximum force" in printed
    assert "static force" not in printed
    printed = command.output("slips", "out/teeth.nc")
    heads = printed.splitlines()[0]
    assert ("friction drop" in heads) == (name == "coefficients")
    assert len(heads) < 140
    assert "creep share" in heads
    assert "realization" not in heads
    columns = json.loads(command("slips", "out/teeth.nc", "--json")[1])["slips"][1]
    assert {"loading_stiffness", "stick_duration", "realization_index"} <= columns.keys()
    assert command("plot", "out/teeth.nc", "-o", "teeth.png")[0] == 0
    assert command("report", "out/teeth.nc", "-o", "teeth.html")[0] == 0
    page = (tmp_path / "teeth.html").read_text(encoding="utf-8")
    assert "creep share" in page
    assert ("friction drop" in page) == (name == "coefficients")


def test_a_short_trace_at_a_late_time_has_its_own_unit(tmp_path):
    path = tmp_path / "late.csv"
    time = 11_600 + 0.1 * np.arange(1000)
    teeth = 1 + np.interp(time % 6.3, [0, 5.8, 6.3], [0, 2e-3, 0])
    np.savetxt(path, np.column_stack([time, teeth]), "%.6f", ",", header="t [s],mu")
    figure = mesoslip.plot(mesoslip.read_trace(path))
    labels = [one.get_xlabel() for one in figure.axes if one.get_xlabel()]
    assert "time (s)" in labels
    # The start of the close-up is in the unit of the axis at left.
    assert any(one.startswith("time after 116") for one in labels)
    assert not any(" h" in one for one in labels)


def test_minimum_fall_and_part_are_options(tmp_path, command, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write(tmp_path / "teeth.csv", LABORATORIES["newtons"])
    options = ["--velocity", "100 um/s", "--min-fall", "80 mN"]
    assert command("trace", "teeth.csv", *options)[0] == 0
    tree = mesoslip.open_output("out/teeth.nc")
    assert tree.attrs["min_fall"] == pytest.approx(0.08)
    assert tree["slips"].sizes["slip"] == 0
    with pytest.raises(mesoslip.ConfigError, match="--min-fall"):
        mesoslip.read_trace(
            write(tmp_path / "mu.csv", LABORATORIES["coefficients"]), min_fall="1 N"
        )
    lines = (tmp_path / "teeth.csv").read_text().splitlines()
    values = [line.split(",")[1] for line in lines[9001:13001]]
    again = [f"{2e-3 * row:.6f},{value}" for row, value in enumerate(values)]
    (tmp_path / "twice.csv").write_text("\n".join([*lines[:9001], *again]))
    for part, samples in ((None, 9000), (1, 9000), (2, 4000)):
        tree = mesoslip.read_trace(tmp_path / "twice.csv", part=part)
        assert tree.sizes["time"] == samples
    assert command("trace", "twice.csv", "--part", "2", "--dry-run")[0] == 0
