"""The functions of the package: names, what they take, and errors."""

from __future__ import annotations

import subprocess
import sys

import mesoslip
import pytest
import xarray as xr
from conftest import klein_tables
from mesoslip import MesoslipError

SHORT = {"run__duration": 3.0, "contacts__count": 100, "run__realizations": 2}
FUNCTIONS_OF_CONFIGURATIONS = ("run", "derived", "curve", "onset", "mean_field", "sweep")
FUNCTIONS_OF_OUTPUTS = (
    "open_output",
    "slips",
    "avalanches",
    "avalanche_summary",
    "regime",
    "response",
    "plot",
)


def test_every_name_is_there():
    assert "run" in mesoslip.__all__
    for name in mesoslip.__all__:
        assert name in dir(mesoslip)
        assert getattr(mesoslip, name).__name__ == name
    with pytest.raises(AttributeError):
        _ = mesoslip.group


def test_import_is_lazy():
    program = (
        "import sys, mesoslip; assert 'numpy' not in sys.modules; "
        "mesoslip.ConfigError; assert 'numpy' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", program], check=True)


@pytest.mark.parametrize("name", FUNCTIONS_OF_CONFIGURATIONS)
@pytest.mark.parametrize("wrong", [None, 5, 1.5, ["klein.toml"], xr.Dataset(), object])
def test_no_configuration(name, wrong):
    with pytest.raises(MesoslipError):
        getattr(mesoslip, name)(wrong)


@pytest.mark.parametrize("name", FUNCTIONS_OF_OUTPUTS)
@pytest.mark.parametrize("wrong", [None, 5, 1.5, {}, xr.Dataset(), xr.DataTree(), object])
def test_no_output(name, wrong):
    with pytest.raises(MesoslipError):
        getattr(mesoslip, name)(wrong)


@pytest.mark.parametrize("wrong", [5, None, ["klein.toml"]])
def test_no_path(tmp_path, wrong):
    for function in (mesoslip.read_trace, mesoslip.Config.load, mesoslip.example):
        with pytest.raises(MesoslipError):
            function(wrong)
    with pytest.raises(MesoslipError):
        mesoslip.fit(tmp_path / "none.nc", wrong)
    with pytest.raises(MesoslipError):
        mesoslip.report(tmp_path / "none.nc", wrong)


def test_catalogues_group_by_realization():
    slips = mesoslip.slips(mesoslip.run(klein_tables(**SHORT)))
    groups = dict(iter(slips.groupby("realization_index")))
    assert set(groups) == {0, 1}
    assert sum(one.sizes["slip"] for one in groups.values()) == slips.sizes["slip"]
    means = slips.groupby("realization_index").mean()
    assert means["force_drop"].sel(realization_index=1) == groups[1]["force_drop"].mean()
