"""Sweeps: their points, measures, store, and that nothing but the file decides the numbers."""

import itertools
import json
import os
import re
import sys
import textwrap
import tracemalloc
import warnings
from concurrent.futures import Future
from contextlib import nullcontext
from pathlib import Path

import matplotlib as mpl
import mesoslip
import netCDF4
import numpy as np
import pytest
import xarray as xr
from conftest import ROOT, klein_tables, long, run_program
from mesoslip import Config, ConfigError, FileError
from mesoslip.analysis.fronts import FRONT_TYPES
from mesoslip.analysis.regime.outputs import regimes
from mesoslip.analysis.regime.result import REGIME
from mesoslip.campaign.measures import MEASURES
from mesoslip.campaign.point import Outcome, combination_key, point_name
from mesoslip.campaign.sweep import groups, run_sweep, stored_body, stored_measures, task_of
from mesoslip.campaign.sweep_plan import COMBINATION_BYTES, Plan
from mesoslip.configuration.keys import key_kind
from mesoslip.configuration.messages import all_keys
from mesoslip.execution import local
from mesoslip.execution.executors import Executor, ThreadsThenProcesses
from mesoslip.execution.pool import Pool
from mesoslip.execution.stop import Stop
from mesoslip.execution.store import MANIFEST, Store

# A run of a millisecond, in which contacts break.
TINY = klein_tables(
    contacts__count=20, run__duration=0.4, drive__velocity=1e-6, contacts__threshold__law="uniform"
)
GRID = {
    "contacts.delay": ["0.1 ms", "0.5 ms"],
    "slider.stiffness": {"from": "50 N/m", "to": "200 N/m", "points": 3, "spacing": "logarithmic"},
}

# Measures of what theory says, and of an interface with a length.
PREDICTED = {
    "front_prestress",
    "steady_front_speed_ratio",
    "growth_rate",
    "stable_dephased",
    "critical_stiffness_ratio",
    "waiting_over_damping",
}
FRONTS = {"front_type", "front_speed_ratio"}


def tables(**sweep):
    """The tables of a sweep of short runs."""
    return {**TINY, "sweep": {"measures": ["mean_force", "breaks"], "grid": GRID} | sweep}


@pytest.fixture
def sweep_file(tmp_path):
    """Write the file of a sweep over a base of short runs."""
    (tmp_path / "base.toml").write_text(Config.from_dict(TINY).to_toml())

    def write(text: str, name: str = "sweep.toml") -> Path:
        path = tmp_path / name
        path.write_text('base = "base.toml"\n' + textwrap.dedent(text))
        return path

    return write


SIMPLE = """
    [sweep]
    realizations = 2
    measures = ["mean_force"]
    [sweep.grid]
    "contacts.delay" = ["0.1 ms", "0.5 ms"]
"""


def test_a_dataset_of_named_axes_in_si():
    data = mesoslip.sweep(tables(realizations=2), executor=mesoslip.Threads())
    assert data["mean_force"].dims == ("contacts.delay", "slider.stiffness", "realization")
    np.testing.assert_array_equal(data["contacts.delay"], [1e-4, 5e-4])
    np.testing.assert_allclose(data["slider.stiffness"], [50, 100, 200])
    assert data["contacts.delay"].units == "s"
    assert data["slider.stiffness"].units == "N m-1"
    assert data["mean_force"].units == "N"
    assert data["status"].flag_meanings == "ok failed missing"
    assert not data["status"].any()
    assert data.attrs["complete"] == "true"


def test_measures_are_those_of_the_run_itself():
    """Each point against a run of its own, measured here."""
    data = mesoslip.sweep(tables(realizations=2, discard=0.25), executor=mesoslip.Threads())
    tree = mesoslip.run(
        Config.from_dict(TINY).replace(
            {"contacts.delay": 5e-4, "slider.stiffness": 200.0, "run.realizations": 2}
        )
    )
    force = tree["spring_force"].sel(time=slice(0.25 * 0.4, None))
    point = data.isel({"contacts.delay": 1, "slider.stiffness": 2})
    np.testing.assert_allclose(point["mean_force"], force.mean("time"), rtol=1e-13)
    np.testing.assert_array_equal(point["breaks"], tree["breaks"])


