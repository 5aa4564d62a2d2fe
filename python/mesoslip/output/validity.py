"""Checks that a file is an output that commands can use."""

from __future__ import annotations

import re
from pathlib import Path

from mesoslip.errors import FileError
from mesoslip.output import variables
from mesoslip.output.access import is_measured
from mesoslip.output.arrays import Tree
from mesoslip.output.provenance import version

# Dimensions and variables that commands need: of the root of a run, and of groups that it may have.
ROOT_NEEDS = tuple(variables.TRACE)[:6]

SLIPS = (("slip",), tuple(variables.SLIPS))

NEEDS = {
    "stages": (("stage",), tuple(variables.STAGES)),
    "slip_traces": (("sample",), ("realization_index", "sample_time", *ROOT_NEEDS)),
    "avalanches": (("avalanche",), tuple(variables.AVALANCHES)[:6]),
    "snapshots": (("snapshot",), tuple(variables.SNAPSHOTS)[:7]),
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
        hint = f"; mesoslip trace {path} makes an output of a table" if _is_table(path) else ""
        raise FileError(f"{path}: not an output (netCDF-4){hint}")


def _is_table(path: Path) -> bool:
    return path.suffix.lower() in {".csv", ".txt", ".dat", ".tsv"}


def check_layout(tree: Tree, path: Path) -> None:
    """Refuse an output without the variables that commands use, with their dimensions."""
    if "configuration" not in tree.attrs:
        raise FileError(f"{path}: not an output of mesoslip")
    wrong = [
        f"attribute {name}"
        for name in ("configuration", "title", "comment", "complete")
        if not isinstance(tree.attrs.get(name, ""), str)
    ]
    if variables.has_force(tree.data_vars):
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
    newer = _newer_version(tree.attrs.get("program_version"))
    if wrong and newer:
        raise FileError(f"{path}: is of {newer}, and cannot be read: {wrong[0]} is different")
    if wrong:
        raise FileError(f"{path}: a damaged netCDF-4 file: {wrong[0]} is missing or wrong")


def _newer_version(written: object) -> str:
    """The program that wrote a file if it is newer than this one; otherwise empty."""
    ours = version("mesoslip")
    theirs, here = ([int(one) for one in re.findall(r"\d+", str(text))] for text in (written, ours))
    if written is None or theirs <= here:
        return ""
    return f"mesoslip {written}, which is newer than this one ({ours})"
