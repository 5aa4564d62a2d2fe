"""Output files: netCDF-4 with the layout that `mesoslip.run` returns in memory."""

from __future__ import annotations

import os
import platform
from collections.abc import Iterable, Sequence
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from mesoslip import _build, _core
from mesoslip.configuration.config import Config
from mesoslip.configuration.contacts.tables import Interaction
from mesoslip.errors import FileError
from mesoslip.simulation import tables as engine

if TYPE_CHECKING:
    from mesoslip.simulation.realization import Realization
    from mesoslip.simulation.tables import Array

# Name: units, long name.
VARIABLES = {
    "time": ("s", "time"),
    "drive_displacement": ("m", "displacement of the drive"),
    "displacement": ("m", "displacement of the slider"),
    "velocity": ("m s-1", "velocity of the slider"),
    "spring_force": ("N", "force of the drive on the slider"),
    "contact_force": ("N", "force of the slider on the contacts"),
    "detached_contacts": ("1", "number of detached contacts"),
    "elastic_force": ("N", "mean elastic force in the slider, K (X_d - X_1)"),
    "base_displacement": ("m", "displacement of the base"),
    "layer_displacement": ("m", "displacement of a layer"),
    "layer": ("1", "number of the layer, 1 at the contacts"),
    "realization": ("1", "number of the realization"),
    "slip": ("1", "number of the slip within its realization"),
    "start_time": ("s", "time of the greatest spring force before the slip"),
    "end_time": ("s", "time of the least spring force after the slip"),
    "force_before": ("N", "spring force at the start of the slip"),
    "force_after": ("N", "spring force at the end of the slip"),
    "force_drop": ("N", "drop of the spring force in the slip"),
    "peak_velocity": ("m s-1", "greatest velocity of the slider in the slip"),
    "contacts_broken": ("1", "breaks of contacts in the slip"),
    "breaks": ("1", "breaks of contacts in the run"),
    "avalanche_count": ("1", "number of avalanches in the run"),
    "avalanche_slip": ("m", "displacement of the slider in avalanches, the drive standing still"),
    "end_displacement": ("m", "displacement of the slider at the end of the run"),
    "size": ("1", "breaks of contacts in the avalanche"),
    "area": ("1", "contacts that broke in the avalanche, each counted once"),
    "width": ("1", "columns of the smallest rectangle around the avalanche"),
    "height": ("1", "rows of the smallest rectangle around the avalanche"),
    "generations": ("1", "steps in which the contacts of the avalanche pushed over each other"),
    "spans": ("1", "whether the avalanche leaves no column, or no row, untouched"),
    "pinned": ("1", "whether the contact is pinned"),
    "load": ("1", "force that breaks the contact over its threshold"),
    "generation": ("1", "step of the avalanche in which the contact broke, 0 if it did not"),
    "avalanche_size": ("1", "breaks in the avalanche before the snapshot, 0 at a chosen time"),
    "x": ("m", "place of the contact along a row"),
    "y": ("m", "place of the contact across the rows"),
    "energy_residual": ("1", "what the energy balance lacks, relative to the work of the drive"),
    "kernel_seconds": ("s", "computing time of the kernel"),
    "drive_work": ("J", "work done by the drive"),
    "slider_energy": ("J", "energy of the slider and its spring at the end"),
    "contact_energy": ("J", "elastic energy of the contacts at the end"),
    "damping_loss": ("J", "energy lost to the damping of the setup"),
    "drag_loss": ("J", "energy lost to the drag of detached contacts"),
    "break_loss": ("J", "elastic energy lost by breaking contacts"),
    "birth_gain": ("J", "elastic energy of contacts at their attaching"),
    "slope": ("N m-1", "derivative of the contact force by the displacement"),
    "contact_stiffness": ("N m-1", "stiffness of the pinned contacts"),
    "break_rate": ("m-1", "breaks of a contact over displacement"),
    "potential": ("J", "effective potential of the slider"),
    "curvature": ("N m-2", "second derivative of the contact force by the displacement"),
    "third_derivative": ("N m-3", "third derivative of the contact force by the displacement"),
    "D0": ("1", "contact force at the onset of slip over the static force"),
    "D2": ("1", "second-order coefficient of the onset of slip, Eq. S46"),
    "D3": ("1", "third-order coefficient of the onset of slip, Eq. S46"),
    "stretch": ("m", "stretch of a contact"),
    "stretch_density": ("m-1", "density of stretches, without contacts that have not broken yet"),
    "unbroken_part": ("1", "part of the contacts that bear the stretch of a relaxed start"),
    "density_displacement": ("m", "displacement of the slider"),
    "onset_time": ("1", "time since the onset of slip times the setup frequency"),
    "onset_displacement": ("1", "displacement since the onset times the spring over static force"),
    "onset_velocity": ("1", "derivative of the displacement since the onset by the time"),
    "onset_mean_velocity": ("1", "running mean of that velocity"),
    "relative_force_drop": ("1", "change of the spring force since the onset over static force"),
    "asymptote": ("1", "change of the spring force at short times over static force"),
}