def test_every_measure_of_a_run_with_known_slips():
    """A force made by hand: two slips of one micronewton, a second apart, after half a second."""
    times = np.linspace(0, 4, 401)
    force = np.where(times < 2, 0, 3e-6 - 1e-6 * (times % 1))
    # Over the displacement of the drive: at rest, with it, and three times as fast, in turn.
    ratio = np.array([0.0, 1.0, 3.0, 1.0])[(times * 10).astype(int) % 4]
    displacement = ratio.cumsum() * 1e-8
    root = xr.Dataset(
        {
            "spring_force": (("realization", "time"), force[np.newaxis]),
            "displacement": (("realization", "time"), displacement[np.newaxis]),
            "drive_displacement": (("realization", "time"), 1e-8 * np.arange(401.0)[np.newaxis]),
            "breaks": ("realization", [7]),
            "energy_residual": ("realization", [1e-14]),
        },
        {"time": times, "realization": [0]},
    )
    slips = xr.Dataset(
        {
            "start_time": ("slip", [1.0, 2.5, 3.5]),
            "end_time": ("slip", [1.1, 2.6, 3.6]),
            "force_before": ("slip", [9e-6, 3e-6, 5e-6]),
            "force_drop": ("slip", [9e-6, 1e-6, 2e-6]),
            "peak_velocity": ("slip", [9.0, 1.0, 2.0]),
        }
    )
    avalanches = xr.Dataset(
        {"start_time": ("avalanche", [1.0, 3.0, 3.1]), "size": ("avalanche", [100, 2, 4])}
    )
    from mesoslip.campaign.measures import RunView

    run = RunView(
        xr.DataTree.from_dict({"/": root, "/slips": slips, "/avalanches": avalanches}), 2.0
    )
    expected = {
        "mean_force": force[200:].mean(),
        "max_force": 3e-6,
        "force_amplitude": 0.495e-6,
        "mean_peak_force": 4e-6,
        "mean_force_drop": 1.5e-6,
        "mean_waiting_time": 1.0,
        "mean_slip_duration": 0.1,
        "slip_count": 2,
        "peak_velocity": 2.0,
        "smooth_time_share": 0.5,
        "breaks": 7,
        "energy_residual": 1e-14,
        "avalanche_count": 2,
        "mean_avalanche_size": 3,
        "max_avalanche_size": 4,
        "peak_variation": 1 / 4,
    }
    # What theory says, what a regime is judged by, and exponents have tests of their own.
    others = {*REGIME, *PREDICTED, *FRONTS, "lyapunov_exponent", "lyapunov_error", "map_exponent"}
    own = {name: measure for name, measure in MEASURES.items() if name not in others}
    found = {name: measure.function(run) for name, measure in own.items()}
    assert found.keys() == expected.keys()
    for name, value in expected.items():
        assert found[name] == pytest.approx(value, rel=0.02), name
    # The last slip goes back: peaks and drops are along its motion, and nothing waits for it.
    for name in ("force_before", "force_drop"):
        slips[name] = slips[name] * [1, 1, -1]
    run = RunView(xr.DataTree.from_dict({"/": root, "/slips": slips}), 2.0)
    for name in ("mean_peak_force", "mean_force_drop"):
        assert MEASURES[name].function(run) == pytest.approx(expected[name])
    assert np.isnan(MEASURES["mean_waiting_time"].function(run))


def test_regimes_are_those_of_the_run_itself(tmp_path):
    """Stick-slip with delay, smooth sliding without; choices are small numbers in a file."""
    base = klein_tables(
        contacts__count=400,
        contacts__threshold__relative_width=0.05,
        run__duration=30.0,
        output__interval=5e-3,
    )
    sweep = {"measures": ["regime", "period"], "grid": {"contacts.delay": ["0.5 ms", 0]}}
    data = mesoslip.sweep({**base, "sweep": sweep}, executor=mesoslip.Threads())
    for number, delay in enumerate((5e-4, 0.0)):
        tree = mesoslip.run(Config.from_dict(base).replace({"contacts.delay": delay}))
        expected = regimes(tree)
        assert data["regime"].values[number, 0] == expected["regime"].values[0]
        np.testing.assert_array_equal(data["period"][number], expected["period"])
    np.testing.assert_array_equal(data["regime"][:, 0], [1, 0])
    assert data["regime"].flag_meanings == "smooth stick_slip irregular transient"
    data.to_netcdf(tmp_path / "regimes.nc")
    with netCDF4.Dataset(tmp_path / "regimes.nc") as file:
        assert file["regime"].dtype == np.int8
        assert file["regime"].flag_values.dtype == np.int8
    back = xr.load_dataset(tmp_path / "regimes.nc")
    np.testing.assert_array_equal(back["regime"], data["regime"])


def test_a_map_shows_each_value_where_it_belongs(tmp_path):
    """Also of values in any order, and of choices the most frequent one."""
    delays, stiffnesses = [2e-3, 1e-4, 5e-4], [200.0, 50.0]
    force = np.arange(12.0).reshape(3, 2, 2)
    regime = np.array([[[0, 0], [1, 1]], [[2, 2], [3, np.nan]], [[np.nan, np.nan], [1, 1]]])
    dimensions = ("contacts.delay", "slider.stiffness", "realization")
    flags = {"flag_meanings": "smooth stick_slip irregular transient"}
    data = xr.Dataset(
        {
            "status": (dimensions, np.zeros((3, 2, 2))),
            "mean_force": (dimensions, force, {"units": "N"}),
            "regime": (dimensions, regime, flags),
        },
        {"contacts.delay": delays, "slider.stiffness": stiffnesses, "realization": [0, 1]},
        {"configuration": ""},
    )
    figure = mesoslip.plot(data, tmp_path / "map.png")
    title = figure.legends[0].get_title().get_text()
    assert title == "mean or most frequent of 2 realizations"
    maps = panels_of(figure)
    for axes, expected in zip(maps, (force.mean(-1), regime[..., 0]), strict=True):
        mesh = axes.collections[0]
        corners = mesh.get_coordinates()
        shown = mesh.get_array().reshape(2, 3).filled(np.nan)
        for row, column in np.ndindex(2, 3):
            (left, low), (right, high) = corners[row, column], corners[row + 1, column + 1]
            (i,) = np.flatnonzero((left < np.array(delays)) & (np.array(delays) < right))
            (j,) = np.flatnonzero((low < np.array(stiffnesses)) & (np.array(stiffnesses) < high))
            np.testing.assert_equal(shown[row, column], expected[i, j])
    line = mesoslip.plot(xr.DataTree(data.isel({"slider.stiffness": 1})))
    (means,) = (one.lines[0] for one in line.axes[0].containers)
    np.testing.assert_array_equal(means.get_xdata(), sorted(delays))
    np.testing.assert_array_equal(means.get_ydata(), [6.5, 10.5, 2.5])


