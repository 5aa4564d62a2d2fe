"""The functions of the package: names, what they take, and errors."""

import math

import mesoslip
import numpy as np
import pytest
import xarray as xr
from conftest import klein_tables, python
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
    python(
        "import sys, mesoslip; assert 'numpy' not in sys.modules; "
        "mesoslip.ConfigError; assert 'numpy' not in sys.modules"
    )


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


CONFIG = mesoslip.Config.from_dict(klein_tables(**SHORT))
LAW = mesoslip.ThresholdLaw("gaussian", 0.1)
ARGUMENTS = {
    "text": mesoslip.Config.from_toml,
    "tables": mesoslip.Config.from_dict,
    "overrides": lambda wrong: mesoslip.Config.from_toml(CONFIG.to_toml(), overrides=wrong),
    "changes": CONFIG.replace,
    "tolerance": lambda wrong: mesoslip.cycle(CONFIG, tolerance=wrong),
    "max_cycles": lambda wrong: mesoslip.cycle(CONFIG, max_cycles=wrong),
    "progress": lambda wrong: mesoslip.run(CONFIG, progress=wrong),
    "values": lambda wrong: mesoslip.branches(CONFIG, "contacts.delay", wrong),
    "posteriors": mesoslip.compare_fits,
    "config": mesoslip.SteadySliding,
    "velocity": lambda wrong: mesoslip.SteadySliding(CONFIG, wrong),
    "relative_width": lambda wrong: mesoslip.SteadySliding(CONFIG, relative_width=wrong),
    "number": lambda wrong: mesoslip.Realization(CONFIG, wrong),
    "resolution": lambda wrong: mesoslip.Realization(CONFIG, resolution=wrong),
    "time": lambda wrong: mesoslip.Realization(CONFIG).advance_to(wrong),
    "law": lambda wrong: mesoslip.ThresholdLaw(wrong, 0.1),
    "minimum": lambda wrong: mesoslip.ThresholdLaw("gaussian", 0.1, wrong),
    "samples": lambda wrong: mesoslip.ThresholdLaw("table", 0.1, samples=wrong),
    "probability": LAW.quantile,
    "threshold": LAW.density,
    "twins": lambda wrong: mesoslip.lyapunov(CONFIG, twins=wrong),
    "cluster": mesoslip.Dask,
    "update": lambda wrong: CONFIG.model_copy(update=wrong),
    "deep": lambda wrong: CONFIG.model_copy(deep=wrong),
    "rate": lambda wrong: mesoslip.SteadySliding(CONFIG).response_at(wrong),
    "fit": lambda wrong: mesoslip.response("none.nc", fit=wrong),
    "saved": lambda wrong: mesoslip.Realization(CONFIG).restore(wrong, {}),
    "find_multipliers": lambda wrong: mesoslip.cycle(CONFIG, find_multipliers=wrong),
    "estimates_errors": lambda wrong: mesoslip.Realization(CONFIG, estimates_errors=wrong),
    "laws": lambda wrong: mesoslip.response_posterior("none.nc", laws=wrong),
    "letters": lambda wrong: mesoslip.plot("none.nc", letters=wrong),
    "view": lambda wrong: mesoslip.plot("none.nc", view=wrong),
    "title": lambda wrong: mesoslip.plot("none.nc", title=wrong),
    "x": lambda wrong: mesoslip.plot("none.nc", x=wrong),
    "table": lambda wrong: mesoslip.Realization(CONFIG).table(wrong),
}
# Those for which a value that is wrong elsewhere is right.
RIGHT = {
    *(("tables", dict), ("changes", dict), ("update", dict), ("rate", complex)),
    *((name, np.ndarray) for name in ("overrides", "probability", "threshold", "rate", "laws")),
}


@pytest.mark.parametrize("name", ARGUMENTS)
@pytest.mark.parametrize("wrong", [10**400, 1j, {5: object}, object(), np.array([])], ids=type)
def test_wrong_arguments_are_named(name, wrong):
    if (name, type(wrong)) in RIGHT:
        return
    with pytest.raises(MesoslipError, match=name):
        ARGUMENTS[name](wrong)


@pytest.mark.parametrize("name", ["tolerance", "velocity", "relative_width", "time", "minimum"])
@pytest.mark.parametrize("wrong", [math.nan, math.inf, "1"])
def test_numbers_are_finite(name, wrong):
    with pytest.raises(MesoslipError, match=f"{name} = .*: must be a finite number"):
        ARGUMENTS[name](wrong)


@pytest.mark.parametrize("wrong", [0, math.nan, [1.0, math.inf]])
def test_rates_of_oscillations_are_finite_and_not_0(wrong):
    sliding = mesoslip.SteadySliding(CONFIG)
    with pytest.raises(MesoslipError, match=r"frequency = .*: must be finite numbers other than 0"):
        sliding.response(wrong)
    with pytest.raises(MesoslipError, match=r"rate = .*: must be finite numbers other than 0"):
        sliding.response_at(wrong)


def test_realizations_without_snapshots_have_none_of_them():
    with pytest.raises(MesoslipError, match="config = 5: must be a Config"):
        mesoslip.Realization.all_of(5)
    assert mesoslip.Realization(CONFIG).snapshots.shape == (0, 0, 3)


def test_catalogues_group_by_realization():
    slips = mesoslip.slips(mesoslip.run(klein_tables(**SHORT)))
    groups = dict(iter(slips.groupby("realization_index")))
    assert set(groups) == {0, 1}
    assert sum(one.sizes["slip"] for one in groups.values()) == slips.sizes["slip"]
    means = slips.groupby("realization_index").mean()
    assert means["force_drop"].sel(realization_index=1) == groups[1]["force_drop"].mean()
