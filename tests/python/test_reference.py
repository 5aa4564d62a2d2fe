"""Outputs against references: a small one for each kind of run, for curves and onsets."""

import mesoslip
import numpy as np
import pytest
from conftest import klein_tables, long
from reference import (
    CASES,
    COMMON,
    CONTACTS,
    ENGINES,
    FOLDER,
    REFUSED,
    SLIDERS,
    differences,
    report,
)

# Master equations that take much time; what they combine is in other cases as well.
SLOW = {"me-rigid-newborn", "me-rigid-thermal-ageing"}


@pytest.mark.parametrize("name", [long(name) if name in SLOW else name for name in CASES])
def test_outputs_are_those_of_the_reference(name):
    printed = report(name, mesoslip.open_output(FOLDER / f"{name}.nc"), CASES[name]())
    assert not printed, printed


@pytest.mark.parametrize("refused", sorted(REFUSED))
def test_what_has_no_reference_is_refused(refused):
    engine, slider, contacts = refused
    changes = COMMON | ENGINES[engine] | SLIDERS[slider] | CONTACTS[contacts]
    with pytest.raises(mesoslip.ConfigError):
        mesoslip.Config.from_dict(klein_tables(**changes))


def test_differences_are_reported():
    """A variable that is otherwise, where and by how much; one too many; another shape."""
    name = "eq-rigid-scaled"
    expected = mesoslip.open_output(FOLDER / f"{name}.nc")
    assert differences(expected, expected) == []
    actual = expected.copy(deep=True)
    actual["spring_force"].values[0, 7] += 1e-8
    actual["extra"] = actual["spring_force"]
    actual["slips"] = expected["slips"].to_dataset(inherit=False).isel(slip=slice(0))
    printed = report(name, expected, actual)
    assert "/spring_force: 1 of 101 values differ by more than 1e-06 of" in printed
    assert "at realization 0, time 7: " in printed
    assert "/extra: only in the output" in printed
    assert "/slips/force_drop: shape (0,) instead of " in printed
    within = expected.copy(deep=True)
    within["spring_force"].values[...] *= 1 + 1e-7
    assert differences(expected, within) == []
    missing = expected.copy(deep=True)
    missing["spring_force"].values[0, 3] = np.nan
    assert [str(one) for one in differences(expected, missing)] == [
        "/spring_force: 1 values are missing, or not any more"
    ]