def panels_of(figure):
    """The panels of a picture of a sweep, without colour bars."""
    return [one for one in figure.axes if one.get_label() != "<colorbar>"]


def test_points_over_a_key_have_errors_and_only_rows_that_occur():
    """The mean with its standard error; a choice that never occurs has no row."""
    dimensions = ("contacts.delay", "realization")
    period = np.array([[1.0, 2.0, 3.0], [4.0, 4.0, 4.0], [5.0, 9.0, np.nan], [7.0, 8.0, 9.0]])
    regime = np.array([[1, 1, 1], [0, 0, 1], [3, 3, 3], [1, 1, 3]])
    flags = {"flag_meanings": "smooth stick_slip irregular transient"}
    data = xr.Dataset(
        {
            "status": (dimensions, np.zeros((4, 3))),
            "regime": (dimensions, regime, flags),
            "period": (dimensions, period, {"units": "s"}),
        },
        {"contacts.delay": [1e-4, 2e-4, 5e-4, 3e-4], "realization": [0, 1, 2]},
        {"configuration": "", "title": "Delays"},
    )
    figure = mesoslip.plot(data)
    words, numbers = figure.axes
    rows = [one.get_text() for one in words.get_yticklabels()]
    assert rows == ["smooth", "stick-slip", "transient"]
    assert numbers.get_ylabel() == "period (s)"
    (bars,) = numbers.collections
    heights = [np.ptp(path[:, 1]) / 2 for path in bars.get_segments() if len(path)]
    np.testing.assert_allclose(heights, [1 / np.sqrt(3), 1 / np.sqrt(3), 2.0])
    # Open: the delays at which most realizations do not stick and slip.
    np.testing.assert_allclose(numbers.lines[-1].get_xdata(), [2e-4, 5e-4])
    title = figure.legends[0].get_title().get_text()
    assert title == "mean of 3 realizations; bars: standard error; areas: their share"
    assert figure.get_suptitle() == "Delays"


@pytest.mark.parametrize("count", [2, 5, *map(long, [1, 3, 4, 6])])
def test_no_part_of_an_overview_is_empty(count):
    """Panels with their colour bars fill their rows, and none covers another."""
    keys = ("contacts.delay", "slider.stiffness", "realization")
    names = ["status", *(f"measure_{number}" for number in range(count))]
    values = {name: (keys, np.arange(8.0).reshape(2, 2, 2)) for name in names}
    data = xr.Dataset(values, {keys[0]: [1e-4, 2e-4], keys[1]: [50.0, 100.0]})
    figure = mesoslip.plot(data.assign_attrs(configuration=""))
    with warnings.catch_warnings():
        # Of a layout that cannot be arranged.
        warnings.simplefilter("error")
        figure.draw_without_rendering()
    boxes = [one.get_tightbbox() for one in panels_of(figure)]
    rows: dict[int, float] = {}
    for box in boxes:
        row = round(box.y0 / figure.bbox.height, 1)
        rows[row] = rows.get(row, 0.0) + box.width / figure.bbox.width
    # The rest is for colour bars and their labels.
    assert all(0.6 < share < 1 for share in rows.values())
    assert not any(one.overlaps(two) for one, two in itertools.combinations(boxes, 2))


def test_lines_of_theory_are_smooth_and_scales_follow_the_data():
    """A boundary known in closed form, between few points; a measure over decades in logarithms."""
    delays, stiffnesses = np.logspace(-4, -2, 6), np.logspace(1.5, 3, 5)
    dimensions = ("contacts.delay", "slider.stiffness", "realization")
    product = (delays[:, None] * stiffnesses)[..., None]
    mean_force = 1e-6 * (1 + product)
    mean_force[1, 3] = np.nan
    flags = {"flag_meanings": "smooth stick_slip irregular transient"}
    data = xr.Dataset(
        {
            "status": (dimensions, 0 * product),
            "regime": (dimensions, np.where(product > 0.5, 0.0, 1.0), flags),
            "growth_rate": (dimensions, 0.5 - product, {"units": "s-1"}),
            "mean_waiting_time": (dimensions, 1 / product, {"units": "s"}),
            "mean_force": (dimensions, mean_force, {"units": "N"}),
        },
        {"contacts.delay": delays, "slider.stiffness": stiffnesses, "realization": [0]},
        {"configuration": ""},
    )
    data["contacts.delay"].attrs["units"] = "s"
    data["slider.stiffness"].attrs["units"] = "N m-1"
    figure = mesoslip.plot(data, width=0.086)
    regime, waiting, force = panels_of(figure)
    (line,) = (one for one in regime.collections if hasattr(one, "levels"))
    x, y = np.concatenate([path.vertices for path in line.get_paths()]).T
    # In milliseconds and kilonewtons per metre. Points are factors of 2.5 and 2.4 apart: cubics
    # between them err by 1.5 %. Straight pieces have some ten corners.
    np.testing.assert_allclose(x * y, 0.5, rtol=0.02)
    assert x.size > 100
    assert force.get_xlabel() == r"delay $\tau_d$ (ms)"
    assert regime.get_ylabel().replace("\n", " ") == "stiffness of the spring $K$ (kN/m)"
    assert isinstance(waiting.collections[0].norm, mpl.colors.LogNorm)
    assert not isinstance(force.collections[0].norm, mpl.colors.LogNorm)
    bars = [
        one.get_ylabel().replace("\n", " ")
        for one in figure.axes
        if one.get_label() == "<colorbar>"
    ]
    assert bars == ["regime", "mean waiting time (s)", "mean force (µN)"]
    # Smooth points have no waiting time: they are marked, and do not stretch the colours.
    slips = product[..., 0] <= 0.5
    assert waiting.collections[0].norm.vmax == pytest.approx(1 / product[..., 0][slips].min())
    assert waiting.collections[0].norm.vmin == pytest.approx(1 / product[..., 0][slips].max())
    (marks,) = waiting.lines
    assert len(marks.get_xdata()) == np.count_nonzero(~slips)
    # A point without a value is marked as such.
    (unknown,) = force.lines
    point = [[1e3 * delays[1], 1e-3 * stiffnesses[3]]]
    np.testing.assert_allclose(unknown.get_xydata(), point)
    (legend,) = figure.legends
    assert [one.get_text() for one in legend.get_texts()][-2:] == ["smooth", "no value"]
    assert legend.get_title().get_text() == "one realization of each point"
    figure.draw_without_rendering()
    shown = [one for one in regime.get_xticklabels() if one.get_text()]
    boxes = [one.get_window_extent() for one in shown]
    assert all(one.x1 < two.x0 for one, two in itertools.pairwise(boxes))


