"""What holds of every output, whatever was run."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import xarray as xr
from mesoslip import Config
from mesoslip.simulation.realization import ENDINGS

# What states when, and how long.
TIMES = {"kernel_seconds"}
TIME_ATTRIBUTES = {"history", "date_created", "wall_seconds"}

# Bound on the energy balance of runs that are followed to rounding.
EXACT = 1e-9

# What rounding may do to a sum, relative to its terms.
ROUNDING = 1e-9


def differences(one: xr.DataTree, other: xr.DataTree) -> list[str]:
    """Where two outputs differ in a bit, but for wall times."""
    found = []
    if {node.path for node in one.subtree} != {node.path for node in other.subtree}:
        return ["groups"]
    for node in one.subtree:
        mine, yours = node.to_dataset(inherit=False), other[node.path].to_dataset(inherit=False)
        if list(mine.variables) != list(yours.variables):
            found.append(f"variables of {node.path}")
            continue
        for name in set(mine.variables) - TIMES:
            a, b = mine[name].values, yours[name].values
            if (a.dtype, a.shape) != (b.dtype, b.shape) or a.tobytes() != b.tobytes():
                found.append(f"{node.path.rstrip('/')}/{name}")
    for name in set(one.attrs) - TIME_ATTRIBUTES:
        if one.attrs[name] != other.attrs.get(name):
            found.append(f"attribute {name}")
    return found


def promised_residual(config: Config) -> float:
    """What the energy balance of a kind of run may lack, relative to the work of the drive."""
    return max(config.contact_kind.residual_bound, config.slider.residual_bound(config))


def is_exact(config: Config) -> bool:
    """Whether the balance closes to rounding, so that nothing excuses what it lacks."""
    return promised_residual(config) <= EXACT


def energy_residual(tree: xr.DataTree) -> float:
    """What the energy balance lacks, relative to its largest term.

    An output states it relative to the work of the drive, which is next to nothing where the drive
    goes back and forth.
    """
    terms = np.array([np.abs(tree["energy"][name].values) for name in tree["energy"].data_vars])
    work = np.abs(tree["energy/drive_work"].values)
    printed = np.abs(tree["energy_residual"].values)
    # A balance of less than can be written down is that of nothing.
    largest = np.maximum(terms.max(axis=0), 1e-300)
    return float(np.max(printed * np.where(work > 0, work, largest) / largest))


def broken(tree: xr.DataTree, config: Config) -> Iterator[str]:
    """What does not hold of a complete output."""
    if tree.attrs["complete"] != "true":
        yield "incomplete: attribute complete"
    yield from _not_finite(tree)
    yield from _wrong_trace(tree, config)
    residual, promised = energy_residual(tree), promised_residual(config)
    if residual > promised and (is_exact(config) or tree.attrs["audit"] == "passed"):
        yield f"energy: residual {residual:.2g}, at most {promised:g}, and nothing said"
    yield from _wrong_slips(tree, config)
    yield from _wrong_stages(tree, config)
    if "avalanches" in tree.children:
        yield from _wrong_avalanches(tree, config)


def site_count(config: Config) -> int:
    """Contacts at the maximum of the normal load."""
    return config.pressing.site_count(config.contacts.count)


def _not_finite(tree: xr.DataTree) -> Iterator[str]:
    lengths = _lengths(tree)
    for node in tree.subtree:
        data = node.to_dataset(inherit=False)
        for name, variable in data.variables.items():
            values = variable.values
            if values.dtype.kind != "f":
                continue
            wrong = ~np.isfinite(values)
            if variable.dims[:2] == ("realization", "time"):
                # Realizations that end before others are missing from there on.
                for number, length in enumerate(lengths):
                    if not np.isnan(values[number, length:]).all():
                        yield f"finite: {name} after the end of a realization"
                    wrong[number, length:] = False
            elif node.name == "snapshots" and name in {"stretch", "load"}:
                wrong &= data["pinned"].values == 1
            if name == "friction_coefficient":
                # There is none without a load.
                wrong &= data["normal_force"].values != 0
            if wrong.any():
                yield f"finite: {node.path.rstrip('/')}/{name}, {wrong.sum()} values"
    for name, value in tree.attrs.items():
        if isinstance(value, float | np.floating) and not np.isfinite(value):
            yield f"finite: attribute {name}"


def _lengths(tree: xr.DataTree) -> list[int]:
    """Samples of each realization."""
    there = np.isfinite(tree["spring_force"].values)
    return [int(np.max(np.nonzero(one)[0], initial=-1)) + 1 for one in there]


def _wrong_trace(tree: xr.DataTree, config: Config) -> Iterator[str]:
    time = tree["time"].values
    if time.size == 0 or time[0] != 0:
        yield "trace: does not start at 0"
        return
    if np.any(np.diff(time) <= 0):
        yield "trace: times do not grow"
    duration, interval = config.duration, config.output_interval
    if time[-1] > duration * (1 + ROUNDING):
        yield f"trace: goes on to {time[-1]:g} s, beyond {duration:g} s"
    if tree.attrs["ending"] == ENDINGS["drive"] and time[-1] < duration - interval * (1 + 1e-6):
        yield f"trace: ends at {time[-1]:g} s, before {duration:g} s"
    detached, count = tree["detached_contacts"].values, site_count(config)
    slack = 0 if config.contact_kind.is_discrete else ROUNDING * count
    if np.nanmin(detached) < -slack or np.nanmax(detached) > count + slack:
        yield f"contacts: {np.nanmin(detached):g} to {np.nanmax(detached):g} of {count} detached"


def _owned(data: xr.Dataset, tree: xr.DataTree) -> Iterator[tuple[int, xr.Dataset]]:
    """The rows of a catalogue by realization."""
    dimension = str(data["realization_index"].dims[0])
    for number in range(tree.sizes["realization"]):
        yield number, data.isel({dimension: data["realization_index"].values == number})


def _wrong_slips(tree: xr.DataTree, config: Config) -> Iterator[str]:
    slips = tree["slips"].to_dataset(inherit=False)
    yield from _wrong_owners(slips, tree, "slips")
    slack = ROUNDING * max(1.0, float(tree["breaks"].values.max()))
    directions = set[float]().union(*(part.directions for part in config.drive_parts))
    for number, mine in _owned(slips, tree):
        start, end = mine["start_time"].values, mine["end_time"].values
        if np.any(end < start):
            yield "slips: one ends before it starts"
        if np.any(start[1:] < end[:-1]):
            yield "slips: one starts before another ends"
        if start.size and (start[0] < 0 or end[-1] > config.duration * (1 + ROUNDING)):
            yield "slips: one is not within the run"
        counts = mine["contacts_broken"].values
        if np.any(counts < 0) or counts.sum() > tree["breaks"].values[number] + slack:
            yield f"slips: {counts.sum():g} breaks of {tree['breaks'].values[number]:g}"
        drops = mine["force_drop"].values
        least = ROUNDING * config.contacts.static_force
        one_way = len(config.drive_parts) == len(directions) == 1
        if one_way and np.any(drops * min(directions) < -least):
            yield f"slips: a drop against the drive, {drops.min():g} to {drops.max():g} N"
        if np.any(mine["peak_velocity"].values == 0):
            yield "slips: one does not move"
    if "slip_traces" in tree.children:
        yield from _wrong_slip_traces(tree, slips)


def _wrong_stages(tree: xr.DataTree, config: Config) -> Iterator[str]:
    stages = tree["stages"].to_dataset(inherit=False)
    yield from _wrong_owners(stages, tree, "stages")
    slack = ROUNDING * max(
        config.contacts.static_force,
        float(np.max(np.abs(stages["max_force"].values), initial=0.0)),
    )
    for _, mine in _owned(stages, tree):
        start, end = mine["stage_start_time"].values, mine["stage_end_time"].values
        if np.any(end < start) or np.any(start[1:] != end[:-1]):
            yield "stages: one does not follow on another"
        least, greatest = mine["min_force"].values, mine["max_force"].values
        for name in ("start_force", "mean_force", "end_force"):
            force = mine[name].values
            if np.any(force < least - slack) or np.any(force > greatest + slack):
                yield f"stages: {name} is beyond the extremes"
        for name in ("min_force_time", "max_force_time"):
            time = mine[name].values
            if np.any(time < start) or np.any(time > end):
                yield f"stages: {name} is outside the stage"


def _wrong_slip_traces(tree: xr.DataTree, slips: xr.Dataset) -> Iterator[str]:
    samples = tree["slip_traces"].to_dataset(inherit=False)
    yield from _wrong_owners(samples, tree, "slip_traces")
    for number, mine in _owned(samples, tree):
        count = int((slips["realization_index"].values == number).sum())
        slip, time = mine["slip"].values, mine["sample_time"].values
        if np.any(slip < 0) or np.any(slip >= count) or np.any(np.diff(slip) < 0):
            yield "slip traces: not those of the slips"
        if np.any((np.diff(time) <= 0) & (np.diff(slip) == 0)):
            yield "slip traces: times do not grow"


def _wrong_owners(data: xr.Dataset, tree: xr.DataTree, name: str) -> Iterator[str]:
    owners = data["realization_index"].values
    if np.any(np.diff(owners) < 0) or np.any((owners < 0) | (owners >= tree.sizes["realization"])):
        yield f"{name}: of no realization, or not in their order"


def _wrong_avalanches(tree: xr.DataTree, config: Config) -> Iterator[str]:
    catalogue = tree["avalanches"].to_dataset(inherit=False)
    yield from _wrong_owners(catalogue, tree, "avalanches")
    least = config.output.avalanche_size or 1
    count = site_count(config)
    for number, mine in _owned(catalogue, tree):
        time, size = mine["start_time"].values, mine["size"].values
        if np.any(np.diff(time) < 0):
            yield "avalanches: not in the order of time"
        if np.any(size < least):
            yield "avalanches: one is too small"
        breaks = int(tree["breaks"].values[number])
        is_endless = ENDINGS["slides"] in tree.attrs["ending"]
        if size.sum() > breaks or (least == 1 and not is_endless and size.sum() != breaks):
            yield f"avalanches: {size.sum()} breaks of {breaks}"
        if least == 1 and len(size) != tree["avalanche_count"].values[number]:
            yield f"avalanches: {len(size)} of {tree['avalanche_count'].values[number]}"
        if config.run.avalanches is not None and len(size) > config.run.avalanches:
            yield "avalanches: more than wanted"
        if "area" in mine:
            area = mine["area"].values
            sides = (config.interaction.columns, config.interaction.rows)  # type: ignore[union-attr]
            if np.any((area < 1) | (area > np.minimum(size, count))):
                yield "avalanches: area"
            for name, most in zip(("width", "height"), sides, strict=True):
                if np.any((mine[name].values < 1) | (mine[name].values > most)):
                    yield f"avalanches: {name}"
            if np.any((mine["generations"].values < 1) | (mine["generations"].values > size)):
                yield "avalanches: generations"


def left_over(folder: Path, wanted: set[str]) -> list[str]:
    """Names in a folder that should not be there, such as parts of files."""
    return sorted(path.name for path in folder.iterdir() if path.name not in wanted)
