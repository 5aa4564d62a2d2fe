"""Outputs: one layout in memory and in files, which every method of xarray can handle."""

import fcntl
import os
import platform
import resource
import subprocess
import sys
from types import SimpleNamespace

import mesoslip
import netCDF4
import numpy as np
import pytest
import xarray as xr
from conftest import ROOT, klein_tables, long, python
from kinds import configuration
from mesoslip.output import files, filling, targets, writing
from mesoslip.output.arrays import Arrays
from mesoslip.output.tree import build_tree
from mesoslip.simulation.realization import Realization
from mesoslip.simulation.recorded_tables import FirstRows
from mesoslip.simulation.run_realizations import run_realizations

QUICK = {
    "contacts__count": 48,
    "run__duration": 2.2,
    "output__interval": 1e-2,
    "output__slip_interval": 1e-3,
    "run__realizations": 2,
}
LATTICE = {
    "contacts__stiffness": 200.0,
    "contacts__threshold__relative_width": 0.3,
    "interaction": {"strength": 0.3, "columns": 8, "rows": 6},
    "output__snapshots": (0.5, 1.5),
    "output__snapshot_size": 20,
}
LAYERED = {
    "slider": {"kind": "layered", "mass": 1.47e-3, "stiffness": 97.0, "layers": 4},
    "output__layers": True,
    "run__duration": 0.5,
}
BUNDLE = {
    "slider": {"kind": "quasistatic"},
    "drive": {"force_rate": 1e-6},
    "run": {"realizations": 3},
    "contacts__reattach": False,
    "output__interval": 1e-2,
    "output__slip_interval": None,
}
KINDS = {
    "rigid": QUICK,
    "infinite": QUICK | {"run__engine": "me", "run__realizations": 1},
    "layered": QUICK | LAYERED,
    "base": QUICK
    | LAYERED
    | {
        "slider__base": {"mass": 5e-3, "stiffness": 1e4},
        "run__engine": "me",
        "run__realizations": 1,
    },
    "prescribed": QUICK | {"slider": {"kind": "prescribed"}},
    "lattice": QUICK | LATTICE,
    "quasistatic": QUICK | LATTICE | {"slider": {"kind": "quasistatic", "stiffness": 97.0}},
    "bundle": QUICK | BUNDLE,
    "nothing happens": QUICK | {"run__duration": 0.1},
}
# What differs between two runs of one thing, and between two moments of writing it.
PASSING = {"history", "date_created"}


@pytest.fixture(scope="module", params=KINDS)
def results(request):
    """Results of a run of each kind."""
    changes = dict(KINDS[request.param])
    changes = {name: value for name, value in changes.items() if value is not None}
    return run_realizations(mesoslip.Config.from_dict(klein_tables(**changes)))


def assert_same(one: xr.DataTree, other: xr.DataTree) -> None:
    assert one.groups == other.groups
    for here in one.subtree:
        there = other[here.path]
        assert isinstance(there, xr.DataTree)
        assert set(here.coords) == set(there.coords)
        assert set(here.variables) == set(there.variables)
        assert {**here.attrs, **dict.fromkeys(PASSING)} == {
            **there.attrs,
            **dict.fromkeys(PASSING),
        }
        for name in here.variables:
            variable, twin = here.variables[name], there.variables[name]
            assert variable.dims == twin.dims, name
            assert variable.dtype == twin.dtype, name
            assert variable.attrs == twin.attrs, name
            assert variable.values.tobytes() == twin.values.tobytes(), name


