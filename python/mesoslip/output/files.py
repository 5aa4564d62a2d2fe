"""Outputs read from files."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, TypeVar

import netCDF4

from mesoslip.array_types import DataTree
from mesoslip.configuration.config import Config
from mesoslip.configuration.reading import is_directory
from mesoslip.errors import FileError
from mesoslip.output.arrays import Arrays, Tree, arrays_of
from mesoslip.output.file_locks import lock_held
from mesoslip.output.hdf5 import LOCK, check_links, check_name
from mesoslip.output.kinds import KINDS
from mesoslip.output.old_names import renamed
from mesoslip.output.validity import check_output, check_signature
from mesoslip.output.variables import has_force

# Objects built from a file.
T = TypeVar("T", bound=Tree)

# Memory for chunks of each variable [bytes]; the library's default is 64 MB.
CHUNK_CACHE = 2**22

# Errors of the libraries for a damaged file.
DAMAGES = (
    ArithmeticError,
    AttributeError,
    LookupError,
    OSError,
    RuntimeError,
    TypeError,
    ValueError,
)


@contextmanager
def opened(path: str | Path) -> Iterator[DataTree]:
    """An output of any command, read when needed; a `FileError` if it is not one, is damaged, or
    refers to other files."""
    with _opened(path, _tree) as tree:
        yield tree


@contextmanager
def opened_arrays(path: str | Path) -> Iterator[Tree]:
    """An output of ``mesoslip run`` without xarray; see `opened_for`."""
    with opened_for(path, lambda _: True) as tree:
        check_run(tree, path)
        yield tree


@contextmanager
def opened_for(path: str | Path, is_enough: Callable[[Arrays], bool]) -> Iterator[Tree]:
    """An output of any command as `Arrays` if that is enough, and no values must be decoded."""

    def build(file: netCDF4.Dataset) -> Tree:
        found = arrays_of(file)
        return found if found is not None and is_enough(found) else _tree(file)

    with _opened(path, build) as tree:
        yield tree


@contextmanager
def _opened(path: str | Path, build: Callable[[netCDF4.Dataset], T]) -> Iterator[T]:
    """An object built from the groups of a file; see `opened`."""
    path = Path(path)
    if is_directory(path):
        raise FileError(f"{path}: is a directory, not an output file")
    check_signature(path)
    check_name(path)
    with ExitStack() as stack:
        try:
            check_links(path)
            tree = _built(path, stack, build)
            if "configuration" not in tree.attrs:
                raise FileError(f"{path}: not an output of mesoslip")
            check_output(tree, path)
        except DAMAGES as error:
            raise FileError(f"{path}: {lock_held(path) or 'a damaged netCDF-4 file'}") from error
        try:
            yield tree
        except (OSError, RuntimeError) as error:
            # The data read later may be damaged.
            if "NetCDF" in str(error) or "HDF" in str(error):
                raise FileError(f"{path}: a damaged netCDF-4 file") from error
            raise


def _built(path: Path, stack: ExitStack, build: Callable[[netCDF4.Dataset], T]) -> T:
    """An object built from a file with small chunk caches, which the stack closes."""
    with LOCK:
        before = netCDF4.get_chunk_cache()
        netCDF4.set_chunk_cache(CHUNK_CACHE)
        try:
            file = netCDF4.Dataset(path)
            stack.callback(_close, file)
            return build(file)
        finally:
            netCDF4.set_chunk_cache(*before)


def _tree(file: netCDF4.Dataset) -> DataTree:
    """All groups of a file, with present names of variables."""
    import xarray as xr
    from xarray.backends import NetCDF4DataStore

    store: Any = NetCDF4DataStore
    groups, found = {}, [file]
    while found:
        group = found.pop(0)
        found += group.groups.values()
        # Data are also read later with this lock.
        data = xr.open_dataset(store(group, lock=LOCK))
        groups[group.path] = renamed(group.path.strip("/"), data)
    return xr.DataTree.from_dict(groups)


def _close(file: netCDF4.Dataset) -> None:
    with LOCK:
        file.close()


def read(path: str | Path) -> DataTree:
    """Read an output of any command into memory; see `opened`."""
    with opened(path) as tree:
        try:
            return tree.load()
        except DAMAGES as error:
            raise FileError(f"{path}: a damaged netCDF-4 file") from error


def read_run(path: str | Path) -> DataTree:
    """Read an output of ``mesoslip run`` into memory; see `read`."""
    tree = read(path)
    check_run(tree, path)
    return tree


@contextmanager
def opened_run(path: str | Path) -> Iterator[DataTree]:
    """An output of ``mesoslip run``; see `opened`."""
    with opened(path) as tree:
        check_run(tree, path)
        yield tree


def check_run(tree: Tree, path: str | Path) -> None:
    """Refuse an output that is not of ``mesoslip run``."""
    if not has_force(tree.data_vars):
        found = [kind.description for kind in KINDS.values() if kind.is_of(tree)][:1]
        but = f" but {found[0]}" if found else ""
        raise FileError(f"{path}: not an output of mesoslip run{but}")


def is_output(path: Path) -> bool:
    """Whether there is an output of any command at a path."""
    return _attribute(path, "configuration") is not None


def is_of_another(path: Path, config: Config) -> bool:
    """Whether there is an output of another configuration at a path."""
    found = _attribute(path, "configuration")
    return found is not None and found != config.to_toml()


def remove_partial(path: Path) -> None:
    """Remove the output of an interrupted run or sweep, if there is one at a path."""
    if _attribute(path, "complete") == "false":
        path.unlink(missing_ok=True)


def _attribute(path: Path, name: str) -> str | None:
    """A text attribute of an output; None if it is missing, or there is no output at the path."""
    try:
        check_signature(path)
        check_links(path)
        with LOCK, netCDF4.Dataset(path) as file:
            found = file.getncattr(name)
            return found if isinstance(found, str) else None
    # UnicodeError: the library cannot encode the path.
    except (OSError, AttributeError, UnicodeError, FileError):
        return None


def configuration(path: Path, overrides: Iterable[str] = ()) -> Config:
    """The configuration of an output, with changes applied."""
    with opened(path) as tree:
        text, base = (tree.attrs.get(name) for name in ("configuration", "base_configuration"))
    return Config.from_toml(str(text), str(path), overrides, base)
