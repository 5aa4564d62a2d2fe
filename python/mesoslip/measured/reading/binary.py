"""Files of MATLAB, HDF5, netCDF and NumPy as tables, by the libraries that read them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from mesoslip.errors import FileError, printable
from mesoslip.measured.headers import meaning_of
from mesoslip.measured.reading.source import MAX_BYTES
from mesoslip.measured.reading.table import Table, listed
from mesoslip.output.hdf5 import LOCK

HDF5 = b"\x89HDF\r\n\x1a\n"
# Maximum number of arrays in a file, depth of structures, and number of columns of an array.
MAX_ARRAYS = 10_000
MAX_DEPTH = 20
MAX_COLUMNS = 200


class Reader(NamedTuple):
    """A format: its name, the first bytes of its files, and a function that yields their arrays."""

    kind: str
    start: bytes
    arrays: Callable[[bytes], Iterator[Found]]


class Found(NamedTuple):
    """An array of a file: its name with those of its groups, its unit, and a longer name."""

    name: str
    values: Any
    unit: str = ""
    long_name: str = ""


def read_binary(reader: Reader, path: Path, data: bytes) -> Table:
    """Read the arrays of a file as columns of a table."""
    try:
        with LOCK:
            found = list(reader.arrays(data))
    except FileError as error:
        raise FileError(f"{path}: {error}") from None
    # Libraries raise errors of any type for a damaged file.
    except Exception as error:
        raise FileError(f"{path}: a damaged file of {reader.kind}: {error}") from None
    return _table(reader.kind, path, found)


def _table(kind: str, path: Path, found: list[Found]) -> Table:
    """Arrays of the usual length as the columns of a table."""
    columns: list[Found] = []
    others: list[str] = []
    for one in found:
        values = np.asarray(one.values)
        shape = tuple(size for size in values.shape if size != 1)
        if values.dtype.kind not in "fiub" or len(shape) not in {1, 2}:
            others.append(f"{one.name} ({_described(values)})")
        elif len(shape) == 1:
            columns.append(one._replace(values=values.reshape(-1)))
        else:
            table = values.reshape(shape)
            table = table if shape[0] >= shape[1] else table.T
            if table.shape[1] > MAX_COLUMNS:
                others.append(f"{one.name} ({_described(values)})")
                continue
            columns += [Found("", table[:, n], one.unit) for n in range(table.shape[1])]
    lengths = Counter(len(one.values) for one in columns)
    if not lengths:
        raise FileError(f"{path}: has no columns of numbers ({kind})")
    length = max(lengths, key=lambda size: (lengths[size], size))
    others += [
        f"{one.name} ({len(one.values)} numbers)" for one in columns if len(one.values) != length
    ]
    columns = [one for one in columns if len(one.values) == length]
    values = np.array([np.asarray(one.values, dtype=float) for one in columns])
    values[~np.isfinite(values)] = np.nan
    notes = [f"{kind}: {len(columns)} columns"]
    if others:
        notes.append(f"other arrays, not used: {listed([printable(one) for one in others])}")
    return Table(
        path,
        _headers(columns),
        tuple(one.unit for one in columns),
        values,
        np.arange(1, length + 1),
        {},
        False,
        notes,
    )


def _described(values: Any) -> str:
    shape = " x ".join(str(size) for size in values.shape)
    return f"{shape or 'one'} {values.dtype.name}"


def _headers(columns: list[Found]) -> tuple[str, ...]:
    """Names, without groups if they are unique; long names if only these have a meaning."""
    short = [one.name.rpartition("/")[2] for one in columns]
    counts = Counter(short)
    headers = []
    for name, one in zip(short, columns, strict=True):
        header = name if counts[name] == 1 else one.name
        if meaning_of(header) is None and meaning_of(one.long_name) is not None:
            header = one.long_name
        headers.append(header)
    return tuple(headers)


def _npz(data: bytes) -> Iterator[Found]:
    with np.load(BytesIO(data), allow_pickle=False) as archive:
        for name in archive.files:
            values = archive[name]
            if values.dtype.names:
                yield from (Found(field, values[field]) for field in values.dtype.names)
            else:
                yield Found(name, values)


def _npy(data: bytes) -> Iterator[Found]:
    values = np.load(BytesIO(data), allow_pickle=False)
    if values.dtype.names:
        yield from (Found(field, values[field]) for field in values.dtype.names)
    else:
        yield Found("data", values)


def _matlab(data: bytes) -> Iterator[Found]:
    from scipy.io import loadmat

    contents = loadmat(BytesIO(data), squeeze_me=True, struct_as_record=False)
    for name, value in contents.items():
        if not name.startswith("__"):
            yield from _fields(name, value, 0)


def _fields(name: str, value: Any, depth: int) -> Iterator[Found]:
    """The arrays of a structure of MATLAB."""
    names = getattr(value, "_fieldnames", None)
    if names is None:
        yield Found(name, np.asarray(value))
    elif depth < MAX_DEPTH:
        for one in names:
            yield from _fields(f"{name}/{one}", getattr(value, one), depth + 1)


def _hdf5(data: bytes) -> Iterator[Found]:
    """Data sets of groups, except links, and data in other files."""
    import h5py

    with h5py.File(BytesIO(data), "r") as file:
        if "program_version" in file.attrs and "configuration" in file.attrs:
            raise FileError("is an output of mesoslip, not a file of a measurement")
        seen: set[int] = set()
        remaining = MAX_BYTES
        groups: list[tuple[str, Any]] = [("", file.id)]
        while groups:
            parent, group = groups.pop()
            for key in list(group):
                name = f"{parent}{key.decode(errors='replace')}"
                if group.links.get_info(key).type != h5py.h5l.TYPE_HARD or key == b"#refs#":
                    continue
                target = h5py.h5o.open(group, key)
                address = h5py.h5o.get_info(target).addr
                if address in seen or len(seen) > MAX_ARRAYS:
                    continue
                seen.add(address)
                if isinstance(target, h5py.h5g.GroupID):
                    groups.append((f"{name}/", target))
                elif isinstance(target, h5py.h5d.DatasetID):
                    one = h5py.Dataset(target)
                    if target.get_storage_size() > 0:
                        remaining -= one.size * max(one.dtype.itemsize, np.dtype(float).itemsize)
                    if remaining < 0:
                        raise FileError(
                            f"its data sets up to {name} take more than "
                            f"{MAX_BYTES / 2**30:.3g} GiB; copy those of the measurement to a file"
                        )
                    yield from _data_set(name, one)


def _data_set(name: str, one: Any) -> Iterator[Found]:
    import h5py

    creation = one.id.get_create_plist()
    if creation.get_external_count() or creation.get_layout() == h5py.h5d.VIRTUAL:
        raise FileError(f"{name} has its data in another file")
    # A data set without data in the file may have any size.
    if one.shape is None or one.id.get_storage_size() == 0:
        return
    if one.dtype.names:
        values = one[()]
        yield from (Found(f"{name}/{field}", values[field]) for field in one.dtype.names)
    elif one.dtype.kind in "fiub":
        attributes = {key: one.attrs[key] for key in one.attrs}
        # A dimension of netCDF without numbers of its own.
        if b"not a netCDF variable" not in bytes(str(attributes.get("NAME", "")), "utf-8"):
            yield _unpacked(name, one[()], attributes)


def _unpacked(name: str, values: Any, attributes: Mapping[str, Any]) -> Found:
    """Numbers unpacked and missing according to the attributes of CF."""
    numbers = np.asarray(values, dtype=float)
    for key in ("_FillValue", "missing_value"):
        if key in attributes:
            numbers = np.where(np.isin(values, np.asarray(attributes[key])), np.nan, numbers)
    scale, offset = (
        float(np.asarray(attributes.get(key, usual)).reshape(-1)[0])
        for key, usual in (("scale_factor", 1.0), ("add_offset", 0.0))
    )
    unit = next(
        (_text(attributes[key]) for key in ("units", "unit", "Units") if key in attributes), ""
    )
    return Found(
        name,
        numbers * scale + offset if (scale, offset) != (1.0, 0.0) else numbers,
        unit.partition(" since ")[0],
        _text(attributes.get("long_name", "")),
    )


def _text(value: Any) -> str:
    if isinstance(value, bytes):
        return value.decode(errors="replace")
    return value if isinstance(value, str) else ""


def _netcdf3(data: bytes) -> Iterator[Found]:
    from scipy.io import netcdf_file

    with netcdf_file(BytesIO(data), "r", mmap=False) as file:
        for name, variable in file.variables.items():
            attributes = dict(variable._attributes)
            yield _unpacked(name, np.array(variable.data), attributes)


READERS = (
    Reader("NumPy (.npz)", b"PK\x03\x04", _npz),
    Reader("NumPy (.npy)", b"\x93NUMPY", _npy),
    Reader("MATLAB", b"MATLAB 5.0", _matlab),
    Reader("MATLAB 7.3 (HDF5)", b"MATLAB 7.3", _hdf5),
    Reader("HDF5 or netCDF-4", HDF5, _hdf5),
    Reader("netCDF-3", b"CDF\x01", _netcdf3),
    Reader("netCDF-3", b"CDF\x02", _netcdf3),
)
