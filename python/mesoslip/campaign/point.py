"""A point: one realization of one combination, computed anywhere to the same numbers."""

from __future__ import annotations

import hashlib
import json
import tempfile
import threading
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mesoslip import _build
from mesoslip.campaign.measures import RunView, measure_of, measured
from mesoslip.configuration.config import Config
from mesoslip.errors import MesoslipError
from mesoslip.output import writing
from mesoslip.output.provenance import version
from mesoslip.output.tree import build_tree
from mesoslip.simulation.realization import Realization
from mesoslip.simulation.runner import TOO_MUCH, Results
from mesoslip.simulation.stop import StopFlag

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mesoslip.campaign.measures import Measure

# Changes when the numbers of measures do, so that points of earlier ones are not taken.
FORMAT = 1

# HDF5 is used by one thread of a process at a time.
_HDF5 = threading.Lock()


def program() -> str:
    """The program that computes points: its version and commit."""
    return f"mesoslip {version('mesoslip')} {_build.COMMIT}"


@dataclass(frozen=True)
class Task:
    """What a worker needs to know of a point; nothing but plain values, to be sent anywhere.

    Attributes
    ----------
    name
        Under which the point is stored, see `point_name`.
    config
        The configuration as nested tables.
    realization
        Number of the realization.
    measures
        Name, text and name of the user's file of each measure.
    discard
        Part of the run that measures leave out.
    trace
        Whether the output of the run is wanted too.
    program
        What is to compute it.
    """

    name: str
    config: dict[str, Any]
    realization: int
    measures: tuple[tuple[str, str, str], ...]
    discard: float
    trace: bool
    program: str


@dataclass(frozen=True)
class Outcome:
    """What came out of a point: its measures, or why there are none.

    Attributes
    ----------
    measures
        By name.
    seconds
        Computing time.
    trace
        The bytes of an output file, if it was wanted.
    failure
        Why it failed; empty if it did not.
    is_complete
        Whether the point came to its end; not so if it was stopped.
    """

    measures: dict[str, float]
    seconds: float = 0.0
    trace: bytes | None = None
    failure: str = ""
    is_complete: bool = True


def point_name(
    config: Config, realization: int, measures: Sequence[Measure], discard: float
) -> str:
    """The name of a point: a hash of all that its measures follow from.

    Neither the title of a run nor how many realizations it has makes a difference.
    """
    tables = config.to_dict()
    tables.pop("title", None)
    tables["run"] = {key: value for key, value in tables["run"].items() if key != "realizations"}
    everything = {
        "format": FORMAT,
        "program": program(),
        "configuration": tables,
        "realization": realization,
        "measures": sorted(one.identity for one in measures),
        "discard": discard,
    }
    text = json.dumps(everything, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:32]


def compute(task: Task, stop: StopFlag | None = None) -> Outcome:
    """Run a point and measure it. Whatever goes wrong is told in the outcome."""
    start = time.perf_counter()
    try:
        outcome = _compute(task, stop or StopFlag())
    except MesoslipError as error:
        outcome = Outcome({}, failure=str(error))
    except MemoryError:
        outcome = Outcome({}, failure=TOO_MUCH)
    # What nobody has thought of ends this point, not those beside it.
    except Exception as error:
        outcome = Outcome({}, failure=f"{type(error).__name__}: {error}")
    return Outcome(
        outcome.measures,
        time.perf_counter() - start,
        outcome.trace,
        outcome.failure,
        outcome.is_complete,
    )


def _compute(task: Task, stop: StopFlag) -> Outcome:
    if task.program != program():
        return Outcome({}, failure=f"the worker has {program()}, and {task.program} is wanted")
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