def test_types_of_fronts_have_the_speeds_of_steady_ones_as_boundaries():
    drags, stiffnesses = np.logspace(0, 2, 5), np.logspace(0, 1, 4)
    dimensions = ("contacts.drag", "slider.stiffness", "realization")
    ratio = (3 / (drags[:, None] * stiffnesses))[..., None]
    flags = {"flag_meanings": " ".join(FRONT_TYPES)}
    data = xr.Dataset(
        {
            "status": (dimensions, 0 * ratio),
            "front_type": (dimensions, 1.0 + (ratio > 0.1) + (ratio > 1), flags),
            "steady_front_speed_ratio": (dimensions, ratio, {"units": "1"}),
        },
        {"contacts.drag": drags, "slider.stiffness": stiffnesses, "realization": [0]},
        {"configuration": ""},
    )
    (axes, *bar) = mesoslip.plot(data).axes
    assert len(bar) == 1
    lines = [one for one in axes.collections if hasattr(one, "levels")]
    assert len(lines) == 2
    for line, value in zip(lines, (1, 0.1), strict=True):
        x, y = np.concatenate([path.vertices for path in line.get_paths()]).T
        np.testing.assert_allclose(x * y, 3 / value, rtol=0.1)


def test_names_can_be_drawn():
    """A line and a map over a key that takes names."""
    law = {"contacts.threshold.law": ["uniform", "gaussian", "weibull"]}
    for grid in (law, law | {"contacts.delay": [1e-4, 5e-4]}):
        data = mesoslip.sweep(tables(grid=grid), executor=mesoslip.Threads())
        figure = mesoslip.plot(data)
        figure.canvas.draw()
        texts = [
            text.get_text()
            for axis in (figure.axes[0].xaxis, figure.axes[0].yaxis)
            for text in axis.get_ticklabels()
        ]
        assert {"uniform", "gaussian", "weibull"} <= set(texts)


def test_keys_together_and_a_latin_hypercube():
    sweep = {
        "measures": ["mean_force"],
        "together": [
            {"slider.stiffness": ["97 N/m", "194 N/m"], "slider.mass": ["1.47 g", "2.94 g"]}
        ],
        "latin_hypercube": {
            "points": 5,
            "contacts.delay": {"from": "0.1 ms", "to": "10 ms", "spacing": "logarithmic"},
            "contacts.count": {"from": 10, "to": 30},
        },
    }
    plan = Plan.from_dict({**TINY, "sweep": sweep})
    assert plan.shape == (2, 5)
    for number in range(10):
        config = plan.config(number)
        assert config.slider.mass / config.slider.stiffness == pytest.approx(1.47e-3 / 97)
        assert config.contacts.count == plan.values(number)["contacts.count"]
    delays = sorted({plan.config(number).contacts.delay for number in range(10)})
    # One in each fifth of the two decades.
    fifths = np.floor(5 * np.log10(np.array(delays) / 1e-4) / 2)
    np.testing.assert_array_equal(fifths, np.arange(5))
    data = mesoslip.sweep(plan, executor=mesoslip.Threads())
    assert data["mean_force"].dims == ("slider.stiffness", "sample", "realization")
    assert data["slider.mass"].dims == ("slider.stiffness",)
    assert data["contacts.delay"].dims == ("sample",)
    assert data["contacts.count"].dtype.kind == "i"


def test_names_and_kinds_can_be_varied():
    grid = {"contacts.threshold.law": ["gaussian", "uniform"], "contacts.reattach": [True, False]}
    data = mesoslip.sweep(tables(grid=grid), executor=mesoslip.Threads())
    assert list(data["contacts.threshold.law"].values) == ["gaussian", "uniform"]
    assert data["mean_force"].sizes["contacts.reattach"] == 2
    assert not data["status"].any()


def test_single_keys_of_the_configuration_are_known():
    """Every key has a kind, and the units are those that the keys tell themselves."""
    for key in all_keys(Config):
        assert key_kind(key) is not None, key
    units = {"contacts.delay": "s", "contacts.drag_rate": "s-1", "contacts.film_density": "kg m-3"}
    units |= {"contacts.area": "m2", "contacts.count": "1", "slider.damping_ratio": "1"}
    units |= {"drive.force_rate": "N s-1", "slider.mass": "kg"}
    for key, unit in units.items():
        assert key_kind(key).cf_units == unit, key
    assert key_kind("contacts.threshold.law").cf_units is None
    assert not key_kind("drive.stage").is_single
    assert key_kind("contacts.dely") is None


