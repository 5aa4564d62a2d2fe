"""A sweep, checked: a configuration that is varied along axes.

Axes multiply, and each combination is run for a number of realizations. A *point* is one
realization of one combination.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Mapping
from functools import cached_property
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from mesoslip.campaign.chain import DIRECTION, chain_problems, chained, unchained, with_directions
from mesoslip.campaign.combination import Combination, described
from mesoslip.campaign.sweep_axes import axes_of
from mesoslip.campaign.sweep_table import MAX_POINTS, SweepFile
from mesoslip.campaign.user_measures import find_measures
from mesoslip.configuration.config import Config
from mesoslip.configuration.differences import check_changes
from mesoslip.configuration.files import Change, Merged, on_base, override, read_toml
from mesoslip.configuration.messages import problems
from mesoslip.configuration.reading import PathLike, as_path
from mesoslip.errors import ConfigError, Problem
from mesoslip.simulation.memory import free_memory

# Maximum number of wrong combinations that are listed.
MAX_REPORTED = 5
# Combinations after which progress is reported, and memory that each takes [bytes].
STEP = 1000
COMBINATION_BYTES = 9e3


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

    @cached_property
    def combinations(self) -> tuple[Combination, ...]:
        """All combinations, in the order of the dataset; a `ConfigError` says which are wrong."""
        return self._checked(lambda _: None)

    def check(self, progress: Callable[[float], None]) -> None:
        """Make all `combinations`, of which 10⁶ take minutes; see `run_sweep` for ``progress``."""
        self.combinations = self._checked(progress)

    def _checked(self, progress: Callable[[float], None]) -> tuple[Combination, ...]:
        combinations, found, wrong = [], list[Problem](), 0
        count = math.prod(self.shape)
        needed, free = COMBINATION_BYTES * count, free_memory()
        if needed > free:
            message = (
                f"has {count} combinations, which take about {needed / 2**30:.3g} GiB of memory, "
                f"and {free / 2**30:.3g} GiB are free; sweep them in parts"
            )
            raise ConfigError([Problem(self._source, "sweep", message)])
        for number, index in enumerate(itertools.product(*map(range, self.shape))):
            if number % STEP == 0:
                progress(number / count)
            values = {
                key: value
                for axis, at in zip(self.axes, index, strict=True)
                for key, value in zip(axis.keys, axis.rows[at], strict=True)
            }
            changes = {**values, "run.realizations": 1}
            changes.pop(DIRECTION, None)
            try:
                config = Config.from_dict(
                    override(Merged(self.tables), [changes]).tables, self._source
                )
            except ConfigError as error:
                wrong += 1
                if wrong <= MAX_REPORTED:
                    source = f"{self._source}: point {described(values)}"
                    found += [
                        Problem(source, one.key, one.message, one.value) for one in error.problems
                    ]
                continue
            combinations.append(Combination(index, values, config))
        if wrong > MAX_REPORTED:
            message = f"{wrong} of {count} combinations are wrong"
            found.append(Problem(self._source, "sweep", message))
        if self.sweep.continue_ is not None and not found:
            found += unchained(combinations, self.sweep.continue_, self._source)
        if found:
            raise ConfigError(found)
        return tuple(combinations)

    @cached_property
    def chains(self) -> tuple[tuple[Combination, ...], ...]:
        """The combinations in chains, of which each run starts from the end of the one before; one
        a chain without `sweep.continue`."""
        if self.sweep.continue_ is None:
            return tuple((one,) for one in self.combinations)
        return chained(self.combinations, self.axes, self.sweep)


def as_plan(plan: PathLike | Mapping[str, Any] | Plan) -> Plan:
    """A sweep from its file or from nested tables."""
    if isinstance(plan, Plan):
        return plan
    if isinstance(plan, Mapping):
        return Plan.from_dict(plan)
    return Plan.load(as_path(plan))