def assert_same_arrays(path):
    """Whether an output that is read without xarray is the one that is read with it."""
    whole = mesoslip.open_output(path)
    with files.opened_arrays(path) as tree:
        assert isinstance(tree, Arrays)
        assert tree.attrs == whole.attrs
        assert tree.children.keys() == whole.children.keys()
        assert tree.coords.keys() == whole.coords.keys()
        assert tree.data_vars.keys() == whole.data_vars.keys()
        for name in ("", *tree.children):
            group = tree.children[name] if name else tree
            data = (whole[name] if name else whole).to_dataset(inherit=False)
            assert group.keys() == data.variables.keys()
            assert {one: data.sizes[one] for one in group.sizes} == group.sizes
            for key, variable in group.items():
                assert variable.dims == data[key].dims
                assert variable.dtype == data[key].dtype
                assert variable.attrs["units"] == data[key].attrs["units"]
                np.testing.assert_array_equal(variable.values, data[key].values)
                np.testing.assert_array_equal(variable[:1].values, data[key][:1].values)


def test_both_ways_to_write_give_the_same(results, tmp_path):
    """Block by block or as a tree: the same values to the bit, attributes, types and encodings."""
    tree = build_tree(results)
    writing.write_results(results, tmp_path / "streamed.nc", threads=2)
    writing.write(tree, tmp_path / "built.nc")
    streamed, built = files.read(tmp_path / "streamed.nc"), files.read(tmp_path / "built.nc")
    assert_same(tree, streamed)
    assert_same(built, streamed)
    for node in built.subtree:
        for name, variable in node.variables.items():
            for key in ("dtype", "_FillValue", "zlib", "coordinates"):
                mine, others = (
                    one.encoding.get(key) for one in (streamed[node.path].variables[name], variable)
                )
                if key == "coordinates":
                    mine, others = (set((one or "").split()) for one in (mine, others))
                np.testing.assert_equal(mine, others, err_msg=f"{node.path} {name} {key}")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["built.nc", "streamed.nc"]
    assert_same_arrays(tmp_path / "streamed.nc")


def test_rows_of_the_kernel_become_variables(results):
    """Each row of each table stands in its place, with its realization."""
    tree = build_tree(results)
    for place, one in enumerate(results.realizations):
        trace = one.rows("trace").read()
        force = tree["spring_force"].values[place]
        np.testing.assert_array_equal(force[: len(trace)], trace[:, 4])
        assert np.isnan(force[len(trace) :]).all()
        slips, data = one.rows("slips").read(), tree["slips"].to_dataset(inherit=False)
        mine = data["realization_index"].values == place
        np.testing.assert_array_equal(data["force_drop"].values[mine], slips[:, 3] - slips[:, 4])
        np.testing.assert_array_equal(data["contacts_broken"].values[mine], slips[:, 6])
        tables = {
            "slip_traces": ("slip_trace", {"sample_time": 0, "velocity": 3, "slip": -1}),
            "avalanches": ("avalanches", {"start_time": 0, "size": 2, "force_drop": 4}),
            "snapshots": ("snapshot_events", {"snapshot_time": 0, "avalanche_size": 2}),
        }
        for group in tables.keys() & tree.children.keys():
            table, columns = tables[group]
            data, rows = tree[group].to_dataset(inherit=False), one.rows(table).read()
            mine = data["realization_index"].values == place
            for name, column in columns.items():
                np.testing.assert_array_equal(data[name].values[mine], rows[:, column], name)
        if "snapshots" in tree.children:
            stretch = tree["snapshots/stretch"].values
            mine = tree["snapshots/realization_index"].values == place
            rows = one.rows("snapshots").read()
            np.testing.assert_array_equal(stretch[mine].reshape(rows.shape[:2]), rows[..., 0])
        if "layer" in tree.dims:
            rows = one.rows("layers").read()
            np.testing.assert_array_equal(tree["layer_displacement"].values[place], rows)


@pytest.mark.parametrize("rows", [long(1), 7])
def test_blocks_do_not_matter(results, tmp_path, monkeypatch, rows):
    """Blocks that end anywhere, within and between realizations."""
    tree = build_tree(results)
    monkeypatch.setattr(filling, "BLOCK_ROWS", rows)
    monkeypatch.setattr(writing, "MIN_COMPRESSED", 10)
    if max(len(one.rows("trace")) for one in results.realizations) < 1000:
        writing.write_results(results, tmp_path / "out.nc")
        assert_same(tree, files.read(tmp_path / "out.nc"))


