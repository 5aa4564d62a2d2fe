"""The examples of measured files: the numbers of the page "From your rig to a table"."""

import mesoslip
import numpy as np
import pytest
from conftest import ROOT
from mesoslip.analysis.strokes.catalogue import strokes_of

MEASURED = ROOT / "runs" / "measured"


def test_pin_on_disc():
    """Coefficient as the instrument computed it; revolutions as it counted them."""
    tree = mesoslip.read_trace(MEASURED / "pin-on-disc.toml")
    recorded = tree["recorded"]["Friction_Coefficient"].values
    computed = tree["friction_coefficient"].values[0]
    # The instrument rounds the force to 0.1 N of some 14 N.
    assert np.abs(computed - recorded[: computed.size]).max() < 1.5e-3
    found = strokes_of(tree).overall["mean_friction_coefficient"]
    assert found.mean == pytest.approx(0.14423, abs=2e-5)
    assert found.error == pytest.approx(0.00019, abs=2e-5)
    assert tree["slips"].sizes["slip"] == 0


def test_reciprocating():
    """No slips; the loop by a polygon of the samples."""
    tree = mesoslip.read_trace(MEASURED / "reciprocating.toml")
    assert tree["slips"].sizes["slip"] == 0
    found = strokes_of(tree)
    assert found.overall["mean_friction_coefficient"].mean == pytest.approx(0.462, abs=1e-4)
    start, end = (found.columns["cycles"][one][5] for one in ("start_time", "end_time"))
    inside = (tree["time"].values >= start) & (tree["time"].values <= end)
    x, y = (tree[one].values[0][inside] for one in ("drive_displacement", "spring_force"))
    area = abs(float(np.sum(0.5 * (y + np.roll(y, -1)) * (np.roll(x, -1) - x))))
    assert found.columns["cycles"]["loop_energy"][5] == pytest.approx(area, rel=1e-3)
    steady = mesoslip.response(tree)["steady"]
    assert steady["steady_force"].values == pytest.approx(found.overall["mean_friction"].mean)
    assert "mesoslip strokes" in steady["note"].item()


def test_stribeck():
    """Coefficients as they were made, within their errors."""
    found = mesoslip.plateaus(mesoslip.read_trace(MEASURED / "stribeck.toml"))
    speed = found["sliding_speed"].values
    made = 0.13 * np.exp(-speed / 0.06) + 0.012 + 0.011 * speed
    value, error = (found[f"mean_friction_coefficient{one}"].values for one in ("", "_error"))
    assert value.size == 14
    assert (np.abs(value - made) < 4 * error).all()
    assert value[0] == pytest.approx(0.13778, abs=1e-5)
    assert found["hersey_number"].values[-1] == pytest.approx(0.009001, rel=1e-3)
