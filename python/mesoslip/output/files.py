"""Output files: netCDF-4 with the layout that `mesoslip.run` returns in memory."""

from __future__ import annotations

import errno
import fcntl
import math
import os
import platform
import re
import shutil
import tempfile
import threading
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import netCDF4

from mesoslip.configuration.config import Config
from mesoslip.errors import FileError, WriteError
from mesoslip.output import layout, variables
from mesoslip.output.layout import Entry, GroupLayout, RunResults
from mesoslip.output.provenance import version

if TYPE_CHECKING:
    import xarray as xr

# Variables with fewer values are not worth compressing.
LEAST_COMPRESSED = 1000
COMPRESSION: dict[str, Any] = {"zlib": True, "complevel": 1, "shuffle": True}
# How names of files end that are no outputs.
OTHER_KINDS = {".csv", ".txt", ".png", ".pdf", ".svg", ".html", ".json"}
# Bytes that are written to see whether more can be.
PROBE_BYTES = 2**16
# Memory for chunks of each variable that is read; the library's own is 64 MB.
CHUNK_CACHE = 2**22
# What a damaged file may raise in the libraries that read it.
DAMAGES = (
    ArithmeticError,
    AttributeError,
    LookupError,
    OSError,
    RuntimeError,
    TypeError,
    ValueError,
)
NO_LOCKS = (
    "its file system gives no locks ({}); the environment variable HDF5_USE_FILE_LOCKING=FALSE "
    "does without them"
)
# Slots of the table in which the chunks of a variable in memory are found.
CACHE_SLOTS = 11

