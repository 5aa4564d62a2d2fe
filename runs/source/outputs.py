"""Outputs of the runs that figures and claims need."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Protocol, TypeVar

import xarray as xr
from mesoslip.configuration.config import Config
from mesoslip.errors import ConfigError, FileError, Problem
from mesoslip.output import files


class FromRuns(Protocol):
    """A figure or claim."""

    @property
    def runs(self) -> tuple[str, ...]:
        """Names of outputs under the folder of outputs, without ``.nc``."""
        ...


Made = TypeVar("Made", bound=FromRuns)


def chosen(
    names: Iterable[str], known: Mapping[str, Made], what: str, outputs: Path
) -> dict[str, Made]:
    """Figures or claims of names, or all; the outputs that they need exist."""
    names = tuple(names) or tuple(known)
    unknown = [name for name in names if name not in known]
    if unknown:
        text = f"no such {what}; choose from {', '.join(known)}"
        raise ConfigError([Problem("", name, text) for name in unknown])
    wanted = {name: known[name] for name in names}
    paths = {outputs / f"{run}.nc" for one in wanted.values() for run in one.runs}
    missing = sorted(path for path in paths if not path.exists())
    if missing:
        targets = " ".join(map(str, missing))
        raise FileError(f"outputs are missing; make them first: make {targets}")
    return wanted


@contextmanager
def opened(runs: Iterable[str], outputs: Path) -> Iterator[list[xr.DataTree]]:
    """The outputs of runs, closed at the end."""
    with ExitStack() as stack:
        yield [stack.enter_context(files.opened(outputs / f"{run}.nc")) for run in runs]


def configuration(tree: xr.DataTree) -> Config:
    """The configuration of an output."""
    return Config.from_toml(tree.attrs["configuration"])
