"""A sweep, checked: a configuration varied along axes, in chains of runs that follow each other."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from mesoslip.campaign.combination import Axis, Combination, described
from mesoslip.campaign.measures import Measure
from mesoslip.campaign.sweep_axes import axes_of
from mesoslip.campaign.sweep_table import MAX_POINTS, SweepFile, SweepTable
from mesoslip.campaign.user_measures import find_measures
from mesoslip.configuration.config import Config
from mesoslip.configuration.differences import check_changes
from mesoslip.configuration.files import Change, Merged, on_base, override, read_toml
from mesoslip.configuration.messages import problems
from mesoslip.configuration.reading import PathLike, as_path
from mesoslip.errors import ConfigError, Problem
from mesoslip.simulation.memory import free_memory
from mesoslip.simulation.start import CONTINUED

# Dimension of the order of a chain that goes up and down again, and its values.
DIRECTION = "direction"
DIRECTIONS = ("up", "down")
BOTH = "up and down"


def chain_problems(
    sweep: SweepTable, axes: Sequence[Axis], measures: Sequence[Measure], source: str
) -> Iterator[Problem]:
    """Errors of `sweep.continue` that show before any run."""
    key = sweep.continue_
    if key not in CONTINUED:
        message = (
            f"must be one of {', '.join(CONTINUED)}: with any other key the contacts of the last "
            "run are not contacts of the next one"
        )
        yield Problem(source, "sweep.continue", message, key)
    elif all(axis.keys != (key,) for axis in axes):
        yield Problem(source, "sweep.continue", "needs values in [sweep.grid]", key)
    for one in measures:
        if one.runs_again:
            message = (
                f"{one.name} is measured in another run, which starts as contacts.initial says; "
                "leave it out with sweep.continue"
            )
            yield Problem(source, "sweep.measures", message)


def with_directions(axes: Sequence[Axis], sweep: SweepTable) -> tuple[Axis, ...]:
    """The axes of a sweep, with that of the direction last where it goes up and down."""
    if sweep.order != BOTH:
        return tuple(axes)
    rows = tuple((one,) for one in DIRECTIONS)
    return (*axes, Axis(DIRECTION, (DIRECTION,), rows))


def unchained(combinations: Sequence[Combination], key: str, source: str) -> Iterator[Problem]:
    """Why runs cannot start from the end of another."""
    configs = [one.config for one in combinations]
    if key == "slider.stiffness":
        kind = next((one.slider.kind for one in configs if one.slider.oscillator is None), None)
        if kind is not None:
            message = f"slider.stiffness needs a slider of kind 'rigid', not {kind!r}"
            yield Problem(source, "sweep.continue", message)
    if any(one.pressing.varies for one in configs):
        message = "must be constant with sweep.continue: its stages start with a run"
        yield Problem(source, "load", message)
    stops: dict[str, list[float | None]] = {
        "run.avalanches": [one.run.avalanches for one in configs],
        "run.stop.displacement": [one.run.stops.displacement for one in configs],
    }
    for name, values in stops.items():
        value = next((one for one in values if one is not None), None)
        if value is not None:
            message = (
                "ends a run where no other can start; with sweep.continue a run ends with its "
                "duration, run.stop.slips or run.stop.steady"
            )
            yield Problem(source, name, message, value)


def chained(
    combinations: Sequence[Combination], axes: Sequence[Axis], sweep: SweepTable
) -> tuple[tuple[Combination, ...], ...]:
    """Combinations in chains, each in the order of its runs."""
    along = next(at for at, axis in enumerate(axes) if axis.keys == (sweep.continue_,))
    values = [row[0] for row in axes[along].rows]
    ascending = sorted(range(len(values)), key=lambda number: values[number])
    rank = {number: at for at, number in enumerate(ascending)}
    within = {along, *(at for at, axis in enumerate(axes) if axis.dimension == DIRECTION)}

    def others(one: Combination) -> tuple[int, ...]:
        return tuple(number for at, number in enumerate(one.index) if at not in within)

    def order(one: Combination) -> tuple[int, int]:
        at = one.index[along]
        match sweep.order:
            case "up":
                return 0, rank[at]
            case "down":
                return 0, -rank[at]
            case "up and down":
                goes_down = one.index[-1]
                return goes_down, -rank[at] if goes_down else rank[at]
            case _:
                return 0, at

    ordered = sorted(combinations, key=lambda one: (others(one), order(one)))
    return tuple(tuple(chain) for _, chain in itertools.groupby(ordered, key=others))


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
