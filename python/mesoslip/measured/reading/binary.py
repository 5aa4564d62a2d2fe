"""Files of MATLAB, HDF5, netCDF and NumPy as tables, by the libraries that read them."""

from __future__ import annotations

import zipfile
import zlib
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from functools import partial
from io import BytesIO
from pathlib import Path
from typing import IO, Any, Literal, NamedTuple

import numpy as np

from mesoslip.errors import FileError, printable
from mesoslip.measured.headers import meaning_of
from mesoslip.measured.reading.source import MAX_BYTES
from mesoslip.measured.reading.table import Table, listed
from mesoslip.output.hdf5 import LOCK, check_heaps

HDF5 = b"\x89HDF\r\n\x1a\n"
# Maximum number of arrays in a file, depth of structures, and number of columns of an array.
MAX_ARRAYS = 10_000
MAX_DEPTH = 20
MAX_COLUMNS = 200
# The element of a file of MATLAB that is compressed, and bytes of it that are unpacked at a time.
COMPRESSED = 15
UNPACKED_BYTES = 2**20


# Slices of the axes of an array.
Part = tuple[slice, ...]


class Found(NamedTuple):
    """An array of a file, a part of which is read when it is loaded: its name with those of its
    groups, its unit, and a longer name."""

    name: str
    shape: tuple[int, ...]
    dtype: np.dtype[Any]
    load: Callable[[Part], Any]
    unit: str = ""
    long_name: str = ""

    @property
    def axes(self) -> tuple[int, ...]:
        """Lengths of its axes but those of length 1."""
        return tuple(size for size in self.shape if size != 1)

    @property
    def columns(self) -> int:
        """Number of columns of numbers; 0 if it is no table."""
        is_table = self.dtype.kind in "fiub" and len(self.axes) in {1, 2}
        columns = min(self.axes) if len(self.axes) == 2 else 1
        return columns if is_table and columns <= MAX_COLUMNS else 0

    @property
    def rows(self) -> int:
        return max(self.axes)

    def values(self, rows: slice) -> Any:
        """Its columns between some rows, shape (columns, rows)."""
        along = self.shape.index(self.rows)
        everything = slice(None)
        part = tuple(rows if axis == along else everything for axis in range(len(self.shape)))
        values = np.moveaxis(np.asarray(self.load(part)), along, -1)
        return values.reshape(self.columns, -1)


class Contents(NamedTuple):
    """The arrays of a file, and notes about it."""

    arrays: Sequence[Found]
    notes: Sequence[str] = ()


class Reader(NamedTuple):
    """A format: its name, the first bytes of its files, what opens their content, whose arrays can
    be loaded until it is closed, and whether parts of them are read without the others."""

    kind: str
    start: bytes
    contents: Callable[[IO[bytes]], AbstractContextManager[Contents]]
    has_parts: bool = False


def read_binary(reader: Reader, path: Path, data: bytes) -> Table:
    """Read the arrays of a file as columns of a table."""
    (table,) = binary_blocks(reader, path, BytesIO(data))
    return table


def binary_blocks(
    reader: Reader, path: Path, file: IO[bytes], size: int | None = None
) -> Iterator[Table]:
    """Read the arrays of a file as tables of some rows, of about a size [bytes]; by default of
    all."""
    try:
        with LOCK, reader.contents(file) as found:
            yield from _tables(reader.kind, path, found, size)
    except FileError as error:
        raise FileError(f"{path}: {error}") from None
    # Libraries raise errors of any type for a damaged file.
    except Exception as error:
        raise FileError(f"{path}: a damaged file of {reader.kind}: {error}") from None


