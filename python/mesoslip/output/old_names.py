"""Names of variables in files of earlier versions."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

from mesoslip.array_types import Dataset
from mesoslip.output import variables

# Present names by earlier name, by group.
OLD_NAMES = {
    "slips": {"realization": "realization_index"},
    "slip_traces": {"realization": "realization_index", "time": "sample_time"},
    "stages": {
        f"{before}_force{end}": f"{now}_force{end}"
        for before, now in (("greatest", "max"), ("least", "min"))
        for end in ("", "_time", "_displacement")
    },
    "avalanches": {"realization": "realization_index", "time": "start_time"},
    "snapshots": {"realization": "realization_index", "time": "snapshot_time"},
    "critical": {"displacement": "critical_displacement"},
}

GROUPS = {
    "slips": variables.SLIPS,
    "stages": variables.STAGES,
    "slip_traces": variables.SLIP_TRACES,
    "avalanches": variables.AVALANCHES,
    "snapshots": variables.SNAPSHOTS,
    "critical": variables.CRITICAL,
}


def present_names(
    group: str, variables: Collection[Any], dimensions: Collection[Any]
) -> dict[str, str]:
    """The present names of variables whose names have changed, by their names in the file."""
    return {
        before: now
        for before, now in OLD_NAMES.get(group, {}).items()
        if before in variables and before not in dimensions
    }


def attributes_of(group: str, name: str) -> dict[str, str]:
    """Attributes of a renamed variable, by its present name."""
    return GROUPS[group][name].attributes


def renamed(name: str, data: Dataset) -> Dataset:
    """A group of a file with present names of variables."""
    old = present_names(name, data.variables, data.dims)
    if not old:
        return data
    data = data.rename(old).reset_coords(
        [now for now in old.values() if now in {"realization_index", "start_time"}]
    )
    for now in old.values():
        data[now].attrs = attributes_of(name, now)
    return data
