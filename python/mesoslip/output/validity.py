"""Checks that a file is an output that commands can use."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mesoslip.array_types import Dataset
from mesoslip.errors import FileError
from mesoslip.output import variables
from mesoslip.output.access import group_of, is_measured
from mesoslip.output.arrays import Arrays, Tree
from mesoslip.output.provenance import version

# Rows that are read at once.
MAX_ROWS = 2**20

# Dimensions and variables that commands need: of the root of a run, and of groups that it may have.
ROOT_NEEDS = tuple(variables.TRACE)[:6]

SLIPS = (("slip",), tuple(variables.SLIPS))

NEEDS = {
    "stages": (("stage",), tuple(variables.STAGES)),
    "slip_traces": (("sample",), ("realization_index", "sample_time", *ROOT_NEEDS)),
    "avalanches": (("avalanche",), tuple(variables.AVALANCHES)[:6]),
    "blocks": (("realization", "time", "block"), tuple(variables.BLOCKS)[2:6]),
    "ruptures": (("rupture",), tuple(variables.RUPTURES)),
    "fronts": (("front",), tuple(variables.FRONTS)),
    "snapshots": (("snapshot",), tuple(variables.SNAPSHOTS)[:7]),
}

# Times by group, and the ends of what starts then.
TIMES = {
    "": ("time", ""),
    "slips": ("start_time", "end_time"),
    "stages": ("stage_start_time", "stage_end_time"),
    "slip_traces": ("sample_time", ""),
    "avalanches": ("start_time", ""),
    "snapshots": ("snapshot_time", ""),
}


def check_signature(path: Path) -> None:
    """Refuse a file that is not netCDF-4, before a library opens it."""
    try:
        if not path.exists():
            raise FileError(f"{path}: no such file")
        if not path.is_file():
            raise FileError(f"{path}: is not a regular file")
        with path.open("rb") as file:
            start = file.read(8)
    except (OSError, ValueError) as error:
        raise FileError(f"{path}: cannot be read: {error}") from error
    if path.suffix == ".toml":
        raise FileError(
            f"{path}: is a configuration, not an output (netCDF); run it first: mesoslip run {path}"
        )
    if start != b"\x89HDF\r\n\x1a\n":
        is_table = path.suffix.lower() in {".csv", ".txt", ".dat", ".tsv"}
        hint = f"; mesoslip trace {path} makes an output of a table" if is_table else ""
        raise FileError(f"{path}: not an output (netCDF-4){hint}")


def check_output(tree: Tree, name: str | Path) -> None:
    """Refuse an output that lacks variables that commands use, or has them with other dimensions;
    and one whose rows cannot be right."""
    wrong = [
        f"attribute {one}"
        for one in ("configuration", "title", "comment", "complete")
        if not isinstance(tree.attrs.get(one, ""), str)
    ]
    if variables.has_force(tree.data_vars):
        wrong += _wrong_layout(tree)
    newer = _newer_version(tree.attrs.get("program_version"))
    if wrong and newer:
        raise FileError(f"{name}: is of {newer}, and cannot be read: {wrong[0]} is different")
    if wrong:
        raise FileError(f"{name}: a damaged output: {wrong[0]} is missing or wrong")
    check_rows(tree, name)


def check_rows(tree: Tree, name: str | Path) -> None:
    """Refuse an output, or a part of one, with rows of realizations that it does not have, or with
    times that go back."""
    wrong = _wrong_rows(tree)
    if wrong:
        raise FileError(f"{name}: a damaged output: {wrong[0]}")


def _wrong_layout(tree: Tree) -> list[str]:
    """Parts of the output of a run that are missing or of another form."""
    wrong = [] if "configuration" in tree.attrs else ["attribute configuration"]
    root, slips = ROOT_NEEDS, {"slips": SLIPS}
    if is_measured(tree):
        # Quantities that were not measured are absent.
        known = (*variables.TRACE, *variables.MEASURED)
        root = tuple(name for name in known if name in tree.data_vars)
        slips = {name: one for name, one in slips.items() if name in tree.children}
    needed = {"": (("realization", "time"), root), **slips}
    needed |= {name: one for name, one in NEEDS.items() if name in tree.children}
    if is_measured(tree) and "stages" in needed:
        needed["stages"] = (("stage",), tuple(variables.MEASURED_STAGES))
    for group, (dimensions, names) in needed.items():
        if group and group not in tree.children:
            wrong.append(f"group {group}")
            continue
        data = tree.children[group].to_dataset() if group else tree.to_dataset()
        wrong += [
            f"variable {group}/{name}"
            for name in names
            if name not in data
            or data[name].dims[: len(dimensions)] != dimensions
            or data[name].dtype.kind not in "fiu"
        ]
    if not {"realization", "time"} <= tree.coords.keys():
        wrong.append("coordinates realization and time")
    return wrong


def _wrong_rows(tree: Tree) -> list[str]:
    """Rows of realizations that the output does not have, and times that go back."""
    for group, (name, end) in TIMES.items():
        if group and group not in tree.children:
            continue
        data = group_of(tree, group) if group else tree.to_dataset()
        if name not in data or (group and "realization_index" not in data):
            continue
        if group and "realization" not in tree.sizes:
            return [f"dimension realization, of rows in {group}, is missing"]
        dimension = str(data[name].dims[0])
        names = [one for one in (name, end, *(["realization_index"] * bool(group))) if one in data]
        for start in range(0, data.sizes[dimension], MAX_ROWS):
            # The last row of the block before is compared with the first one of this block.
            rows = slice(max(start - 1, 0), start + MAX_ROWS)
            columns = {one: _part(data, one, dimension, rows) for one in names}
            wrong = _wrong_in_block(columns, group, rows.start, tree.sizes.get("realization", 0))
            if wrong:
                return wrong
    return []


def _part(data: Dataset | Arrays, name: str, dimension: str, rows: slice) -> NDArray[Any]:
    """Rows of a variable; all of them are kept for those who need them next."""
    if data.sizes[dimension] <= MAX_ROWS:
        return np.asarray(data[name].values)
    return np.asarray(data.variables[name].isel({dimension: rows}).values)


def _wrong_in_block(
    columns: Mapping[str, NDArray[Any]], group: str, first: int, count: int
) -> list[str]:
    """What is wrong with rows from the first one on, of an output with a number of realizations."""
    wrong: list[str] = []
    name, end = TIMES[group]
    times = columns[name]
    steps = np.diff(times)
    is_new = np.zeros(steps.shape, dtype=bool)
    if group:
        owners = columns["realization_index"]
        is_new = np.diff(owners) > 0
        is_wrong = ~((owners >= 0) & (owners < count))
        is_wrong[1:] |= np.diff(owners) < 0
        wrong += [
            f"{group}/realization_index is {owners[row]} in row {first + row}; expected the "
            f"indices of the {count} realizations in order"
            for row in np.flatnonzero(is_wrong)[:1]
        ]
    # Only rows of catalogues may have the same time, as in a drive that stands still.
    is_wrong = ~np.isfinite(times)
    is_wrong[1:] |= ~((steps >= 0 if group else steps > 0) | is_new)
    wrong += [
        f"{group}/{name} is {times[row]:.9g} s in row {first + row}".lstrip("/")
        + (f" after {times[row - 1]:.9g} s" if row else "")
        + "; expected times in order"
        for row in np.flatnonzero(is_wrong)[:1]
    ]
    if end in columns:
        wrong += [
            f"{group}/{end} is {columns[end][row]:.9g} s in row {first + row}, which starts at "
            f"{times[row]:.9g} s"
            for row in np.flatnonzero(~(columns[end] >= times))[:1]
        ]
    return wrong


def _newer_version(written: object) -> str:
    """The program that wrote a file if it is newer than this one; otherwise empty."""
    ours = version("mesoslip")
    theirs, here = ([int(one) for one in re.findall(r"\d+", str(text))] for text in (written, ours))
    if written is None or theirs <= here:
        return ""
    return f"mesoslip {written}, which is newer than this one ({ours})"
