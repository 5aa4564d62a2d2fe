"""Outputs in the hands of other programs: a checker of CF, ArviZ, Zarr, ObsPy."""

import io
import json
import subprocess
import sys
from pathlib import Path

import mesoslip
import numpy as np
import pytest
import xarray as xr

ROOT = Path(__file__).parents[2]
RUNS = ROOT / "runs"
SMALL = {"run.duration": "4 s", "contacts.count": 150, "contacts.threshold.relative_width": 0.05}
# What the checker reports of outputs that are as CF has them: section of CF, and a part of the
# message.
ACCEPTED = (
    # Times since the start of a run have no calendar, and CF's name "time" is for dates.
    ("§5.1", "Coordinate variable 'time' should have standard_name='time'"),
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Outputs of each command, as files."""
    place = tmp_path_factory.mktemp("formats")
    config = mesoslip.Config.load(RUNS / "klein.toml").replace(SMALL)
    noisy = mesoslip.run(config)
    rng = np.random.default_rng(5)
    noisy["spring_force"] = noisy["spring_force"] + 5e-8 * rng.standard_normal(
        noisy["spring_force"].shape
    )
    fit = {
        "free": {"contacts.delay": {"from": "0.2 ms", "to": "4 ms", "prior": "logarithmic"}},
        "simulations": 300,
        "noise": 5e-8,
    }
    (place / "small.toml").write_text(config.to_toml())
    commands = [
        ("run", "small.toml", "-o", "run.nc", "--quiet"),
        ("run", RUNS / "avalanche.toml", "-o", "lattice.nc", "--quiet"),
        ("curve", "small.toml", "-o", "curve.nc"),
        ("onset", "small.toml", "-o", "onset.nc"),
    ]
    for words in commands:
        program = [sys.executable, "-m", "mesoslip", *map(str, words)]
        subprocess.run(program, cwd=place, check=True, capture_output=True)
    mesoslip.fit(noisy, {**config.to_dict(), "fit": fit}, executor=2).to_netcdf(place / "fit.nc")
    return place


@pytest.mark.parametrize("name", ["run", "lattice", "curve", "onset", "fit"])
def test_the_checker_of_cf_finds_nothing(folder, name):
    """That of IOOS, for the version of CF that outputs state."""
    from compliance_checker.runner import CheckSuite, ComplianceChecker

    CheckSuite.load_all_available_checkers()
    report = folder / f"{name}.json"
    assert "CF-1.11" in mesoslip.open_output(folder / f"{name}.nc").attrs["Conventions"]
    ComplianceChecker.run_checker(
        str(folder / f"{name}.nc"),
        ["cf:1.11"],
        verbose=0,
        criteria="normal",
        output_filename=str(report),
        output_format="json",
    )
    (result,) = json.loads(report.read_text()).values()
    messages = [
        (one["name"], text)
        for priority in ("high_priorities", "medium_priorities", "low_priorities")
        for one in result[priority]
        for text in one["msgs"]
    ]
    found = [
        (section, text)
        for section, text in messages
        if not any(section.startswith(where) and part in text for where, part in ACCEPTED)
    ]
    assert found == []
    assert result["scored_points"] > 0


@pytest.mark.filterwarnings("ignore::FutureWarning", "ignore::UserWarning")
def test_arviz_reads_a_posterior(folder):
    import arviz

    data = arviz.from_netcdf(folder / "fit.nc")
    assert {"posterior", "prior", "observed_data", "posterior_predictive"} <= set(data.groups())
    tree = mesoslip.open_output(folder / "fit.nc")
    draws = tree["posterior/contacts.delay"]
    assert draws.dims == ("chain", "draw")
    summary = arviz.summary(data, round_to="none")
    row = summary.loc["contacts.delay"]
    assert row["mean"] == pytest.approx(float(draws.mean()), rel=1e-12)
    assert row["sd"] == pytest.approx(float(draws.std(ddof=1)), rel=1e-3)
    assert row["r_hat"] < 1.05
    assert row["ess_bulk"] > 400
    # The predicted force has the dimensions that ArviZ compares with the observed one.
    predicted = data.posterior_predictive["spring_force"]
    assert predicted.dims[:2] == ("chain", "draw")
    assert predicted.dims[2:] == data.observed_data["spring_force"].dims


@pytest.mark.parametrize("name", ["run", "lattice", "curve", "fit"])
def test_zarr_has_all_of_an_output(folder, tmp_path, name):
    tree = mesoslip.open_output(folder / f"{name}.nc")
    path = tmp_path / f"{name}.zarr"
    for _ in range(2):
        # A store that is there is replaced.
        mesoslip.export(folder / f"{name}.nc", path)
    read = xr.open_datatree(path, engine="zarr").load()
    assert read.identical(tree)
    if name == "run":
        assert mesoslip.slips(read).identical(mesoslip.slips(tree))
    assert [one.name for one in tmp_path.iterdir()] == [path.name]


def test_a_folder_that_is_no_store_stays(folder, tmp_path):
    place = tmp_path / "mine.zarr"
    place.mkdir()
    (place / "data").write_text("mine")
    with pytest.raises(mesoslip.FileError, match="is not a Zarr store"):
        mesoslip.export(folder / "run.nc", place)
    assert (place / "data").read_text() == "mine"
    with pytest.raises(mesoslip.FileError, match=r"\.zarr \(Zarr\) or \.xml"):
        mesoslip.export(folder / "run.nc", tmp_path / "run.csv")


@pytest.mark.filterwarnings("ignore")
def test_obspy_reads_the_slips(folder, tmp_path):
    import obspy
    from obspy.io.quakeml.core import _validate

    path = tmp_path / "run.xml"
    mesoslip.export(folder / "run.nc", path)
    assert _validate(io.BytesIO(path.read_bytes()))
    catalogue = obspy.read_events(path)
    slips = mesoslip.slips(folder / "run.nc")
    assert len(catalogue) == slips.sizes["slip"] > 1
    epoch = obspy.UTCDateTime(0)
    starts = [event.preferred_origin().time - epoch for event in catalogue]
    assert starts == pytest.approx(slips["start_time"].values.tolist(), abs=1e-6)
    for name in ("force_drop", "peak_velocity", "duration"):
        values = [
            one.generic_amplitude
            for event in catalogue
            for one in event.amplitudes
            if one.resource_id.id.endswith(name)
        ]
        assert values == pytest.approx(slips[name].values.tolist(), rel=1e-6)
    # Made again it is the same.
    mesoslip.export(folder / "run.nc", tmp_path / "again.xml")
    assert (tmp_path / "again.xml").read_bytes() == path.read_bytes()