def _tables(kind: str, path: Path, contents: Contents, size: int | None) -> Iterator[Table]:
    """Arrays of the usual length as the columns of tables; only these are loaded."""
    found = contents.arrays
    others = [f"{one.name} ({_described(one)})" for one in found if not one.columns]
    tables = [one for one in found if one.columns]
    counts: Counter[int] = Counter()
    for one in tables:
        counts[one.rows] += one.columns
    if not counts:
        raise FileError(f"has no columns of numbers ({kind})")
    length = max(counts, key=lambda size: (counts[size], size))
    others += [f"{one.name} ({one.rows} numbers)" for one in tables if one.rows != length]
    tables = [one for one in tables if one.rows == length]
    row = counts[length] * np.dtype(float).itemsize
    if size is None:
        _check_bytes(length * row, "its columns")
    step = length if size is None else max(1, size // row)
    columns = [
        one if one.columns == 1 else one._replace(name="", long_name="")
        for one in tables
        for _ in range(one.columns)
    ]
    notes = [f"{kind}: {len(columns)} columns"]
    if others:
        notes.append(f"other arrays, not used: {listed([printable(one) for one in others])}")
    headers, units = _headers(columns), tuple(one.unit for one in columns)
    for start in range(0, length, step):
        rows = slice(start, min(start + step, length))
        values = np.empty((len(columns), rows.stop - start))
        at = 0
        for one in tables:
            values[at : at + one.columns] = one.values(rows)
            at += one.columns
        values[~np.isfinite(values)] = np.nan
        lines = np.arange(start + 1, rows.stop + 1)
        yield Table(path, headers, units, values, lines, {}, False, [*notes, *contents.notes])


def _check_bytes(size: int, name: str) -> None:
    """Refuse what would not fit into memory."""
    if size > MAX_BYTES:
        raise FileError(
            f"{name} take more than {MAX_BYTES / 2**30:.3g} GiB; copy those of the measurement to "
            "a file"
        )


def _described(one: Found) -> str:
    shape = " x ".join(str(size) for size in one.shape)
    return f"{shape or 'one'} {one.dtype.name}"


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


def _fields(name: str, shape: Sequence[int], dtype: Any, load: Callable[..., Any]) -> list[Found]:
    """An array, or its named fields, which are loaded by their names."""
    if dtype.names is None:
        return [Found(name, tuple(shape), dtype, load)]
    before = f"{name}/" if name else ""
    return [
        Found(f"{before}{field}", tuple(shape), dtype[field], partial(load, field=field))
        for field in dtype.names
    ]


@contextmanager
def _npz(source: IO[bytes]) -> Iterator[Contents]:
    found: list[Found] = []
    with zipfile.ZipFile(source) as archive:
        for member in archive.namelist():
            if member.endswith(".npy"):
                with archive.open(member) as file:
                    shape, dtype = _npy_header(file)
                load = partial(_npy_array, partial(archive.open, member))
                found += _fields(member.removesuffix(".npy"), shape, dtype, load)
        yield Contents(found)


@contextmanager
def _npy(source: IO[bytes]) -> Iterator[Contents]:
    data = source.read()
    shape, dtype = _npy_header(BytesIO(data))
    load = partial(_npy_array, partial(BytesIO, data))
    yield Contents(_fields("" if dtype.names else "data", shape, dtype, load))


def _npy_header(file: IO[bytes]) -> tuple[tuple[int, ...], np.dtype[Any]]:
    """Shape and type of an array of NumPy."""
    version = np.lib.format.read_magic(file)
    read = np.lib.format.read_array_header_1_0
    if version != (1, 0):
        read = np.lib.format.read_array_header_2_0
    shape, _, dtype = read(file)
    if dtype.hasobject:
        raise ValueError("it has objects")
    return shape, dtype


def _npy_array(open_file: Callable[[], IO[bytes]], part: Part, field: str | None = None) -> Any:
    with open_file() as file:
        values = np.lib.format.read_array(file, allow_pickle=False)
    return _field(values, part, field)


def _field(values: Any, part: Part, field: str | None = None) -> Any:
    return (values if field is None else values[field])[part]


@contextmanager
def _matlab(source: IO[bytes]) -> Iterator[Contents]:
    from scipy.io import loadmat

    data = source.read()
    _check_unpacked(data)
    contents = loadmat(BytesIO(data), squeeze_me=True, struct_as_record=False)
    found = [
        one
        for name, value in contents.items()
        if not name.startswith("__")
        for one in _structure(name, value, 0)
    ]
    yield Contents(found)


def _check_unpacked(data: bytes) -> None:
    """Refuse a file of MATLAB whose variables are too large when they are unpacked."""
    order: Literal["little", "big"] = "little" if data[126:128] == b"IM" else "big"
    at, total = 128, 0
    while at + 8 <= len(data):
        kind, size = (int.from_bytes(data[n : n + 4], order) for n in (at, at + 4))
        if kind == COMPRESSED:
            packed, unpack = data[at + 8 : at + 8 + size], zlib.decompressobj()
            while packed and total <= MAX_BYTES:
                total += len(unpack.decompress(packed, UNPACKED_BYTES))
                packed = unpack.unconsumed_tail
        _check_bytes(total, "its variables")
        at += 8 + size


def _structure(name: str, value: Any, depth: int) -> Iterator[Found]:
    """The arrays of a structure of MATLAB."""
    names = getattr(value, "_fieldnames", None)
    if names is None:
        values = np.asarray(value)
        yield Found(name, values.shape, values.dtype, partial(_field, values))
    elif depth < MAX_DEPTH:
        for one in names:
            yield from _structure(f"{name}/{one}", getattr(value, one), depth + 1)


@contextmanager
def _hdf5(source: IO[bytes]) -> Iterator[Contents]:
    """Data sets of groups, except links, and data in other files."""
    import h5py

    check_heaps(source)
    with h5py.File(source, "r") as file:
        if "program_version" in file.attrs and "configuration" in file.attrs:
            raise FileError("is an output of mesoslip, not a file of a measurement")
        found: list[Found] = []
        seen: set[int] = set()
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
                    found += _data_set(name, h5py.Dataset(target))
        yield Contents(found)


def _data_set(name: str, one: Any) -> list[Found]:
    import h5py

    creation = one.id.get_create_plist()
    if creation.get_external_count() or creation.get_layout() == h5py.h5d.VIRTUAL:
        raise FileError(f"{name} has its data in another file")
    # A data set without data in the file may have any size.
    if one.shape is None or one.id.get_storage_size() == 0:
        return []
    if one.dtype.names:
        return _fields(name, one.shape, one.dtype, lambda part, field: one.fields(field)[part])
    attributes = {key: one.attrs[key] for key in one.attrs}
    # A dimension of netCDF without numbers of its own.
    is_number = one.dtype.kind in "fiub"
    if not is_number or b"not a netCDF variable" in bytes(str(attributes.get("NAME", "")), "utf-8"):
        return []
    return [_packed(name, one.shape, one.dtype, one.__getitem__, attributes)]


def _packed(
    name: str,
    shape: tuple[int, ...],
    dtype: np.dtype[Any],
    load: Callable[[Part], Any],
    attributes: Mapping[str, Any],
) -> Found:
    """An array that is packed, with missing numbers, according to the attributes of CF."""
    unit = next(
        (_text(attributes[key]) for key in ("units", "unit", "Units") if key in attributes), ""
    )
    return Found(
        name,
        shape,
        dtype,
        lambda part: _unpacked(load(part), attributes),
        unit.partition(" since ")[0],
        _text(attributes.get("long_name", "")),
    )


def _unpacked(values: Any, attributes: Mapping[str, Any]) -> Any:
    numbers = np.asarray(values, dtype=float)
    for key in ("_FillValue", "missing_value"):
        if key in attributes:
            numbers = np.where(np.isin(values, np.asarray(attributes[key])), np.nan, numbers)
    scale, offset = (
        float(np.asarray(attributes.get(key, usual)).reshape(-1)[0])
        for key, usual in (("scale_factor", 1.0), ("add_offset", 0.0))
    )
    return numbers * scale + offset if (scale, offset) != (1.0, 0.0) else numbers


def _text(value: Any) -> str:
    if isinstance(value, bytes):
        return value.decode(errors="replace")
    return value if isinstance(value, str) else ""


@contextmanager
def _netcdf3(source: IO[bytes]) -> Iterator[Contents]:
    from scipy.io import netcdf_file

    with netcdf_file(source, "r", mmap=False) as file:
        found = [
            _packed(
                name,
                one.data.shape,
                one.data.dtype,
                partial(_field, one.data),
                dict(one._attributes),
            )
            for name, one in file.variables.items()
        ]
        yield Contents(found)


READERS = (
    Reader("NumPy (.npz)", b"PK\x03\x04", _npz),
    Reader("NumPy (.npy)", b"\x93NUMPY", _npy),
    Reader("MATLAB", b"MATLAB 5.0", _matlab),
    Reader("MATLAB 7.3 (HDF5)", b"MATLAB 7.3", _hdf5, True),
    Reader("HDF5 or netCDF-4", HDF5, _hdf5, True),
    Reader("netCDF-3", b"CDF\x01", _netcdf3),
    Reader("netCDF-3", b"CDF\x02", _netcdf3),
)
