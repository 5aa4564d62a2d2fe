"""Pictures: what they show, what they read, and how they are had without files."""

from __future__ import annotations

import threading

import matplotlib as mpl
import mesoslip
import numpy as np
import pytest
import xarray as xr
from conftest import ROOT
from matplotlib.figure import Figure
from mesoslip.plots import run as run_plots


@pytest.fixture(scope="module")
def old():
    """An output with a lattice, avalanches and snapshots."""
    return mesoslip.read(ROOT / "tests" / "reference" / "old.nc")


@pytest.mark.parametrize("view", [None, "run", "avalanches", "lattice"])
def test_a_picture_needs_no_file(old, view):
    drawn = mesoslip.plot(old, view=view)
    assert isinstance(drawn, Figure)
    assert drawn.axes
    assert isinstance(mesoslip.plot(ROOT / "tests" / "reference" / "old.nc", view=view), Figure)


@pytest.mark.parametrize("view", [None, "avalanches", "lattice"])
def test_a_picture_is_drawn_into_what_is_given(old, view):
    whole = Figure(figsize=(8, 4))
    left, right = whole.subfigures(1, 2)
    assert mesoslip.plot(old, view=view, figure=left) is left
    axes = right.subplots()
    before = len(right.axes)
    mesoslip.plot(old, view=view, ax=axes)
    assert axes.has_data()
    # A colour bar is all that may come beside it.
    assert len(right.axes) - before == (view == "lattice")


def test_pictures_of_the_theory(klein):
    for tree in (mesoslip.curve(klein()), mesoslip.onset(klein())):
        axes = Figure().subplots()
        mesoslip.plot(tree, ax=axes)
        assert axes.lines
        assert isinstance(mesoslip.plot(tree), Figure)


def test_an_unknown_view_is_told(old):
    with pytest.raises(
        mesoslip.ConfigError, match=r"foo.*choose of run, avalanches, lattice, response"
    ):
        mesoslip.plot(old, view="foo")


def many_samples(count, realizations=1):
    """An output with many samples, as far as it is drawn: a wave with one spike."""
    times = np.linspace(0, 10, count)
    force = np.sin(3 * times) * np.ones((realizations, 1))
    force[0, count // 3] = 7.0
    return xr.DataTree(
        xr.Dataset(
            {"spring_force": (("realization", "time"), force)},
            coords={"time": times, "realization": np.arange(realizations)},
        )
    )


@pytest.mark.parametrize("block", [2**20, 997])
def test_a_line_shows_the_extremes_of_many_samples(monkeypatch, block):
    """Far fewer points than samples, none of the spikes lost."""
    monkeypatch.setattr(run_plots, "BLOCK", block)
    tree = many_samples(200_000)
    axes = Figure().subplots()
    run_plots.draw_series(axes, tree, "spring_force")
    times, values = axes.lines[0].get_data()
    assert len(times) <= 2 * run_plots.MOST_PARTS
    samples, force = tree["time"].values, tree["spring_force"].values[0] * 1e6
    assert values.max() == force.max()
    assert values.min() == force.min()
    # Each pair of points is the least and greatest of the samples in its part of the time.
    edges = np.linspace(0, 10, run_plots.MOST_PARTS + 1)
    place = np.clip(np.searchsorted(edges, samples, "right") - 1, 0, run_plots.MOST_PARTS - 1)
    for part in (0, 17, run_plots.MOST_PARTS // 3, run_plots.MOST_PARTS - 1):
        inside = force[place == part]
        np.testing.assert_allclose(values[2 * part : 2 * part + 2], [inside.min(), inside.max()])
    # A window with few samples shows each.
    run_plots.draw_series(axes, tree, "spring_force", window=(1.0, 1.1))
    window = (samples >= 1.0) & (samples <= 1.1)
    np.testing.assert_array_equal(axes.lines[1].get_ydata(), force[window])


def test_what_is_not_drawn_is_not_read():
    """A variable that no picture needs is not touched, and a window only where it lies."""
    tree = many_samples(100_000)
    read = []

    class Watched(xr.backends.BackendArray):
        shape, dtype = (1, 100_000), np.dtype(float)

        def __getitem__(self, key):
            read.append(key)
            return np.zeros(self.shape)[key.tuple]

    data = tree.to_dataset()
    lazy = xr.core.indexing.LazilyIndexedArray(Watched())
    data["spring_force"] = xr.Variable(("realization", "time"), lazy)
    data["velocity"] = xr.Variable(("realization", "time"), lazy)
    run_plots.draw_series(Figure().subplots(), xr.DataTree(data), "spring_force", window=(2.0, 2.1))
    assert len(read) == 1
    places = np.arange(100_000)[read[0].tuple[-1]]
    assert len(places) < 1100


def test_pictures_on_threads_leave_the_style_of_the_session(old):
    before = dict(mpl.rcParams)
    errors = []

    def draw():
        try:
            for _ in range(3):
                mesoslip.plot(old)
        except Exception as error:
            errors.append(error)

    threads = [threading.Thread(target=draw) for _ in range(4)]
    for one in threads:
        one.start()
    for one in threads:
        one.join()
    assert not errors
    assert dict(mpl.rcParams) == before
