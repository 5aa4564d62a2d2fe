"""Runs against reference outputs; another compiler may change the last digits, not more."""

from __future__ import annotations

import mesoslip
import numpy as np
import pytest
from make_reference import CASES, FOLDER


@pytest.mark.parametrize("name", CASES)
def test_outputs_are_those_of_the_reference(name):
    expected, actual = mesoslip.read(FOLDER / f"{name}.nc"), mesoslip.run(CASES[name])
    np.testing.assert_allclose(actual["breaks"].values, expected["breaks"].values, rtol=1e-9)
    scales = {
        "drive_displacement": 1e-7,
        "displacement": 1e-7,
        "velocity": 1e-5,
        "spring_force": 18e-6,
        "contact_force": 18e-6,
        "detached_contacts": 1e6,
    }
    for variable, scale in scales.items():
        np.testing.assert_allclose(
            actual[variable].values, expected[variable].values, rtol=0, atol=1e-6 * scale
        )
    for group in ("slips", "energy"):
        for variable, values in expected[group].data_vars.items():
            np.testing.assert_allclose(
                actual.children[group][variable].values, values.values, rtol=1e-6, err_msg=variable
            )
