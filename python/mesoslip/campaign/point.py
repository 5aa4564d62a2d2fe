"""A point: one realization of one combination, identical wherever it is computed."""

from __future__ import annotations

import hashlib
import json
import tempfile
import threading
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mesoslip.campaign.measures import RunView, measure_of, measured
from mesoslip.configuration.config import Config
from mesoslip.errors import MesoslipError
from mesoslip.execution.program import program
from mesoslip.execution.stop import Stop
from mesoslip.output import writing
from mesoslip.output.tree import build_tree
from mesoslip.simulation.realization import Realization
from mesoslip.simulation.runner import NO_MEMORY, Results

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mesoslip.campaign.measures import Measure

# Incremented when values of measures change, so that older points are not used.
FORMAT = 2

# One thread of a process uses HDF5 at a time.
_HDF5 = threading.Lock()


@dataclass(frozen=True)
class Task:
    """A point for a worker, in plain values that can be sent to any process.

    Attributes
    ----------
    name
        Name under which the point is stored, see `point_name`.
    config
        The configuration as nested tables.
    realization
        Number of the realization.
    measures
        Name, source text and file name of each measure.
    discard
        Fraction of the run that measures leave out.
    trace
        Whether the output of the run is kept.
    """

    name: str
    config: dict[str, Any]
    realization: int
    measures: tuple[tuple[str, str, str], ...]
    discard: float
    trace: bool


@dataclass(frozen=True)
class Outcome:
    """Result of a point: its measures, or the reason of its failure.

    Attributes
    ----------
    measures
        By name.
    seconds
        Computing time.
    trace
        The content of its output file, if it is kept.
    failure
        Why it failed; empty if it succeeded.
    is_complete
        Whether the point was finished, not stopped.
    """

    measures: dict[str, float]
    seconds: float = 0.0
    trace: bytes | None = None
    failure: str = ""
    is_complete: bool = True


def combination_key(config: Config, measures: Sequence[Measure], discard: float) -> str:
    """A hash of everything that determines the measures of a combination, except the realization.

    Title and number of realizations do not count.
    """
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


def compute(task: Task, stop: Stop) -> Outcome:
    """Run a point and measure it. Errors are reported in the outcome."""
    start = time.perf_counter()
    try:
        outcome = _compute(task, stop)
    except MesoslipError as error:
        outcome = Outcome({}, failure=str(error))
    except MemoryError:
        outcome = Outcome({}, failure=NO_MEMORY)
    # An unexpected error ends this point, not the others.
    except Exception as error:
        outcome = Outcome({}, failure=f"{type(error).__name__}: {error}")
    return Outcome(
        outcome.measures,
        time.perf_counter() - start,
        outcome.trace,
        outcome.failure,
        outcome.is_complete,
    )


def _compute(task: Task, stop: Stop) -> Outcome:
    config = Config.from_dict(task.config)
    realization = Realization(config, task.realization)
    try:
        while not realization.finished:
            if stop.is_set():
                return Outcome({}, is_complete=False)
            realization.advance()
    finally:
        realization.close()
    results = Results(config, [realization], True, realization.kernel_seconds)
    tree = build_tree(results)
    run = RunView(tree, task.discard * realization.time)
    measures = {one[0]: measured(run, measure_of(*one)) for one in task.measures}
    return Outcome(measures, trace=_output(results) if task.trace else None)


def _output(results: Results) -> bytes:
    """The output file of a run."""
    with _HDF5, tempfile.TemporaryDirectory(prefix="mesoslip-") as folder:
        path = Path(folder) / "point.nc"
        writing.write_results(results, path)
        return path.read_bytes()