@pytest.mark.parametrize(("rows", "chunk"), [(30, (1, 30)), (120, (2, 50)), (10**5, (3, 50))])
def test_interrupted_realizations_of_different_length(klein, tmp_path, monkeypatch, rows, chunk):
    """What a realization did not come to is missing; the times are those of the longest. A chunk
    holds a part of a long realization, or many short ones."""
    monkeypatch.setattr(filling, "BLOCK_ROWS", rows)
    monkeypatch.setattr(writing, "MIN_COMPRESSED", 10)
    results = run_realizations(klein(**QUICK | {"run__realizations": 3}))

    class Cut:
        def __init__(self, one, length):
            self.one, self.length = one, length

        def __getattr__(self, name):
            return getattr(self.one, name)

        def rows(self, table):
            rows = self.one.rows(table)
            return FirstRows(rows, self.length) if table == "trace" else rows

    partial = SimpleNamespace(
        config=results.config,
        complete=False,
        wall_seconds=1.0,
        realizations=[
            Cut(one, length) for one, length in zip(results.realizations, (3, 50, 20), strict=True)
        ],
    )
    tree = build_tree(partial)
    writing.write_results(partial, tmp_path / "out.nc")
    assert_same(tree, files.read(tmp_path / "out.nc"))
    with netCDF4.Dataset(tmp_path / "out.nc") as file:
        assert tuple(file["spring_force"].chunking()) == chunk
    force = tree["spring_force"].values
    assert tree.attrs["complete"] == "false"
    assert np.isfinite(force).sum(axis=1).tolist() == [3, 50, 20]
    assert np.isfinite(tree["time"].values).all()
    assert tree["detached_contacts"].dtype == np.float64


MANY = """
import resource, sys
import mesoslip
import numpy as np
from mesoslip.output import targets, writing
from pathlib import Path
import subprocess
import sys
from types import SimpleNamespace

class Rows:
    def __init__(self, count, columns):
        self.count, self.columns = count, columns

    def __len__(self):
        return self.count

    def blocks(self, most):
        for start in range(0, self.count, most):
            rows = np.zeros((min(most, self.count - start), self.columns))
            rows += np.arange(start, start + len(rows))[:, None]
            yield rows

tables = {"trace": Rows(1_500_000, 9), "slip_trace": Rows(1_500_000, 10), "slips": Rows(0, 7)}
tables["stages"] = Rows(0, 17)
one = SimpleNamespace(
    rows=tables.get, number=0, time=1.0, ending="", breaks=1, advances=1, kernel_seconds=1.0,
    energy=np.ones(11), energy_residual=0.0, step_work=0.0, force_error=0.0,
)
config = mesoslip.Config.load(sys.argv[1])
results = SimpleNamespace(config=config, complete=True, wall_seconds=1.0, realizations=[one])
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
writing.write_results(results, Path(sys.argv[2]))
print((resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024)
"""


def test_a_long_run_is_written_in_little_memory(tmp_path):
    """200 MB of samples take a fixed part of that."""
    assert float(python(MANY, ROOT / "runs" / "klein.toml", tmp_path / "long.nc")) < 100
    with xr.open_datatree(tmp_path / "long.nc", engine="netcdf4") as tree:
        assert tree["velocity"].values[0, -1] == 1_499_999
        assert tree["slip_traces/sample_time"].values[100_000] == 100_000


@pytest.mark.parametrize("threads", [long(1), 2])
def test_a_file_that_cannot_grow_is_an_error(results, tmp_path, threads):
    """Wherever it ends: one message, nothing left behind, and the next file is whole."""
    path = tmp_path / "out.nc"
    writing.write_results(results, path)
    size = path.stat().st_size
    path.unlink()
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    for limit in (size // 2, size - 1):
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, before[1]))
        try:
            with pytest.raises(mesoslip.MesoslipError, match="cannot be written") as printed:
                writing.write_results(results, path, threads=threads)
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, before)
        assert printed.value.exit_status == 1
        assert not list(tmp_path.iterdir())
    writing.write_results(results, path, threads=threads)
    assert_same(build_tree(results), files.read(path))