# What rows of groups were called in files of earlier versions, and what they are called now.
OLD_NAMES = {
    "slips": {"realization": "realization_index"},
    "slip_traces": {"realization": "realization_index", "time": "sample_time"},
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


# Dimensions and variables that commands need of an output of a run: of its root, and of groups that
# it may have.
ROOT_NEEDS = tuple(variables.TRACE)[:6]
NEEDS = {
    "stages": (("stage",), tuple(variables.STAGES)),
    "slip_traces": (("sample",), ("realization_index", "sample_time", *ROOT_NEEDS)),
    "avalanches": (("avalanche",), tuple(variables.AVALANCHES)[:6]),
    "snapshots": (("snapshot",), tuple(variables.SNAPSHOTS)[:8]),
}


def check_writable(path: Path, reads: Iterable[str | Path] = ()) -> None:
    """Make sure, before a run, that its output can be written.

    Parameters
    ----------
    path
        The output.
    reads
        What the command reads, which it must not overwrite.

    Raises
    ------
    FileError
        If the path is no place for a file, is one that is read, or its folder cannot be made or
        written to.
    """
    if path.suffix == ".toml":
        raise FileError(f"{path}: is the name of a configuration; give another one to the output")
    target = _target(path)
    for one in map(Path, reads):
        if target.exists() and one.exists() and target.samefile(one):
            raise FileError(f"{path}: is what the command reads; give another name for its output")
    part = _temporary(target)
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        _remove_left_behind(target)
        # A full disk takes an empty file.
        part.write_bytes(bytes(PROBE_BYTES))
    except (OSError, ValueError) as error:
        raise _not_written(path, target, error) from error
    finally:
        with suppress(OSError):
            part.unlink(missing_ok=True)


def check_output(path: Path, reads: Iterable[str | Path] = ()) -> None:
    """Make sure that a path is one for an output, and that it can be written; see `check_writable`.

    Raises
    ------
    FileError
        Also if its name ends like that of another kind of file.
    """
    if path.suffix.lower() in OTHER_KINDS:
        raise FileError(
            f"{path}: an output is netCDF, and its name must not end in {path.suffix}; "
            f"{path.with_suffix('.nc')} would be right"
        )
    check_writable(path, reads)


def _target(path: Path) -> Path:
    """Where a file is to be written: links are followed, what is no regular file is refused.

    Raises
    ------
    FileError
        If it is refused.
    """
    if path.is_dir():
        raise FileError(f"{path}: cannot be written: is a directory; give the name of a file in it")
    try:
        target = path.resolve()
        is_refused = target.exists() and not target.is_file()
    except (OSError, RuntimeError, ValueError) as error:
        raise FileError(f"{path}: cannot be written: {error}") from error
    if is_refused:
        raise FileError(f"{path}: cannot be written: is a device or the like, not a file")
    return target


def _not_written(path: Path, target: Path, error: Exception) -> FileError:
    """What to say of a file that could not be written."""
    reason = getattr(error, "strerror", None) or error
    is_full = getattr(error, "errno", None) in {errno.ENOSPC, errno.EDQUOT}
    # HDF5 tells a full disk as an error of its own, or as a lack of permission.
    with suppress(OSError):
        is_full = is_full or shutil.disk_usage(target.parent).free < PROBE_BYTES
    if is_full:
        return WriteError(f"{path}: cannot be written: no space left on the disk")
    if "HDF" in str(error):
        refused = _has_no_locks(target.parent)
        if refused:
            return FileError(f"{path}: cannot be written: {NO_LOCKS.format(refused)}")
        return WriteError(f"{path}: cannot be written: {reason}; is the disk full?")
    return FileError(f"{path}: cannot be written: {reason}")


def _temporary(path: Path) -> Path:
    """A name beside a file, with its ending, that no other process or thread has."""
    owner = f"{platform.node()}-{os.getpid()}-{threading.get_ident()}"
    return path.with_name(f".{owner}.{path.name}")


def _remove_left_behind(path: Path) -> None:
    """Remove parts of a file that processes of this machine left behind, when they were killed."""
    node = re.escape(platform.node())
    pattern = re.compile(rf"\.{node}-(\d+)-\d+\.{re.escape(path.name)}")
    for other in path.parent.iterdir():
        match = pattern.fullmatch(other.name)
        if match is None:
            continue
        try:
            os.kill(int(match[1]), 0)
        except ProcessLookupError:
            with suppress(OSError):
                other.unlink(missing_ok=True)
        except OSError:
            # Somebody else's, at work.
            continue


@contextmanager
def written_whole(path: Path) -> Iterator[Path]:
    """A file to write in the place of another, whose name appears only when it is whole.

    Raises
    ------
    FileError
        If it cannot be written.
    """
    target = _target(path)
    part = _temporary(target)
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        yield part
        part.replace(target)
    except (OSError, RuntimeError, ValueError) as error:
        raise _not_written(path, target, error) from error
    finally:
        with suppress(OSError):
            part.unlink(missing_ok=True)


def write(tree: xr.DataTree, path: Path) -> None:
    """Write a tree as an output; its name appears only when it is whole.

    Raises
    ------
    FileError
        If it cannot be written.
    """
    encoding = {
        group.path: {
            str(name): COMPRESSION
            for name, data in group.data_vars.items()
            if data.size > LEAST_COMPRESSED
        }
        for group in tree.subtree
    }
    with written_whole(path) as part:
        tree.to_netcdf(part, engine="netcdf4", encoding=encoding)


def write_results(results: RunResults, path: Path) -> None:
    """Write the results of a run, of which only blocks are held in memory.

    The file is that of `write` and `mesoslip.output.layout.build_tree`.

    Raises
    ------
    FileError
        If it cannot be written.
    """
    groups = layout.describe(results)
    with written_whole(path) as part, netCDF4.Dataset(part, "w", format="NETCDF4") as file:
        taken = {
            name: _create_group(file.createGroup(name) if name else file, form, groups[""])
            for name, form in groups.items()
        }
        layout.fill(results, groups, taken)


def _create_group(
    place: netCDF4.Dataset, form: GroupLayout, root: GroupLayout
) -> dict[str, layout.Values]:
    """Make the dimensions, variables and attributes of a group of a file."""
    place.setncatts(form.attributes)
    for name, size in form.sizes.items():
        place.createDimension(name, size)
    sizes = {**root.sizes, **form.sizes}
    made: dict[str, layout.Values] = {}
    for name, entry in form.entries.items():
        storage = _storage(entry, [sizes[one] for one in entry.dimensions])
        variable = place.createVariable(
            name, entry.dtype, entry.dimensions, fill_value=entry.fill_value, **storage
        )
        if storage:
            # Blocks fill chunks: the library's own cache would hold hundreds of megabytes.
            size = entry.dtype.itemsize * math.prod(storage["chunksizes"])
            variable.set_var_chunk_cache(2 * size, CACHE_SLOTS, 1.0)
        variable.set_auto_maskandscale(False)
        variable.setncatts(entry.meaning.attributes)
        auxiliary = form.auxiliary_coordinates(name)
        if auxiliary:
            variable.coordinates = " ".join(auxiliary)
        made[name] = variable
    return made


def _storage(entry: Entry, shape: list[int]) -> dict[str, Any]:
    """Compression of a variable, and chunks that hold a block of rows."""
    if math.prod(shape) <= LEAST_COMPRESSED or entry.is_coordinate:
        return {}
    # One realization at a time; of long dimensions after the first no more than a block's worth.
    chunks = [1, *shape[1:]] if entry.is_padded else list(shape)
    along = 1 if entry.is_padded else 0
    most = min(layout.BLOCK_ROWS, layout.BLOCK_NUMBERS // math.prod(shape[along + 1 :]))
    chunks[along] = max(1, min(shape[along], most))
    return {**COMPRESSION, "chunksizes": chunks}


@contextmanager
def opened(path: str | Path) -> Iterator[xr.DataTree]:
    """An output of any command, of which only what is used is read.

    Raises
    ------
    FileError
        If there is no such file, or it is not an output of mesoslip, or it is damaged.
    """
    import xarray as xr

    path = Path(path)
    if path.is_dir():
        raise FileError(f"{path}: is a directory, not an output file")
    _check_signature(path)
    groups: dict[str, xr.Dataset] = {}
    try:
        groups = _groups(path)
        tree = xr.DataTree.from_dict(
            {name: _renamed(name.strip("/"), data) for name, data in groups.items()}
        )
        _check_layout(tree, path)
    except DAMAGES as error:
        _close(groups)
        raise FileError(f"{path}: {_locked(path) or 'a damaged netCDF-4 file'}") from error
    except FileError:
        _close(groups)
        raise
    try:
        yield tree
    except (OSError, RuntimeError) as error:
        # What is read later than here may turn out to be damaged.
        if "NetCDF" in str(error) or "HDF" in str(error):
            raise FileError(f"{path}: a damaged netCDF-4 file") from error
        raise
    finally:
        _close(groups)


def _locked(path: Path) -> str:
    """Why the library may have been refused the lock that it wants of a file; empty if it was not.

    It tells this as it tells a damage.
    """
    try:
        with path.open("rb") as file:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return "is locked by a program that writes to it; try again when that is done"
    except OSError as error:
        return NO_LOCKS.format(error.strerror)
    return ""


def _has_no_locks(folder: Path) -> str:
    """What the file system of a folder says when it is asked for a lock; empty if it gives it."""
    with suppress(OSError), tempfile.TemporaryFile(dir=folder) as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            return error.strerror or str(error)
    return ""


def _close(groups: dict[str, xr.Dataset]) -> None:
    for data in groups.values():
        data.close()


def _groups(path: Path) -> dict[str, xr.Dataset]:
    """The groups of a file, with little memory for what is read of them."""
    import xarray as xr

    before = netCDF4.get_chunk_cache()
    netCDF4.set_chunk_cache(CHUNK_CACHE)
    try:
        return xr.open_groups(path, engine="netcdf4")
    finally:
        netCDF4.set_chunk_cache(*before)


def _check_signature(path: Path) -> None:
    """Make sure that a file looks like netCDF-4 before a library opens it.

    Raises
    ------
    FileError
        If it does not, or cannot be read.
    """
    try:
        if not path.exists():
            raise FileError(f"{path}: no such file")
        if not path.is_file():
            raise FileError(f"{path}: is a device or the like, not an output file")
        with path.open("rb") as file:
            start = file.read(8)
    except (OSError, ValueError) as error:
        raise FileError(f"{path}: cannot be read: {error}") from error
    if path.suffix == ".toml":
        raise FileError(
            f"{path}: is a configuration, not an output (netCDF); make one of it first: "
            f"mesoslip run {path}"
        )
    if start != b"\x89HDF\r\n\x1a\n":
        told = f"; mesoslip trace {path} makes an output of a table" if _is_table(path) else ""
        raise FileError(f"{path}: not an output (netCDF-4){told}")


def _is_table(path: Path) -> bool:
    return path.suffix.lower() in {".csv", ".txt", ".dat", ".tsv"}


def _check_layout(tree: xr.DataTree, path: Path) -> None:
    """Make sure that what commands use of an output is there, as numbers in the right dimensions.

    Raises
    ------
    FileError
        If it is not.
    """
    if "configuration" not in tree.attrs:
        raise FileError(f"{path}: not an output of mesoslip")
    wrong = [
        f"attribute {name}"
        for name in ("configuration", "title", "comment", "complete")
        if not isinstance(tree.attrs.get(name, ""), str)
    ]
    if "spring_force" in tree.data_vars:
        needed = {"": (("realization", "time"), ROOT_NEEDS), "slips": (("slip",), variables.SLIPS)}
        needed |= {name: one for name, one in NEEDS.items() if name in tree.children}
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
        raise FileError(f"{path}: is of {newer}, and cannot be read: {wrong[0]} is not as it was")
    if wrong:
        raise FileError(f"{path}: a damaged netCDF-4 file: {wrong[0]} is missing or wrong")


def _newer_version(written: object) -> str:
    """The program that has written a file, if it is newer than this one; otherwise empty."""
    ours = version("mesoslip")
    theirs, here = ([int(one) for one in re.findall(r"\d+", str(text))] for text in (written, ours))
    if written is None or theirs <= here:
        return ""
    return f"mesoslip {written}, which is newer than this one ({ours})"


def _renamed(name: str, data: xr.Dataset) -> xr.Dataset:
    """A group of a file with the names of today."""
    old = {
        before: now
        for before, now in OLD_NAMES.get(name, {}).items()
        if before in data.variables and before not in data.dims
    }
    if not old:
        return data
    data = data.rename(old).reset_coords(
        [now for now in old.values() if now in {"realization_index", "start_time"}]
    )
    for now in old.values():
        data[now].attrs = GROUPS[name][now].attributes
    return data


def read(path: str | Path) -> xr.DataTree:
    """Read an output of any command into memory; see `opened`."""
    with opened(path) as tree:
        try:
            return tree.load()
        except DAMAGES as error:
            raise FileError(f"{path}: a damaged netCDF-4 file") from error


def read_run(path: str | Path) -> xr.DataTree:
    """Read an output of ``mesoslip run`` into memory; see `read`."""
    tree = read(path)
    check_run(tree, path)
    return tree


@contextmanager
def opened_run(path: str | Path) -> Iterator[xr.DataTree]:
    """An output of ``mesoslip run``, of which only what is used is read; see `opened`."""
    with opened(path) as tree:
        check_run(tree, path)
        yield tree


def check_run(tree: xr.DataTree, path: str | Path) -> None:
    """Make sure that an output is of ``mesoslip run``.

    Raises
    ------
    FileError
        If it is not.
    """
    if "spring_force" not in tree.data_vars:
        kind = " but of mesoslip sweep" if "status" in tree.data_vars else ""
        raise FileError(f"{path}: not an output of mesoslip run{kind}")


def is_of_another(path: Path, config: Config) -> bool:
    """Whether there is an output of another configuration at a path."""
    try:
        with netCDF4.Dataset(path) as file:
            return bool(file.getncattr("configuration") != config.to_toml())
    # There is none, it is another kind of file, or its name is none that the library takes.
    except (OSError, AttributeError, UnicodeError):
        return False


def configuration(path: Path, overrides: Iterable[str] = ()) -> Config:
    """The configuration of an output, to run it again, with changes laid over it."""
    with opened(path) as tree:
        text, base = (tree.attrs.get(name) for name in ("configuration", "base_configuration"))
    return Config.from_toml(str(text), str(path), overrides, base)