# What some variables mean in the catalogue of avalanches.
AVALANCHE_NAMES = {
    "time": "time at which the first contact broke",
    "displacement": "displacement of the slider at which the first contact broke",
    "force_before": "force of the pinned contacts before the avalanche, without drag",
    "force_drop": "drop of the force of the pinned contacts in the avalanche",
    "slip": "displacement of the slider in the avalanche",
}

# What the output of each command holds.
SUMMARIES = {
    "run": "A slider pulled over contacts with random breaking thresholds, simulated with the "
    "earthquake-like model of multicontact friction or its master equation",
    "curve": "Force of infinitely many contacts with random breaking thresholds under a slider "
    "that moves forward slowly, from the master equation of multicontact friction",
    "onset": "Onset of the slip of a slider on contacts with random breaking thresholds, for "
    "contacts that break one after another and for a film that melts at once",
}


def variable(name: str, dimensions: Sequence[str], values: Any) -> xr.Variable:
    """A variable with its units and long name."""
    units, long_name = VARIABLES[name]
    return xr.Variable(dimensions, values, {"units": units, "long_name": long_name})


def build(
    config: Config, realizations: Sequence[Realization], *, complete: bool, wall_seconds: float
) -> xr.DataTree:
    """Put the results of a run together.

    Returns
    -------
    xarray.DataTree
        Root: the trace, dimensions (realization, time), and figures for each realization. Groups:
        ``slips`` (slip), ``slip_traces`` (sample), ``energy`` (realization). What an interrupted
        run did not come to is NaN in the trace.
    """
    traces = [one.trace for one in realizations]
    longest = max(traces, key=len)
    columns = engine.TRACE_COLUMNS
    samples = np.full((len(columns), len(traces), len(longest)), np.nan)
    for number, trace in enumerate(traces):
        samples[:, number, : len(trace)] = trace.T
    each = ("realization",)
    root = xr.Dataset(
        {
            name: variable(name, ("realization", "time"), samples[column])
            for column, name in enumerate(columns)
            if name in recorded(config)
        }
        | {
            "breaks": variable("breaks", each, [one.breaks for one in realizations]),
            "energy_residual": variable(
                "energy_residual", each, [one.energy_residual for one in realizations]
            ),
            "kernel_seconds": variable(
                "kernel_seconds", each, [one.kernel_seconds for one in realizations]
            ),
        }
        | (avalanche_totals(realizations) if config.has_avalanches else {}),
        coords={
            "realization": variable("realization", each, [one.number for one in realizations]),
            "time": variable("time", ("time",), longest[:, 0]),
        },
        attrs=attributes(config, realizations, complete=complete, wall_seconds=wall_seconds),
    )
    if config.output.layers:
        root = root.merge(layer_displacements(realizations))
    # Where realizations end at different times, the shorter ones are filled with NaN.
    if config.contact_kind.is_discrete and np.isfinite(root["detached_contacts"]).all():
        root["detached_contacts"] = root["detached_contacts"].astype(np.int32)

    groups = {"slips": slip_catalogue(realizations), "energy": energy_balance(realizations)}
    if config.output.slip_interval is not None and config.slider.slip_velocity(config) > 0:
        groups["slip_traces"] = slip_traces(config, realizations)
    if config.has_avalanches:
        groups["avalanches"] = avalanche_catalogue(config, realizations)
    if config.output.snapshots or config.output.snapshot_size:
        groups["snapshots"] = snapshots(config, realizations)
    if config.contact_kind.is_discrete:
        for group, name in (("slips", "contacts_broken"), ("slip_traces", "detached_contacts")):
            if group in groups:
                groups[group][name] = groups[group][name].astype(np.int64)
    return xr.DataTree(root, children={name: xr.DataTree(data) for name, data in groups.items()})


