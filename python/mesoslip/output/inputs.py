"""Arguments of functions: a configuration or an output, or the path of one."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar, cast

from mesoslip.array_types import Dataset, DataTree
from mesoslip.configuration.config import Config
from mesoslip.configuration.reading import PathLike, as_path
from mesoslip.errors import ConfigError, FileError, shown

if TYPE_CHECKING:
    from mesoslip.output.arrays import Arrays, Tree

ConfigLike: TypeAlias = PathLike | Mapping[str, Any] | Config
OutputLike: TypeAlias = "PathLike | DataTree | Dataset"
Input = TypeVar("Input")


def as_config(config: ConfigLike, overrides: Iterable[str] = ()) -> Config:
    """A configuration from a TOML file, from an output of an earlier run, or from nested tables."""
    if isinstance(config, Config):
        return config
    if isinstance(config, Mapping):
        return Config.from_dict(config)
    if not isinstance(config, str | os.PathLike):
        message = "must be the path of a TOML file or of an output, nested tables, or a Config"
        raise ConfigError.of("config", message, config)
    path = Path(config)
    if path.suffix == ".nc":
        # This and the following functions import netCDF only when needed, as it is slow to import.
        from mesoslip.output import files

        return files.configuration(path, overrides)
    return Config.load(path, overrides)


def open_output(path: PathLike) -> DataTree:
    """Read an output of any command into memory.

    Parameters
    ----------
    path
        The netCDF file.

    Returns
    -------
    xarray.DataTree
        The output, as the command in Python returns it.

    Raises
    ------
    FileError
        If there is no such file, or it is not an output of mesoslip, or it is damaged.

    Examples
    --------
    >>> import mesoslip
    >>> path, *_ = mesoslip.example("klein")  # writes klein.toml
    >>> tree = mesoslip.run(mesoslip.Config.load(path, ["contacts.count=200"]))
    >>> tree.to_netcdf("klein.nc")
    >>> mesoslip.open_output("klein.nc")["spring_force"].dims
    ('realization', 'time')
    """
    from mesoslip.output import files

    return files.read(as_path(path))


def as_output(output: OutputLike) -> DataTree:
    """An output of any command in memory."""
    return open_output(output) if isinstance(output, str | os.PathLike) else _tree(output)


def as_run(output: OutputLike) -> DataTree:
    """An output of a run in memory."""
    from mesoslip.output import files

    if isinstance(output, str | os.PathLike):
        return files.read_run(Path(output))
    tree = _tree(output)
    files.check_run(tree, "the output")
    return tree


@contextmanager
def opened_run(output: OutputLike) -> Iterator[tuple[DataTree, str]]:
    """An output of a run, read when needed, and its name for messages."""
    from mesoslip.output import files

    if isinstance(output, str | os.PathLike):
        with files.opened_run(Path(output)) as tree:
            yield tree, os.fspath(output)
    else:
        yield as_run(output), "the output"


@contextmanager
def opened_run_arrays(output: OutputLike) -> Iterator[Tree]:
    """An output of a run, read when needed, without xarray if it is in a file."""
    from mesoslip.output import files

    if isinstance(output, str | os.PathLike):
        with files.opened_arrays(Path(output)) as tree:
            yield tree
    else:
        yield as_run(output)


def trace_name(output: OutputLike, tree: DataTree) -> str:
    """A short name of an output with a trace, from its file or the measured file."""
    if isinstance(output, str | os.PathLike):
        return Path(output).stem
    return str(tree.attrs.get("measured_file", tree.attrs.get("title", "trace")))


def several(output: OutputLike | Sequence[OutputLike]) -> Sequence[OutputLike]:
    """One or several outputs as a sequence."""
    if isinstance(output, str | os.PathLike) or not isinstance(output, Sequence):
        return [output]
    return output


def distinct(inputs: Sequence[Input]) -> Sequence[Input]:
    """Files or trees that count as independent; the same one twice is refused."""
    seen = set()
    for number, one in enumerate(inputs):
        is_file = isinstance(one, str | os.PathLike)
        key = os.path.realpath(cast("PathLike", one)) if is_file else id(one)
        if key in seen:
            raise FileError(f"{one if is_file else f'input {number}'}: is given twice")
        seen.add(key)
    return inputs


def opened(
    outputs: Sequence[OutputLike],
    stack: ExitStack,
    is_enough: Callable[[Arrays], bool] = lambda _: False,
) -> tuple[list[DataTree], list[str]]:
    """Outputs of any command, as `Arrays` if that is enough, and their names; the stack closes
    files."""
    from mesoslip.output import files

    trees, names = [], []
    for number, one in enumerate(outputs):
        if isinstance(one, str | os.PathLike):
            names.append(str(one))
            tree = stack.enter_context(files.opened_for(Path(one), is_enough))
            trees.append(cast("DataTree", tree))
        else:
            tree = _tree(one)
            trees.append(tree)
            names.append(tree.attrs.get("title", f"output {number}"))
    return trees, names


def _tree(output: object) -> DataTree:
    """An output in memory as a tree."""
    import xarray as xr

    from mesoslip.output.validity import check_rows

    # The dataset of a sweep has no groups.
    tree = xr.DataTree(output) if isinstance(output, xr.Dataset) else output
    if not isinstance(tree, xr.DataTree):
        raise FileError(f"{shown(output)}: is not an output; give its path or its DataTree")
    check_rows(tree, "the output")
    return tree
