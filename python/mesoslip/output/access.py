"""Origin, configuration and groups of an output in memory."""

from __future__ import annotations

from typing import overload

from mesoslip.array_types import Dataset, DataTree
from mesoslip.configuration.config import Config
from mesoslip.errors import ConfigError, FileError
from mesoslip.output.arrays import Arrays, Tree


def is_measured(tree: Tree) -> bool:
    """Whether an output is a measured trace instead of a run."""
    return bool(tree.attrs.get("origin") == "measured")


def config_of(tree: Tree, name: str = "the output") -> Config:
    """The configuration of a run; raises a `FileError` for a measured trace that was read without
    a configuration."""
    try:
        return Config.from_toml(tree.attrs["configuration"])
    except ConfigError:
        raise FileError(
            f"{name}: has no configuration of a run; if it is a measured trace, read it again with "
            "that of the experiment: mesoslip trace FILE.csv --config EXPERIMENT.toml"
        ) from None


@overload
def group_of(tree: DataTree, name: str) -> Dataset: ...


@overload
def group_of(tree: Tree, name: str) -> Dataset | Arrays: ...


def group_of(tree: Tree, name: str) -> Dataset | Arrays:
    """A group of an output, without the coordinates of the root, which would repeat its rows in a
    table."""
    if isinstance(tree, Arrays):
        return tree.children[name]
    data = tree.children[name].to_dataset()
    return data[list(data.data_vars)]


def trace_suffixes(posterior: DataTree) -> list[str]:
    """Suffixes of the groups of the traces of a fit: "" for the first, "_2" for the second."""
    found, number = [""], 2
    while f"observed_data_{number}" in posterior.children:
        found.append(f"_{number}")
        number += 1
    return found