def recorded(config: Config) -> tuple[str, ...]:
    """Names of the traces that an output of a configuration has, without the time."""
    return engine.TRACE_COLUMNS[1:7] + config.slider.extra_traces


def layer_displacements(realizations: Sequence[Realization]) -> xr.Dataset:
    """Displacements of the layers at the samples of the trace."""
    traces = [one.layer_trace for one in realizations]
    longest = max(len(trace) for trace in traces)
    values = np.full((len(traces), longest, traces[0].shape[1]), np.nan)
    for number, trace in enumerate(traces):
        values[number, : len(trace)] = trace
    return xr.Dataset(
        {
            "layer_displacement": variable(
                "layer_displacement", ("realization", "time", "layer"), values
            )
        },
        coords={"layer": variable("layer", ("layer",), np.arange(1, values.shape[2] + 1))},
    )


def slip_catalogue(realizations: Sequence[Realization]) -> xr.Dataset:
    """All slips of all realizations, dimension ``slip``."""
    # As a coordinate, here and below, the realization is not hidden by that of the root.
    rows = np.concatenate([one.slips for one in realizations])
    owner = np.concatenate([np.full(len(one.slips), one.number) for one in realizations])
    values = dict(zip(engine.SLIP_COLUMNS, rows.T, strict=True))
    values["force_drop"] = values["force_before"] - values["force_after"]
    order = ("start_time", "end_time", "force_before", "force_after", "force_drop", "peak_velocity")
    return xr.Dataset(
        {"realization": variable("realization", ("slip",), owner)}
        | {name: variable(name, ("slip",), values[name]) for name in order}
        | {"contacts_broken": variable("contacts_broken", ("slip",), values["contacts_broken"])}
    ).set_coords("realization")


def avalanche_totals(realizations: Sequence[Realization]) -> dict[str, xr.Variable]:
    """What each realization had of avalanches, those among them that are not in the catalogue."""
    totals = {
        "avalanche_count": [one.avalanche_count for one in realizations],
        "avalanche_slip": [one.avalanche_slip for one in realizations],
        "end_displacement": [one.displacement for one in realizations],
    }
    return {name: variable(name, ("realization",), values) for name, values in totals.items()}


def avalanche_catalogue(config: Config, realizations: Sequence[Realization]) -> xr.Dataset:
    """All avalanches of all realizations, dimension ``avalanche``."""
    rows = np.concatenate([one.avalanches for one in realizations])
    owner = np.concatenate([np.full(len(one.avalanches), one.number) for one in realizations])
    names = ["time", "displacement", "size", "force_before", "force_drop"]
    if config.slider.jumps:
        names.append("slip")
    if config.interaction is not None:
        names += ["area", "width", "height", "generations"]
    data = {}
    for column, name in enumerate(engine.AVALANCHE_COLUMNS):
        if name in names:
            is_count = name in {"size", "area", "width", "height", "generations"}
            values = rows[:, column].astype(np.int64 if is_count else np.float64)
            data[name] = variable(name, ("avalanche",), values)
    # The slip of an avalanche is a way, other than the number of a slip elsewhere.
    for name, long_name in AVALANCHE_NAMES.items():
        if name in data:
            data[name].attrs["long_name"] = long_name
    if "slip" in data:
        data["slip"].attrs["units"] = "m"
    if config.interaction is not None:
        spans = data["width"].values == config.interaction.columns
        spans |= data["height"].values == config.interaction.rows
        data["spans"] = variable("spans", ("avalanche",), spans.astype(np.int8))
    data["realization"] = variable("realization", ("avalanche",), owner)
    return xr.Dataset(data).set_coords(["realization", "time"])