def test_no_group_hides_a_coordinate_of_its_parent(results):
    tree = build_tree(results)
    for child in tree.children.values():
        own = child.to_dataset(inherit=False)
        assert not set(own.variables) & set(tree.coords)
        if "realization" not in own.dims:
            assert own["realization_index"].attrs["instance_dimension"] == "realization"
            assert set(own["realization_index"].values) <= set(range(tree.sizes["realization"]))
        for name, variable in own.variables.items():
            assert {"units", "long_name"} <= variable.attrs.keys(), name


def test_methods_of_a_tree_work_on_the_whole(results, tmp_path):
    """As a user reads a file, without our reader."""
    path = tmp_path / "out.nc"
    writing.write_results(results, path)
    with xr.open_datatree(path, engine="netcdf4") as tree:
        assert "slips" in tree._repr_html_()
        assert tree.isel(realization=0)["spring_force"].dims == ("time",)
        middle = float(tree["time"].mean())
        early = tree.sel(time=slice(0, middle))
        assert 0 < early.sizes["time"] < tree.sizes["time"]
        assert early["slips"].sizes["slip"] == tree["slips"].sizes["slip"]
        doubled = tree.map_over_datasets(lambda data: 2 * data)
        np.testing.assert_array_equal(
            doubled["slips/force_drop"].values, 2 * tree["slips/force_drop"].values
        )
        for name, node in tree.children.items():
            assert set(node.to_dataset().data_vars) == set(node.data_vars)
            alone = tree[name].to_dataset(inherit=False)
            expected = int(np.prod([alone.sizes[one] for one in alone.dims]))
            assert len(alone.to_dataframe()) == expected
            # The same without us, from the file.
            with xr.open_dataset(path, group=name) as data:
                assert len(data.to_dataframe()) == expected
            for variable in node.data_vars.values():
                assert len(variable.to_dataframe(name="values")) == variable.size
        assert len(mesoslip.slips(tree).to_dataframe()) == tree["slips"].sizes["slip"]
        assert len(tree.to_dataset().to_dataframe()) == np.prod(
            list(tree.to_dataset().sizes.values())
        )


def test_files_of_earlier_versions_are_read():
    """Their catalogues hid the coordinates of the root."""
    path = ROOT / "tests" / "reference" / "old.nc"
    with netCDF4.Dataset(path) as file:
        assert "realization" in file["slips"].variables
        times = file["slip_traces"]["time"][:]
        numbers = file["slips"]["realization"][:]
        starts = file["avalanches"]["time"][:]
        moments = file["snapshots"]["time"][:]
    tree = mesoslip.open_output(path)
    np.testing.assert_array_equal(tree["slip_traces"]["sample_time"].values, times)
    np.testing.assert_array_equal(tree["slips"]["realization_index"].values, numbers)
    np.testing.assert_array_equal(tree["avalanches"]["start_time"].values, starts)
    np.testing.assert_array_equal(tree["snapshots"]["snapshot_time"].values, moments)
    assert tree["slips"]["realization_index"].attrs["instance_dimension"] == "realization"
    assert "realization_index" in tree["slips"].data_vars
    assert "slips" in tree._repr_html_()
    assert tree.isel(realization=0).sel(time=slice(0, 1)).sizes["time"] > 0
    assert len(mesoslip.slips(tree)["waiting_time"]) == len(numbers)
    assert_same_arrays(path)


