"""A sweep, checked: a configuration varied along axes."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from mesoslip.campaign.chain import DIRECTION, chain_problems, chained, unchained, with_directions
from mesoslip.campaign.combination import Value, described
from mesoslip.campaign.point import combination_key
from mesoslip.campaign.sweep_axes import axes_of
from mesoslip.campaign.sweep_table import MAX_POINTS, SweepFile
from mesoslip.campaign.user_measures import find_measures
from mesoslip.configuration.config import Config
from mesoslip.configuration.differences import check_changes
from mesoslip.configuration.files import Change, Merged, on_base, override, read_toml
from mesoslip.configuration.messages import problems
from mesoslip.configuration.reading import PathLike, as_path
from mesoslip.errors import ConfigError, Problem
from mesoslip.simulation.memory import free_memory, output_bytes

# Maximum number of wrong combinations that are listed.
MAX_REPORTED = 5
# Combinations after which progress is reported; memory of each, and of each point [bytes].
STEP = 1000
COMBINATION_BYTES, POINT_BYTES = 600.0, 500.0


class Plan:
    """The table ``[sweep]`` of a sweep, its axes and measures, and its configurations."""

    def __init__(self, tables: Mapping[str, Any], source: str, folder: Path) -> None:
        tables = dict(tables)
        if "sweep" not in tables:
            message = "missing; this table names the keys to vary and the measures"
            raise ConfigError([Problem(source, "sweep", message)])
        try:
            self.sweep = SweepFile.model_validate({"sweep": tables.pop("sweep")}).sweep
        except ValidationError as error:
            raise ConfigError(problems(error, source, SweepFile)) from None
        # The configuration that is varied.
        self.tables: dict[str, Any] = tables
        self._source = source
        self.axes = axes_of(self.sweep, source)
        self.measures = find_measures(self.sweep.measures, source, folder)
        if self.sweep.continue_ is not None:
            found = list(chain_problems(self.sweep, self.axes, self.measures, source))
            if found:
                raise ConfigError(found)
            self.axes = with_directions(self.axes, self.sweep)
        run = tables.get("run")
        of_run = run.get("realizations", 1) if isinstance(run, Mapping) else 1
        self.realizations: int = self.sweep.realizations or of_run
        count = math.prod(self.shape)
        if not isinstance(self.realizations, int) or count * self.realizations > MAX_POINTS:
            message = f"asks for more than {MAX_POINTS} points"
            raise ConfigError([Problem(source, "sweep", message)])

    @classmethod
    def load(cls, path: PathLike, overrides: Iterable[Change] = ()) -> Plan:
        """A sweep from its file and the base of that, with changes."""
        path, overrides = Path(path), list(overrides)
        plan = cls(override(read_toml(path), overrides).tables, str(path), path.parent)
        setters = {key: "the table [sweep]" for axis in plan.axes for key in axis.keys}
        if plan.sweep.realizations is not None:
            setters["run.realizations"] = "sweep.realizations"
        check_changes(overrides, setters, str(path))
        return plan

    @classmethod
    def from_dict(cls, tables: Mapping[str, Any], source: str = "sweep") -> Plan:
        """A sweep from nested tables, whose ``base`` and measures may name files."""
        return cls(on_base(tables, source, Path()).tables, source, Path())

    @property
    def shape(self) -> tuple[int, ...]:
        """Length of each axis."""
        return tuple(len(axis.rows) for axis in self.axes)

    @property
    def count(self) -> int:
        """Number of points: realizations of all combinations."""
        return math.prod(self.shape) * self.realizations

    @property
    def memory_bytes(self) -> float:
        """Memory of the combinations and points of a sweep, without its runs [bytes]."""
        return COMBINATION_BYTES * math.prod(self.shape) + POINT_BYTES * self.count

    def index(self, combination: int) -> tuple[int, ...]:
        """Where a combination is along each axis."""
        return tuple(int(at) for at in np.unravel_index(combination, self.shape))

    def values(self, combination: int) -> dict[str, Value]:
        """The swept values of a combination, in SI, by key."""
        return {
            key: value
            for axis, at in zip(self.axes, self.index(combination), strict=True)
            for key, value in zip(axis.keys, axis.rows[at], strict=True)
        }

    def config(self, combination: int) -> Config:
        """The configuration of a combination, made each time: 10⁶ of them would take 9 GB."""
        changes = {**self.values(combination), "run.realizations": 1}
        changes.pop(DIRECTION, None)
        merged = override(Merged(self.tables), [changes])
        return Config.from_dict(merged.tables, self._source)

    @property
    def keys(self) -> Sequence[str]:
        """Hashes of everything that determines the measures of each combination; see `check`."""
        return self._checked[0]

    @property
    def record_bytes(self) -> NDArray[np.float64]:
        """Size of the record of each run [bytes]; see `check`."""
        return self._checked[1]

    @cached_property
    def _checked(self) -> tuple[Sequence[str], NDArray[np.float64]]:
        return self._check(lambda _: None)

    def check(self, progress: Callable[[float], None]) -> None:
        """Check all combinations, of which 10⁶ take minutes; see `run_sweep` for ``progress``.

        A `ConfigError` says which are wrong.
        """
        self._checked = self._check(progress)

    def _check(
        self, progress: Callable[[float], None]
    ) -> tuple[Sequence[str], NDArray[np.float64]]:
        count = math.prod(self.shape)
        self._check_memory(count)
        found, wrong = list[Problem](), 0
        unchainable: dict[str, Problem] = {}
        keys, sizes = list[str](), np.empty(count)
        for number in range(count):
            if number % STEP == 0:
                progress(number / count)
            try:
                config = self.config(number)
            except ConfigError as error:
                wrong += 1
                if wrong <= MAX_REPORTED:
                    source = f"{self._source}: point {described(self.values(number))}"
                    found += [
                        Problem(source, one.key, one.message, one.value) for one in error.problems
                    ]
                continue
            if self.sweep.continue_ is not None:
                for one in unchained(config, self.sweep.continue_, self._source):
                    unchainable.setdefault(one.key, one)
            keys.append(combination_key(config, self.measures, self.sweep.discard))
            # By default only kept outputs have finer traces of slips.
            has_finer = self.sweep.traces or config.output.slip_interval is not None
            sizes[number] = output_bytes(config, has_finer=has_finer)
        if wrong > MAX_REPORTED:
            message = f"{wrong} of {count} combinations are wrong"
            found.append(Problem(self._source, "sweep", message))
        if found or unchainable:
            raise ConfigError(found or list(unchainable.values()))
        return keys, sizes

    def _check_memory(self, count: int) -> None:
        """Refuse a sweep whose combinations alone take more than the free memory."""
        needed, free = self.memory_bytes, free_memory()
        if needed > free:
            message = (
                f"has {count} combinations, which take about {needed / 2**30:.3g} GiB of memory, "
                f"and {free / 2**30:.3g} GiB are free; sweep them in parts"
            )
            raise ConfigError([Problem(self._source, "sweep", message)])

    def chains(self) -> Iterator[tuple[int, ...]]:
        """The combinations in chains, of which each run starts from the end of the one before;
        without `sweep.continue` each is a chain of its own."""
        if self.sweep.continue_ is None:
            return ((one,) for one in range(math.prod(self.shape)))
        return chained(self.axes, self.sweep)


def as_plan(plan: PathLike | Mapping[str, Any] | Plan) -> Plan:
    """A sweep from its file or from nested tables."""
    if isinstance(plan, Plan):
        return plan
    if isinstance(plan, Mapping):
        return Plan.from_dict(plan)
    return Plan.load(as_path(plan))
