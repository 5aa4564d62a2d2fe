"""Configuration, groups and origin of an output in memory."""

from __future__ import annotations

from typing import TYPE_CHECKING, overload

from mesoslip.configuration.config import Config
from mesoslip.errors import ConfigError, FileError
from mesoslip.output.arrays import Arrays, Tree

if TYPE_CHECKING:
    import xarray as xr


def is_measured(tree: Tree) -> bool:
    """Whether an output is a measured trace, and no run."""
    return bool(tree.attrs.get("origin") == "measured")


def config_of(tree: Tree, name: str = "the output") -> Config:
    """The configuration of an output.

    Raises
    ------
    FileError
        If it has none of a run, as a measured trace read without one.
    """
    try:
        return Config.from_toml(tree.attrs["configuration"])
    except ConfigError:
        raise FileError(
            f"{name}: has no configuration of a run; if it is a measured trace, read it again with "
            "that of the experiment: mesoslip trace FILE.csv --config EXPERIMENT.toml"
        ) from None


@overload
def group_of(tree: xr.DataTree, name: str) -> xr.Dataset: ...


@overload
def group_of(tree: Tree, name: str) -> xr.Dataset | Arrays: ...


def group_of(tree: Tree, name: str) -> xr.Dataset | Arrays:
    """A group of an output alone, without the coordinates of the root that it does not use.

    So that `xarray.Dataset.to_dataframe` has a row for each row of the group, not for each pair of
    it and a time of the trace.
    """
    if isinstance(tree, Arrays):
        return tree.children[name]
    data = tree.children[name].to_dataset()
    return data[list(data.data_vars)]


def trace_suffixes(posterior: xr.DataTree) -> list[str]:
    """Suffixes of the groups of each trace of a fit: "" of the first, "_2" of the second."""
    found, number = [""], 2
    while f"observed_data_{number}" in posterior.children:
        found.append(f"_{number}")
        number += 1
    return found