def test_extremes_of_stages_in_earlier_files_have_the_names_of_today(klein, tmp_path):
    path = tmp_path / "earlier.nc"
    writing.write(mesoslip.run(klein(contacts__count=100, run__duration=0.5)), path)
    with netCDF4.Dataset(path, "a") as file:
        stages = file["stages"]
        for end in ("", "_time", "_displacement"):
            stages.renameVariable(f"max_force{end}", f"greatest_force{end}")
            stages.renameVariable(f"min_force{end}", f"least_force{end}")
        expected = stages["greatest_force_time"][:]
    stages = mesoslip.open_output(path)["stages"]
    np.testing.assert_array_equal(stages["max_force_time"].values, expected)
    assert not [name for name in stages.data_vars if name.startswith(("greatest", "least"))]
    assert_same_arrays(path)
    # Values that another program has packed are decoded.
    with netCDF4.Dataset(path, "a") as file:
        force = file["spring_force"]
        doubled = 2 * force[:]
        force.scale_factor = 2.0
    with files.opened_arrays(path) as tree:
        np.testing.assert_array_equal(tree["spring_force"].values, doubled)


def test_what_a_killed_process_left_behind_is_removed(tmp_path):
    """The folder in which nobody writes any more, and no other one."""
    dead = subprocess.Popen([sys.executable, "-c", ""])
    dead.wait()
    start, end = f".mesoslip-{platform.node()}-", f"-{'0' * 16}"
    left = tmp_path / f"{start}{dead.pid}{end}"
    locked = tmp_path / f"{start}{dead.pid}-{'1' * 16}"
    others = [
        locked,
        tmp_path / f"{start}{os.getpid()}{end}",
        tmp_path / f".mesoslip-elsewhere-{dead.pid}{end}",
        tmp_path / f"{start}{dead.pid}-mine",
        # A number that no process can have.
        tmp_path / f"{start}{10**30}{end}",
    ]
    for one in (left, *others):
        (one / "out.zarr").mkdir(parents=True)
        (one / "out.zarr" / "part").touch()
    link = tmp_path / f"{start}{dead.pid}-{'2' * 16}"
    link.symlink_to(others[1])
    # Of a process that is not seen from this container.
    number = os.open(locked, os.O_RDONLY)
    fcntl.flock(number, fcntl.LOCK_EX)
    try:
        targets.check_output(tmp_path / "out.nc")
    finally:
        os.close(number)
    assert sorted(tmp_path.iterdir()) == sorted([link, *others])
    assert all((one / "out.zarr" / "part").exists() for one in others)


def test_nobody_leads_a_file_that_is_written_elsewhere(tmp_path):
    """A neighbour who may write to the folder renames what is in it, and puts links there."""
    theirs = tmp_path / "theirs"
    theirs.mkdir()
    (theirs / "out.csv").write_text("precious")
    with targets.written_whole(tmp_path / "out.csv") as part:
        (private,) = tmp_path.glob(".mesoslip-*")
        assert private.stat().st_mode & 0o077 == 0
        private.rename(tmp_path / "moved")
        private.symlink_to(theirs)
        part.write_text("new")
        (tmp_path / "out.csv").symlink_to(theirs / "out.csv")
    assert (theirs / "out.csv").read_text() == "precious"
    assert (tmp_path / "out.csv").read_text() == "new"
    assert not (tmp_path / "out.csv").is_symlink()


def test_samples_of_a_slip_come_with_the_slip():
    """In the midst of a slip its samples are not yet those of one, however they were taken."""
    sliding = {"drive": {"velocity": 1e-5}, "run__duration": 0.1, "output__slip_interval": 1e-4}
    config = configuration("rigid", **sliding)
    whole = Realization(config, 0)
    counts = []
    while not whole.finished:
        whole.advance(1)
        assert np.all(whole.slip_trace[:, -1] < len(whole.slips))
        counts.append(len(whole.slips))
    assert counts[-1] > 1
    for number in range(counts[-1]):
        # Just before its end, when it is known to be a slip; in one piece with those before.
        part = Realization(config, 0)
        part.advance(counts.index(number + 1))
        assert len(part.slips) == number
        assert part.time > whole.slips[number, 2]
        expected = whole.slip_trace[whole.slip_trace[:, -1] < number]
        np.testing.assert_array_equal(part.slip_trace, expected)
