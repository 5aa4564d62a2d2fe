"""A point: one realization of one combination, identical wherever it is computed.

Points of a chain are computed together, as each starts from the end of the one before.
"""

from __future__ import annotations

import hashlib
import json
import tempfile
import threading
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mesoslip.campaign.measures import RunView
from mesoslip.campaign.user_measures import measure_of, measured
from mesoslip.configuration.config import Config
from mesoslip.errors import MesoslipError
from mesoslip.execution.program import program
from mesoslip.execution.stop import Stop
from mesoslip.output import writing
from mesoslip.output.tree import build_tree
from mesoslip.simulation.realization import Realization
from mesoslip.simulation.run_realizations import NO_MEMORY, Results

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from mesoslip.campaign.measures import Measure
    from mesoslip.simulation.start import End

# Incremented when values of measures change, so that older points are not used.
FORMAT = 2

# One thread of a process uses HDF5 at a time.
_HDF5 = threading.Lock()


@dataclass(frozen=True)
class Task:
    """The points of a chain for a worker, in plain values that can be sent to any process.

    It has the names under which points are stored, configurations as nested tables, and name,
    source text and file name of each measure. Measures leave out the fraction `discard` of a run.
    """

    names: tuple[str, ...]
    configs: tuple[dict[str, Any], ...]
    realization: int
    measures: tuple[tuple[str, str, str], ...]
    discard: float
    trace: bool


@dataclass(frozen=True)
class Outcome:
    """Measures of a point, its computing time [s], and the content of the output file if that is
    kept; or the reason of its failure."""

    measures: dict[str, float]
    seconds: float = 0.0
    trace: bytes | None = None
    failure: str = ""


def chain_keys(combination_keys: Iterable[str]) -> tuple[str, ...]:
    """Hashes of everything that determines the measures of each combination of a chain, except the
    realization: the combination and those before it."""
    keys: list[str] = []
    for key in combination_keys:
        if keys:
            key = hashlib.sha256(f"{keys[-1]} then {key}".encode()).hexdigest()
        keys.append(key)
    return tuple(keys)


def combination_key(config: Config, measures: Sequence[Measure], discard: float) -> str:
    """A hash of everything that determines the measures of a combination, except the realization:
    neither the title nor the number of realizations does."""
    tables = config.to_dict()
    tables.pop("title", None)
    tables["run"] = {key: value for key, value in tables["run"].items() if key != "realizations"}
    everything = {
        "format": FORMAT,
        "program": program(),
        "configuration": tables,
        "measures": sorted(one.identity for one in measures),
        "discard": discard,
    }
    return hashlib.sha256(json.dumps(everything, sort_keys=True).encode()).hexdigest()


def point_name(key: str, realization: int) -> str:
    """The name of a point: a hash of everything that determines its measures."""
    return hashlib.sha256(f"{key} {realization}".encode()).hexdigest()[:32]


def compute(task: Task, stop: Stop) -> tuple[Outcome, ...]:
    """Run the points of a chain and measure them; errors are in the outcomes, of which a stop
    leaves some out."""
    outcomes: list[Outcome] = []
    end: End | None = None
    for at in range(len(task.configs)):
        start = time.perf_counter()
        try:
            outcome, end = _compute(task, at, end, stop)
        except MesoslipError as error:
            outcome, end = Outcome({}, failure=str(error)), None
        except MemoryError:
            outcome, end = Outcome({}, failure=NO_MEMORY), None
        # An unexpected error ends this chain, not the others.
        except Exception as error:
            outcome, end = Outcome({}, failure=f"{type(error).__name__}: {error}"), None
        if outcome is None:
            break
        outcomes.append(replace(outcome, seconds=time.perf_counter() - start))
        if end is None:
            left = len(task.configs) - len(outcomes)
            outcomes += left * [Outcome({}, failure="the run from which it starts failed")]
            break
    return tuple(outcomes)


def _compute(
    task: Task, at: int, after: End | None, stop: Stop
) -> tuple[Outcome | None, End | None]:
    """Run a point from the end of the one before: its outcome, None if stopped, and its end if
    another point follows."""
    config = Config.from_dict(task.configs[at])
    if config.output.slip_interval is None and not task.trace:
        # No measure needs finer traces, and no file of the run is kept.
        config = config.replace({"output.slip_interval": 0.0})
    realization = Realization(config, task.realization, after=after)
    try:
        while not realization.finished:
            if stop.is_set():
                return None, None
            realization.advance()
        end = realization.end if at + 1 < len(task.configs) else None
    finally:
        realization.close()
    results = Results(config, [realization], True, realization.kernel_seconds)
    tree = build_tree(results)
    run = RunView(tree, task.discard * realization.time)
    try:
        measures = {one[0]: measured(run, measure_of(*one)) for one in task.measures}
    except MesoslipError as error:
        return Outcome({}, failure=str(error)), end
    return Outcome(measures, trace=_output(results) if task.trace else None), end


def _output(results: Results) -> bytes:
    """The output file of a run."""
    with _HDF5, tempfile.TemporaryDirectory(prefix="mesoslip-") as folder:
        path = Path(folder) / "point.nc"
        writing.write_results(results, path)
        return path.read_bytes()