def snapshots(config: Config, realizations: Sequence[Realization]) -> xr.Dataset:
    """The contacts on their lattice, dimensions ``snapshot``, ``row``, ``column``."""
    interaction = config.interaction
    assert interaction is not None
    assert config.contacts.area is not None
    places = np.concatenate([one.snapshot_places for one in realizations])
    owner = np.concatenate([np.full(len(one.snapshot_places), one.number) for one in realizations])
    values = np.concatenate([one.snapshots for one in realizations])
    shape = (len(values), interaction.rows, interaction.columns)
    stretch, load, generation = (values[..., part].reshape(shape) for part in range(3))
    pinned = np.isfinite(stretch)
    spacing = np.sqrt(config.contacts.area / config.contacts.count)
    x, y = lattice_places(interaction)
    where = ("snapshot", "row", "column")
    return xr.Dataset(
        {
            "stretch": variable("stretch", where, stretch),
            "load": variable("load", where, np.where(pinned, load, np.nan)),
            "pinned": variable("pinned", where, pinned.astype(np.int8)),
            "generation": variable("generation", where, generation.astype(np.int32)),
            "displacement": variable("displacement", ("snapshot",), places[:, 1]),
            "avalanche_size": variable(
                "avalanche_size", ("snapshot",), places[:, 2].astype(np.int64)
            ),
        },
        coords={
            "realization": variable("realization", ("snapshot",), owner),
            "time": variable("time", ("snapshot",), places[:, 0]),
            "x": variable("x", ("row", "column"), spacing * x),
            "y": variable("y", ("row", "column"), spacing * y),
        },
    )


def lattice_places(interaction: Interaction) -> tuple[Array, Array]:
    """Places of the contacts in units of their distance, each of shape (rows, columns)."""
    row, column = np.indices((interaction.rows, interaction.columns), dtype=float)
    if interaction.lattice == "square":
        return column, row
    return column + 0.5 * (row % 2), row * np.sqrt(0.75)


def slip_traces(config: Config, realizations: Sequence[Realization]) -> xr.Dataset:
    """The finer traces of all slips one after another, dimension ``sample``."""
    rows = np.concatenate([one.slip_trace for one in realizations])
    owner = np.concatenate([np.full(len(one.slip_trace), one.number) for one in realizations])
    data = {
        name: variable(name, ("sample",), rows[:, column])
        for column, name in enumerate(engine.TRACE_COLUMNS)
        if name == "time" or name in recorded(config)
    }
    data["slip"] = variable("slip", ("sample",), rows[:, -1].astype(np.int32))
    data["realization"] = variable("realization", ("sample",), owner)
    return xr.Dataset(data).set_coords(["realization", "slip", "time"])


def energy_balance(realizations: Sequence[Realization]) -> xr.Dataset:
    """The terms of the energy balance of each realization, from the start of the run [J]."""
    terms = np.array([one.energy for one in realizations]).T
    return xr.Dataset(
        {
            name: variable(name, ("realization",), terms[column])
            for column, name in enumerate(engine.ENERGY_COLUMNS)
            if name != "residual"
        }
    )


def attributes(
    config: Config, realizations: Sequence[Realization], *, complete: bool, wall_seconds: float
) -> dict[str, Any]:
    """Attributes of an output: what was run, by what, and how it went."""
    reached = min(one.time for one in realizations)
    residual: float = max((one.energy_residual for one in realizations), key=abs)
    solver = {}
    solver_name = config.slider.solver_name(config)
    if solver_name is not None:
        counts = np.sum([one.integrator_counts for one in realizations], axis=0)
        solver = {
            "solver": solver_name,
            "solver_steps": int(counts[0]),
            "solver_evaluations": int(counts[1]),
            "solver_failed_steps": int(counts[2]),
        }
    return (
        program_attributes(config, "run")
        | solver
        | {
            "seed": config.run.seed,
            "complete": "true" if complete else "false",
            "comment": ""
            if complete
            else f"interrupted; every realization came to {reached:.6g} s",
            "break_count": sum(one.breaks for one in realizations),
            "ending": "; ".join(sorted({one.ending for one in realizations})),
            "advance_count": sum(one.advances for one in realizations),
            "energy_residual": residual,
            "wall_seconds": wall_seconds,
        }
    )