def test_points_that_are_the_same_are_computed_once(tmp_path):
    """Titles make no difference to the numbers."""
    plan = Plan.from_dict(tables(grid={"title": ["one", "other"]}, realizations=2))
    done = done_by(plan, tmp_path)
    assert done.computed == 4
    assert len(done_by(plan, tmp_path).failures) == 0
    with Store(tmp_path, "points") as store:
        assert len(store.names()) == 2
    np.testing.assert_array_equal(done.dataset["mean_force"][0], done.dataset["mean_force"][1])


@pytest.fixture(scope="module")
def whole():
    return mesoslip.sweep(tables(realizations=3), executor=mesoslip.Threads(1))


def assert_same_numbers(one: xr.Dataset, other: xr.Dataset) -> None:
    """The same to the bit, NaN and all."""
    assert one.sizes == other.sizes
    for name in one.variables:
        assert one[name].values.tobytes() == other[name].values.tobytes(), name


@pytest.mark.parametrize(
    "executor", [mesoslip.Threads(2), *map(long, [mesoslip.Processes(1), mesoslip.Processes(2), 2])]
)
def test_the_executor_does_not_matter(executor, whole):
    data = mesoslip.sweep(tables(realizations=3), executor=executor)
    assert_same_numbers(whole, data)


class Backwards(Executor, Pool):
    """Computes the last piece first."""

    capacity = 100

    def open(self, stop):  # noqa: ARG002
        self.waiting = []
        return nullcontext(self)

    def submit(self, function, piece):
        self.waiting.append((Future(), function, piece))
        return self.waiting[-1][0]

    def check(self):
        while self.waiting:
            future, function, piece = self.waiting.pop()
            future.set_result(function(piece, Stop()))

    def close(self, wait):
        pass


def test_the_order_does_not_matter(whole):
    plan = Plan.from_dict(tables(realizations=3))
    assert_same_numbers(whole, run_sweep(plan, executor=Backwards()).dataset)


def test_threads_hand_over_to_processes(whole, monkeypatch):
    """In the middle of a sweep, and the numbers stay."""
    monkeypatch.setattr(ThreadsThenProcesses, "thread_seconds", 0.02)
    started = []

    class Counted(local.WorkerProcess):
        def __init__(self):
            started.append(self)
            super().__init__()

    monkeypatch.setattr(local, "WorkerProcess", Counted)
    data = mesoslip.sweep(tables(realizations=3), executor=1)
    assert len(started) == 1
    assert_same_numbers(whole, data)


def done_by(plan, store, executor=None):
    with Store(store, "points") as opened:
        return run_sweep(plan, store=opened, executor=executor or mesoslip.Threads(2))


def test_only_what_is_missing_is_computed(tmp_path, whole):
    store = tmp_path / "points"
    first = done_by(Plan.from_dict(tables(realizations=2)), store)
    assert (first.stored, first.computed) == (0, 12)
    # Realizations that are added leave the earlier ones as they were.
    second = done_by(Plan.from_dict(tables(realizations=3)), store)
    assert (second.stored, second.computed) == (12, 6)
    assert_same_numbers(whole, second.dataset)
    again = done_by(Plan.from_dict(tables(realizations=3)), store)
    assert (again.stored, again.computed) == (18, 0)
    # A longer list keeps what is there, and so does a shorter one.
    grid = GRID | {"contacts.delay": ["0.5 ms", "1 ms", "0.1 ms"]}
    longer = done_by(Plan.from_dict(tables(realizations=3, grid=grid)), store)
    assert (longer.stored, longer.computed) == (18, 9)
    delays = whole["contacts.delay"].values
    assert_same_numbers(whole, longer.dataset.sel({"contacts.delay": delays}))


def test_points_of_another_base_measure_or_program_do_not_mix(tmp_path, monkeypatch):
    store = tmp_path / "points"
    done_by(Plan.from_dict(tables()), store)
    for change in (
        {"slider": TINY["slider"] | {"damping_ratio": 0.3}},
        {"run": {"duration": 0.4, "seed": 2}},
        {"sweep": tables(discard=0.4)["sweep"]},
        {"sweep": tables(measures=["mean_force"])["sweep"]},
    ):
        assert done_by(Plan.from_dict(tables() | change), store).stored == 0, change
    monkeypatch.setattr("mesoslip._build.COMMIT", "another")
    assert done_by(Plan.from_dict(tables()), store).stored == 0
    monkeypatch.undo()
    assert done_by(Plan.from_dict(tables() | {"title": "another"}), store).computed == 0


def test_names_of_points_do_not_depend_on_realizations_or_order():
    config = Config.from_dict(TINY)
    measures = [MEASURES["mean_force"], MEASURES["breaks"]]
    key = combination_key(config, measures, 0.5)
    assert key == combination_key(config.replace("run.realizations=7"), measures[::-1], 0.5)
    assert key != combination_key(config, measures, 0.4)
    assert point_name(key, 3) == point_name(key, 3) != point_name(key, 4)


