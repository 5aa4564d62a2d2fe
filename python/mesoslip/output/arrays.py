"""Outputs as plain arrays, for commands that do without xarray, which is slow to import.

Groups and variables have the part of xarray's interface that these commands need. Variables are in
a file (`Stored`) or in memory (`Values`).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

from mesoslip.array_types import DataTree
from mesoslip.output.hdf5 import LOCK
from mesoslip.output.old_names import attributes_of, present_names

if TYPE_CHECKING:
    import netCDF4

Array = NDArray[Any]

# Attributes of variables whose stored values must be decoded.
ENCODINGS = {"missing_value", "scale_factor", "add_offset", "_Unsigned"}


class Variable(Protocol):
    """A variable of a group."""

    @property
    def dims(self) -> tuple[str, ...]: ...

    @property
    def values(self) -> Array: ...

    @property
    def attrs(self) -> Mapping[str, Any]: ...

    @property
    def dtype(self) -> np.dtype[Any]: ...

    def isel(self, part: Mapping[str, Any] | None = None, **by_name: Any) -> Variable:
        """A part of it, by indices along dimensions that are not indexed yet."""

    def __getitem__(self, index: Any) -> Variable:
        """A part of it, by one index or a tuple of them along the first dimensions."""


@dataclass(frozen=True)
class Values:
    """A variable in memory; see `Variable`."""

    dims: tuple[str, ...]
    values: Array
    attrs: Mapping[str, Any]

    @property
    def dtype(self) -> np.dtype[Any]:
        return self.values.dtype

    def isel(self, part: Mapping[str, Any] | None = None, **by_name: Any) -> Values:
        part = {**(part or {}), **by_name}
        return self[tuple(part.get(one, slice(None)) for one in self.dims)]

    def __getitem__(self, index: Any) -> Values:
        indices = index if isinstance(index, tuple) else (index,)
        remaining = tuple(
            name
            for number, name in enumerate(self.dims)
            if number >= len(indices) or not isinstance(indices[number], int | np.integer)
        )
        return Values(remaining, np.asarray(self.values[indices]), self.attrs)


@dataclass(frozen=True)
class Stored:
    """A variable in a file, or the part with the indices ``part``, whose values are read when
    needed; see `Variable`."""

    stored: netCDF4.Variable[Any]
    attrs: Mapping[str, Any]
    part: Mapping[str, Any] = field(default_factory=dict)

    @property
    def dims(self) -> tuple[str, ...]:
        names = self.stored.dimensions
        return tuple(one for one in names if not isinstance(self.part.get(one), int | np.integer))

    @property
    def dtype(self) -> np.dtype[Any]:
        found: np.dtype[Any] = self.stored.dtype
        return found

    @cached_property
    def values(self) -> Array:
        index = tuple(self.part.get(one, slice(None)) for one in self.stored.dimensions)
        with LOCK:
            # The library refuses an empty index, which a variable without dimensions has.
            return np.asarray(self.stored[index or ...])

    def isel(self, part: Mapping[str, Any] | None = None, **by_name: Any) -> Stored:
        part = {**(part or {}), **by_name}
        assert not self.part.keys() & part.keys()
        own = {name: index for name, index in part.items() if name in self.stored.dimensions}
        # The values of a variable without these dimensions are not read again.
        return Stored(self.stored, self.attrs, {**self.part, **own}) if own else self

    def __getitem__(self, index: Any) -> Stored:
        indices = index if isinstance(index, tuple) else (index,)
        return self.isel(dict(zip(self.dims, indices, strict=False)))


@dataclass(frozen=True)
class Arrays(Mapping[str, Variable]):
    """A group of an output: its variables by name, its attributes, and its groups."""

    variables: Mapping[str, Variable]
    sizes: Mapping[str, int]
    attrs: Mapping[str, Any]
    children: dict[str, Arrays] = field(default_factory=dict)

    def __getitem__(self, name: str) -> Variable:
        return self.variables[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.variables)

    def __len__(self) -> int:
        return len(self.variables)

    @property
    def coords(self) -> Mapping[str, Variable]:
        """The variables with the name of a dimension."""
        return {name: one for name, one in self.variables.items() if name in self.sizes}

    @property
    def data_vars(self) -> Mapping[str, Variable]:
        """The other variables."""
        return {name: one for name, one in self.variables.items() if name not in self.sizes}

    def to_dataset(self) -> Arrays:
        """The group itself."""
        return self

    def isel(self, part: Mapping[str, Any] | None = None, **by_name: Any) -> Arrays:
        """A part of all variables; see `Variable.isel`."""
        part = {**(part or {}), **by_name}
        sizes = {}
        for name, size in self.sizes.items():
            remaining = np.arange(size)[part.get(name, slice(None))]
            if remaining.ndim:
                sizes[name] = remaining.size
        variables = {name: one.isel(part) for name, one in self.variables.items()}
        return Arrays(variables, sizes, self.attrs)


def in_xarray(arrays: Arrays) -> DataTree:
    """A group with variables in memory, and the groups in it, as a tree of datasets."""
    import xarray as xr

    variables = {
        name: xr.Variable(one.dims, one.values, dict(one.attrs)) for name, one in arrays.items()
    }
    children = {name: in_xarray(one) for name, one in arrays.children.items()}
    return xr.DataTree(xr.Dataset(variables, attrs=dict(arrays.attrs)), children=children)


# An output, of which only the common interface is used.
Tree: TypeAlias = "Arrays | DataTree"


def arrays_of(group: netCDF4.Dataset) -> Arrays | None:
    """A group of a file and all groups in it; None if values must be decoded, as in files that
    other programs have made from outputs."""
    name = group.path.strip("/")
    if not all(map(_is_plain, group.variables.values())):
        return None
    now = present_names(name, group.variables, group.dimensions)
    variables = {}
    for before, stored in group.variables.items():
        stored.set_auto_maskandscale(False)
        attributes = attributes_of(name, now[before]) if before in now else _attributes(stored)
        variables[now.get(before, before)] = Stored(stored, attributes)
    children = {}
    for below in group.groups.values():
        found = arrays_of(below)
        if found is None:
            return None
        children[below.name] = found
    sizes = {one: len(dimension) for one, dimension in group.dimensions.items()}
    return Arrays(variables, sizes, _attributes(group), children)


def _attributes(owner: netCDF4.Dataset | netCDF4.Variable[Any]) -> dict[str, Any]:
    return {name: owner.getncattr(name) for name in owner.ncattrs()}


def _is_plain(variable: netCDF4.Variable[Any]) -> bool:
    """Whether the stored values of a variable need no decoding."""
    names = set(variable.ncattrs())
    kind = getattr(variable.dtype, "kind", "")
    if kind not in "fiu" or kind == "" or names & ENCODINGS:
        return False
    if "_FillValue" in names and not (
        kind == "f" and math.isnan(float(variable.getncattr("_FillValue")))
    ):
        return False
    # Times since a date.
    return "units" not in names or "since" not in str(variable.getncattr("units"))