def program_attributes(config: Config, command: str) -> dict[str, Any]:
    """Attributes of every output: what was computed, by what."""
    now = datetime.now(UTC).isoformat(timespec="seconds")
    program = f"mesoslip {version('mesoslip')}"
    return {
        "Conventions": "CF-1.11, ACDD-1.3",
        "title": config.title or "Stick-slip of a multicontact interface",
        "summary": SUMMARIES[command],
        "keywords": "friction, stick-slip, multicontact interface, earthquake-like model",
        "source": program,
        "history": f"{now} {program}: {command}",
        "date_created": now,
        "configuration": config.to_toml(),
        "program_version": version("mesoslip"),
        "commit": _build.COMMIT,
        "compiler": _build.COMPILER,
        "library_versions": ", ".join(
            [f"python {platform.python_version()}", f"SUNDIALS {_core.sundials().decode()}"]
            + [f"{name} {version(name)}" for name in ("numpy", "xarray", "netCDF4", "pydantic")]
        ),
    }


def check_writable(path: Path) -> None:
    """Make sure, before a run, that its output can be written.

    Raises
    ------
    FileError
        If the path is a directory, or its folder cannot be made or written to.
    """
    if path.is_dir():
        raise FileError(
            f"{path}: is a directory; give the name of a file such as {path / 'out.nc'}"
        )
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        probe = path.with_name(f".{path.name}.{os.getpid()}")
        probe.touch()
        probe.unlink()
    except OSError as error:
        raise FileError(f"{path}: cannot be written: {error.strerror}") from error


def write(tree: xr.DataTree, path: Path) -> None:
    """Write an output; its name appears only when it is whole.

    Raises
    ------
    FileError
        If it cannot be written.
    """
    part = path.with_name(f".{path.name}.{os.getpid()}")
    encoding = {
        group.path: {
            name: {"zlib": True, "complevel": 1, "shuffle": True}
            for name, data in group.data_vars.items()
            if data.size > 1000
        }
        for group in tree.subtree
    }
    try:
        tree.to_netcdf(part, engine="netcdf4", encoding=encoding)
        part.replace(path)
    except OSError as error:
        raise FileError(f"{path}: cannot be written: {error.strerror or error}") from error
    finally:
        part.unlink(missing_ok=True)


def read(path: str | Path) -> xr.DataTree:
    """Read an output of any command into memory.

    Raises
    ------
    FileError
        If there is no such file, or it is not an output of mesoslip, or it is damaged.
    """
    path = Path(path)
    if path.is_dir():
        raise FileError(f"{path}: is a directory, not an output file")
    if not path.exists():
        raise FileError(f"{path}: no such file")
    try:
        with xr.open_datatree(path, engine="netcdf4") as tree:
            tree = tree.load()
    except (OSError, ValueError, RuntimeError) as error:
        raise FileError(f"{path}: not a netCDF-4 file, or a damaged one") from error
    if "configuration" not in tree.attrs:
        raise FileError(f"{path}: not an output of mesoslip")
    return tree


def read_run(path: str | Path) -> xr.DataTree:
    """Read an output of ``mesoslip run`` into memory; see `read`."""
    tree = read(path)
    if "spring_force" not in tree.data_vars:
        raise FileError(f"{path}: not an output of mesoslip run")
    return tree


def configuration(path: Path, overrides: Iterable[str] = ()) -> Config:
    """The configuration of an output, to run it again, with changes laid over it."""
    return Config.from_toml(read(path).attrs["configuration"], str(path), overrides)
