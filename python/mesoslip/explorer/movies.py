"""The movie of a run, which is run again for it with more recorded."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from mesoslip.configuration.config import Config
from mesoslip.errors import ConfigError
from mesoslip.execution.stop import StoppedError, StopRequest
from mesoslip.explorer.live_run import explored, run_live
from mesoslip.output.tree import build_tree
from mesoslip.plots.close_up import largest_slip, slip_window
from mesoslip.plots.plot import plot
from mesoslip.simulation.run_realizations import Results

# Number of snapshots of a movie, and the fraction of them in the largest slip.
SNAPSHOTS = 100
IN_SLIP = 0.7
# Maximum number of recorded displacements of layers.
MAX_LAYER_SAMPLES = 2_000_000
# Step of the reports of progress [%].
REPORTED = 10


def movie_of(config: Config, stop: StopRequest, report: Callable[[str], None]) -> bytes | None:
    """A movie of a run as a GIF; None if it was stopped.

    On a lattice it shows the load of each contact, of an elastic slider its layers, of an interface
    its largest event, and otherwise the stretches of the contacts. Messages on its progress are
    reported.
    """
    view, wanted = recorded_for_movie(config)
    report("the movie: running …")

    last = 0

    def drawn(part: float) -> None:
        nonlocal last
        if stop.is_set():
            raise StoppedError("the movie was stopped")
        tens = REPORTED * int(100 * part / REPORTED)
        if tens > last:
            last = tens
            report(f"the movie: {tens} % drawn")

    results = finished_run(wanted, stop)
    if results is None:
        return None
    if view in {"contacts", "layers"}:
        results = finished_run(around_slip(wanted, results), stop)
        if results is None:
            return None
    with TemporaryDirectory() as folder:
        path = Path(folder) / "movie.gif"
        try:
            plot(build_tree(results), path, view=view, progress=drawn)
        except StoppedError:
            return None
        return path.read_bytes()


def recorded_for_movie(config: Config) -> tuple[str, Config]:
    """The view of the movie, and the configuration of a run that records it."""
    wanted = explored(config)
    if wanted.contact_kind.on_lattice:
        return "lattice", wanted
    if wanted.slider.block_count > 1:
        return "fronts", wanted
    if wanted.slider.layer_count > 1:
        return "layers", wanted.replace({"output.layers": True})
    if not wanted.contact_kind.is_discrete:
        message = 'a movie shows contacts one by one, which engine "eq" has'
        raise ConfigError.of("run.engine", message, config.run.engine)
    return "contacts", wanted


def around_slip(config: Config, results: Results) -> Config:
    """A configuration with snapshots, most of them in the largest slip of its run; of layers with
    samples that are fine enough for the slip."""
    slip = largest_slip(build_tree(results))
    end = config.expected_duration
    if config.output.layers:
        if slip is None:
            return config
        low, high = slip_window(slip)
        min_interval = end * config.slider.layer_count / MAX_LAYER_SAMPLES
        interval = min(max((high - low) / SNAPSHOTS, min_interval), config.output_interval)
        fine = min(interval, config.slip_interval or interval)
        return config.replace({"output.interval": interval, "output.slip_interval": fine})
    if slip is None:
        return config.replace({"output.snapshots": np.linspace(0.0, end, SNAPSHOTS).tolist()})
    low, high = slip_window(slip)
    inside = np.linspace(max(low, 0.0), min(high, end), round(IN_SLIP * SNAPSHOTS))
    around = np.linspace(0.0, end, round((1 - IN_SLIP) * SNAPSHOTS) + 1)[1:-1]
    return config.replace({"output.snapshots": np.union1d(inside, around).tolist()})


def finished_run(config: Config, stop: StopRequest) -> Results | None:
    """The whole run; None if it was stopped."""
    seen: list[Results] = []
    run_live(config, stop, seen.append)
    return seen[-1] if seen[-1].complete else None