@pytest.mark.parametrize("damage", ["cut", "flipped", "empty", "renamed"])
def test_damaged_points_count_as_missing(damage, tmp_path):
    plan = Plan.from_dict(tables())
    first = done_by(plan, tmp_path)
    paths = sorted(path for path in tmp_path.glob("*.json") if path.name != MANIFEST)
    path = paths[0]
    content = path.read_text()
    number = json.loads(content)["measures"]["breaks"]
    path.write_text(
        {
            "cut": content[: len(content) // 2],
            "flipped": content.replace(f'"{number}"', '"1e9"'),
            "empty": "",
            "renamed": paths[1].read_text(),
        }[damage]
    )
    again = done_by(plan, tmp_path)
    assert (again.stored, again.computed) == (5, 1)
    assert_same_numbers(first.dataset, again.dataset)


@pytest.mark.parametrize(
    "content",
    [b"[" * 200_000, b'{"checksum": ' + b"9" * 5000 + b"}", b'{"checksum": 1, "name": []}', b"[]"],
    ids=["brackets", "digits", "no name", "list"],
)
def test_a_point_that_is_none_counts_as_missing(content, tmp_path):
    plan = Plan.from_dict(tables())
    name = task_of(plan, groups(plan)[0], 0).names[0]
    with Store(tmp_path, "points") as store:
        (tmp_path / f"{name}.json").write_bytes(content)
        assert store.names() == {name}
        assert stored_measures(store, plan, name) is None


@pytest.mark.parametrize(
    "measures", [{"breaks": 10**400}, {"breaks": [1]}, {"breaks": None}, [], 7]
)
def test_measures_that_are_no_numbers_count_as_missing(measures, tmp_path):
    """Though the point is whole, with a checksum."""
    plan = Plan.from_dict(tables())
    name = task_of(plan, groups(plan)[0], 0).names[0]
    with Store(tmp_path, "points") as store:
        store.write(name, {"measures": measures})
        assert store.read(name) is not None
        assert stored_measures(store, plan, name) is None


def test_numbers_come_back_from_the_store_to_the_bit(tmp_path):
    values = {"tenth": 0.1, "least": 5e-324, "none": float("nan"), "much": float("inf")}
    plan = Plan.from_dict(tables())
    (group, *_) = groups(plan)
    task = task_of(plan, group, 0)
    with Store(tmp_path, "points") as store:
        store.write(task.names[0], stored_body(0, Outcome(values), plan.values(0)))
        back = stored_measures(store, plan, task.names[0])
    assert {name: np.float64(one).tobytes() for name, one in back.items()} == {
        name: np.float64(one).tobytes() for name, one in values.items()
    }


def test_outputs_of_points_on_request(tmp_path):
    """Asked for later, they have their points computed again; each is an output like any other."""
    done_by(Plan.from_dict(tables()), tmp_path)
    plan = Plan.from_dict(tables(traces=True))
    traced = done_by(plan, tmp_path)
    assert (traced.stored, traced.computed) == (0, 6)
    assert done_by(plan, tmp_path).stored == 6
    assert done_by(Plan.from_dict(tables()), tmp_path).stored == 6
    group = groups(plan)[0]
    tree = mesoslip.open_output(tmp_path / f"{point_name(group.keys[0], 0)}.nc")
    expected = mesoslip.run(plan.config(0))
    np.testing.assert_array_equal(tree["spring_force"], expected["spring_force"])


def test_one_store_one_sweep(tmp_path):
    with (
        Store(tmp_path, "points"),
        pytest.raises(FileError, match="another run of this output is under way"),
    ):
        Store(tmp_path, "points")
    with Store(tmp_path, "points"):
        pass


def test_what_a_killed_sweep_left_behind_is_removed(tmp_path):
    with Store(tmp_path, "points") as store:
        store.write_manifest({})
    (tmp_path / f".{'0' * 32}.json.part").write_text("half")
    with Store(tmp_path, "points"):
        assert sorted(path.name for path in tmp_path.iterdir()) == ["lock", MANIFEST]


USER = '''
"""Measures of a user."""
import numpy as np

def last_force(tree):
    """the force at the end"""
    return tree["spring_force"][0, -1]

last_force.units = "N"

def sometimes(tree):
    if tree["realization"].values[0] == {number}:
        raise ValueError("too much")
    return 1

def text(tree):
    return "much"

def leaves(tree):
    raise SystemExit(3)
'''


def test_measures_of_ones_own(tmp_path, sweep_file, command):
    (tmp_path / "own.py").write_text(USER.format(number=1))
    path = sweep_file(SIMPLE.replace('"mean_force"', '"own.py:last_force", "mean_force"'))
    output = tmp_path / "sweep.nc"
    status, _, printed = command(
        "sweep", path, "-o", output, "--workers", "1", "--pool", "processes"
    )
    assert (status, "4 points computed" in printed) == (0, True)
    data = xr.open_dataset(output)
    assert data["last_force"].units == "N"
    assert data["last_force"].long_name == "the force at the end"
    tree = mesoslip.run(
        Config.from_dict(TINY).replace({"contacts.delay": 5e-4, "run.realizations": 2})
    )
    expected = tree["spring_force"].isel(time=-1)
    np.testing.assert_array_equal(data["last_force"][1], expected)
    # Another function of the same name gives other points.
    (tmp_path / "own.py").write_text(USER.format(number=2))
    assert "4 points computed" in command("sweep", path, "-o", output)[2]


def test_failures_are_listed_and_not_fatal(tmp_path, sweep_file, command):
    """Points fail one by one; the rest is computed, and called again only they are tried."""
    own = tmp_path / "own.py"
    own.write_text(USER.format(number=1))
    path = sweep_file(SIMPLE.replace('"mean_force"', '"own.py:sometimes", "mean_force"'))
    output = tmp_path / "sweep.nc"
    status, _, printed = command("sweep", path, "-o", output, "--pool", "threads")
    assert status == 1
    data = xr.load_dataset(output)
    failed = data["status"].values == 1
    np.testing.assert_array_equal(failed, [[False, True], [False, True]])
    assert printed.count("failed: contacts.delay") == 2
    assert "failed: contacts.delay = 0.0001 s, realization = 1: measure sometimes" in printed
    assert "own.py, line 13): ValueError: too much" in printed
    np.testing.assert_array_equal(np.isnan(data["mean_force"].values), failed)
    assert data.attrs["failures"].count("too much") == 2
    status, _, printed = command("sweep", path, "-o", output, "--pool", "threads")
    assert (status, "0 points computed, 2 read from the store, 2 failed" in printed) == (1, True)
    for name, words in (("text", "returned 'much', not a number"), ("leaves", "SystemExit: 3")):
        path = sweep_file(SIMPLE.replace("mean_force", f"own.py:{name}"))
        status, _, printed = command("sweep", path, "-o", tmp_path / f"{name}.nc")
        assert status == 1
        assert words in printed


WRONG = {
    'measures = ["mean_forc"]': "did you mean 'mean_force'",
    'measures = ["nothing.py:here"]': "nothing.py cannot be read: No such file",
    'measures = ["bad.py:here"]': "bad.py, line 2: ZeroDivisionError: division by zero",
    'measures = ["good.py:thera"]': "has no function 'thera'; did you mean 'there'",
    "measures = []": "must name at least one measure",
    'measures = ["breaks", "breaks"]': "is named twice",
    'measure = ["breaks"]': "sweep.measure: unknown key; did you mean 'measures'",
    '[sweep.grid]\n"contacts.dely" = [1]': "unknown key; did you mean 'contacts.delay'",
    '[sweep.grid]\n"delay" = [1]': "unknown key; did you mean 'contacts.delay'",
    '[sweep.grid]\n"contacts.delay" = ["1 ms", "1 mm"]': (
        "\"contacts.delay\"[1] = '1 mm': has the unit mm; expected a quantity such as '0.5 ms'"
    ),
    '[sweep.grid]\n"contacts.delay" = []': "must be a list of values",
    '[sweep.grid]\n"contacts.delay" = "1 ms"': "must be a list of values",
    '[sweep.grid]\n"contacts.delay" = [0.001, "1 ms"]': "contacts.delay = 0.001 s is given 2 times",
    '[sweep.grid]\n"contacts.count" = [1.5]': "must be a whole number",
    '[sweep.grid]\n"drive.stage" = [[]]': "only keys with one value can be varied",
    '[sweep.grid]\n"run.realizations" = [1]': "set sweep.realizations",
    '[sweep.grid]\n"contacts.delay" = { from = 0, to = 1, points = 2, spacing = "logarithmic" }': (
        "needs both ends positive"
    ),
    '[sweep.grid]\n"contacts.delay" = { from = 0, to = 1 }': '"contacts.delay".points: missing',
    '[sweep.grid]\n"contacts.threshold.law" = { from = "a", to = "b", points = 2 }': "no range",
    '[[sweep.together]]\n"contacts.delay" = [1, 2]\n"slider.mass" = [1]': (
        "need lists of one length: contacts.delay has 2, slider.mass has 1"
    ),
    '[[sweep.together]]\n"slider.mass" = [1]\n[sweep.grid]\n"slider.mass" = [2]': "varied twice",
    32 * '[[sweep.together]]\n"slider.mass" = [1]\n': "has 32 axes",
    '[sweep.latin_hypercube]\npoints = 0\n"slider.mass" = { from = 1, to = 2 }': "at least 1",
    "[sweep.latin_hypercube]\npoints = 3": "names no keys to vary",
    '[sweep.grid]\n"slider.stiffness" = [97, -97]': (
        "point slider.stiffness = -97 N/m: slider.stiffness = -97.0: must be greater than 0"
    ),
    "realizations = 0": "must be greater than or equal to 1",
    "discard = 1": "must be less than 1",
    "": "nothing is varied",
}


@pytest.mark.parametrize("text", WRONG)
def test_what_is_wrong_is_reported_before_anything_is_run(text, tmp_path, sweep_file, command):
    (tmp_path / "bad.py").write_text("\n1 / 0\n")
    (tmp_path / "good.py").write_text("def there(tree):\n    return 0\n")
    head = "[sweep]\n" if "measure" in text else '[sweep]\nmeasures = ["breaks"]\n'
    tail = "" if "sweep." in text or not text else '\n[sweep.grid]\n"contacts.delay" = [0.001]'
    output = tmp_path / "out" / "sweep.nc"
    status, out, printed = command("sweep", sweep_file(head + text + tail), "-o", output)
    assert status == 2, printed
    assert WRONG[text] in printed
    assert "sweep.toml" in printed
    assert out == ""
    assert not output.parent.exists()


def test_many_points_that_cannot_be_run_are_counted(sweep_file, command):
    path = sweep_file(
        '[sweep]\nmeasures = ["breaks"]\n[sweep.grid]\n"slider.mass" = [-1,-2,-3,-4,-5,-6,-7,8]'
    )
    printed = command.refusal("sweep", path)
    assert printed.count("must be greater than 0") == 5
    assert "7 of 8 combinations are wrong" in printed


def test_a_sweep_needs_a_sweep(tmp_path, command):
    (tmp_path / "base.toml").write_text(Config.from_dict(TINY).to_toml())
    status, _, printed = command("sweep", tmp_path / "base.toml")
    assert (status, "sweep: missing; this table names" in printed) == (2, True)
    (tmp_path / "sweep.toml").write_text('base = "base.toml"\n[sweep]')
    status, _, printed = command("run", tmp_path / "sweep.toml")
    assert (status, "the command for it is mesoslip sweep" in printed) == (2, True)
    printed = command.refusal("sweep", tmp_path / "sweep.toml", "--pool", "swimming")
    with pytest.raises(ConfigError, match="executor"):
        mesoslip.sweep(tables(), executor="swimming")


def test_changes_of_what_the_sweep_sets_are_refused(tmp_path, sweep_file, command):
    """They had no effect: the values of the table [sweep] were used."""
    arguments = ("sweep", sweep_file(SIMPLE), "-o", tmp_path / "out.nc", "--dry-run")
    for key, setter in (
        ("contacts.delay", "the table [sweep]"),
        ("run.realizations", "sweep.realizations"),
    ):
        err = command.refusal(*arguments, "--set", f"{key}=3")
        assert f"{key}: cannot be changed, as {setter} sets it; change that" in err
    assert command(*arguments, "--set", "sweep.realizations=3")[0] == 0


def test_many_combinations_are_checked_with_progress_or_refused(
    tmp_path, sweep_file, command, monkeypatch
):
    """10⁶ of them take minutes, before the first run or an estimate."""
    arguments = ("sweep", sweep_file(SIMPLE), "-o", tmp_path / "out.nc", "--dry-run")
    monkeypatch.setattr("mesoslip.command_line.progress.PATIENCE", -1.0)
    monkeypatch.setattr("mesoslip.campaign.sweep_plan.STEP", 1)
    err = command.messages(*arguments)
    assert "checking: 50 % after 0 s" in err
    monkeypatch.setattr("mesoslip.campaign.sweep_plan.free_memory", lambda: 1e3)
    err = command.refusal(*arguments)
    assert re.search(r"sweep: has \d+ combinations, which take about .* GiB of memory", err)


def test_a_checked_combination_takes_little_memory():
    """Configurations are made again where they are needed: 10⁶ of them took 9 GB."""
    grid = {"run.seed": {"from": 1, "to": 300, "points": 300}}
    plan = Plan.from_dict({**TINY, "sweep": {"measures": ["breaks"], "grid": grid}})
    plan.config(0)
    tracemalloc.start()
    try:
        plan.check(lambda _: None)
        kept = groups(plan)
        used, _ = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert len(kept) == 300
    assert used < 300 * COMBINATION_BYTES


def test_a_dry_run_runs_nothing(tmp_path, sweep_file, command):
    output = tmp_path / "out" / "sweep.nc"
    printed = command.output("sweep", sweep_file(SIMPLE), "-o", output, "--dry-run")
    assert "points   4 (2 contacts.delay x 2 realizations), 0 of them done" in printed
    assert {line.split()[0] for line in printed.splitlines()} == {
        "points",
        "time",
        "memory",
        "disk",
    }
    assert not output.parent.exists()
    command("sweep", sweep_file(SIMPLE), "-o", output, "--pool", "threads")
    assert "4 of them done" in command("sweep", sweep_file(SIMPLE), "-o", output, "--dry-run")[1]


def test_changes_are_laid_over_the_base(tmp_path, sweep_file, command):
    output = tmp_path / "sweep.nc"
    arguments = ("-o", output, "--pool", "threads", "--set", "slider.damping_ratio=0.7")
    assert command("sweep", sweep_file(SIMPLE), *arguments)[0] == 0
    assert "damping_ratio = 0.7" in xr.load_dataset(output).attrs["configuration"]


def test_a_stopped_sweep_keeps_what_it_has(tmp_path):
    plan = Plan.from_dict(tables(realizations=3))
    stop, done = Stop(), []

    def until_five(part):
        done.append(part)
        if len(done) == 6:
            stop.set()

    with Store(tmp_path, "points") as store:
        part = run_sweep(plan, store=store, executor=1, progress=until_five, stop=stop)
    assert (part.computed, part.missing, part.complete) == (5, 13, False)
    assert np.sum(part.dataset["status"].values == 2) == 13
    assert part.dataset.attrs["complete"] == "false"
    rest = done_by(plan, tmp_path)
    assert (rest.stored, rest.computed) == (5, 13)


def test_examples_are_sweeps():
    paths = sorted((ROOT / "runs" / "sweeps").glob("*.toml"))
    assert paths
    for path in paths:
        assert Plan.load(path).keys


def test_a_script_without_a_guard_may_sweep(tmp_path):
    """Processes do not import the program that starts them."""
    script = tmp_path / "script.py"
    script.write_text(
        "import json, sys, mesoslip\n"
        "data = mesoslip.sweep(json.loads(sys.argv[1]), executor=mesoslip.Processes(1))\n"
        "print(int(data['status'].sum()))\n"
    )
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
    done = run_program(sys.executable, script, json.dumps(tables()), env=environment)
    assert done == (0, "0\n", "")


class Mirrored:
    """What a measure sees of a run whose drive goes back."""

    def trace(self, name):
        return {
            "spring_force": -np.array([0.0, 3.0, 1.0, 4.0, 2.0]),
            "drive_displacement": -np.linspace(0.0, 1.0, 5),
        }[name]

    def catalogue(self, group, name):
        assert (group, name) == ("slips", "peak_velocity")
        return -np.array([2.0, 18.0, 5.0])


def test_measures_of_a_reversed_drive_are_those_of_its_mirror():
    assert MEASURES["peak_velocity"].function(Mirrored()) == 18.0
    assert MEASURES["max_force"].function(Mirrored()) == -4.0
