"""A run that is drawn while it is computed, and stopped by the next one."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

from mesoslip.configuration.config import Config
from mesoslip.errors import ConfigError
from mesoslip.execution.stop import StopRequest
from mesoslip.simulation.memory import check_memory, free_memory
from mesoslip.simulation.realization import Realization
from mesoslip.simulation.run_realizations import Results

# Work of the first segment, and wall time of later ones [s], after which a stop takes effect.
FIRST_WORK = 5_000.0
SEGMENT_SECONDS = 0.03
# Time of the first picture [s], and the ratio of the times of later pictures.
FIRST_PICTURE = 0.1
PICTURE_RATIO = 2.0
# Maximum time to wait until the previous picture is drawn [s].
MAX_WAIT = 1.0

# Maximum numbers of samples of a trace, and of the finer traces of slips.
MAX_SAMPLES = 20_000
MAX_FINE_SAMPLES = 100_000
# Samples of a slip, in half a period of the slider.
SAMPLES_IN_SLIP = 100
# Maximum number of snapshots of the lattice, and their maximum size [bytes].
MAX_SNAPSHOTS = 100
MAX_SNAPSHOT_BYTES = 50_000_000
BYTES_PER_CONTACT = 24

# Maximum number of contacts: before the first segment each takes up to 1 us, which cannot be
# interrupted.
MAX_CONTACTS = 10_000_000
# Part of the free memory that a run may take, beside other pages and programs.
MAX_MEMORY_PART = 0.5


class Pace:
    """Lets a run send a picture only when the previous one was drawn, so that none queue up."""

    def __init__(self) -> None:
        self._drawn = threading.Event()
        self._drawn.set()

    def sent(self) -> None:
        """A picture was sent."""
        self._drawn.clear()

    def drawn(self) -> None:
        """The picture was drawn."""
        self._drawn.set()

    def wait(self) -> None:
        """Wait until the last picture was drawn, for a limited time, as a tab in the background
        draws none."""
        self._drawn.wait(MAX_WAIT)


def explored(config: Config) -> Config:
    """A configuration as it is run for the page: the same motion in one realization, with samples
    for pictures, and snapshots of a lattice."""
    expected = config.expected_duration
    interval = max(config.output_interval, expected / MAX_SAMPLES)
    output: dict[str, object] = {"interval": interval, "layers": False, "snapshots": []}
    if config.slider.slip_velocity(config) > 0:
        fine = config.output.slip_interval or config.slider.quiet_time / SAMPLES_IN_SLIP
        output["slip_interval"] = min(interval, max(fine, expected / MAX_FINE_SAMPLES))
    if config.contact_kind.on_lattice:
        size = BYTES_PER_CONTACT * config.contacts.count
        count = min(MAX_SNAPSHOTS, MAX_SNAPSHOT_BYTES // size)
        times = [expected * (number + 1) / count for number in range(count - 1)]
        output |= {"snapshots": times, "avalanche_size": max(1, config.contacts.count // 100)}
    return config.replace({"run.realizations": 1}, {"output": output})


def runnable(config: Config) -> Config:
    """A configuration as it is run for the page, see `explored`; a `ConfigError` if a run would
    need too much memory, or take long to start."""
    wanted = explored(config)
    count = wanted.contacts.count
    if wanted.contact_kind.is_discrete and count > MAX_CONTACTS:
        message = (
            f"more than {MAX_CONTACTS} contacts take too long to start on a page: use mesoslip run"
        )
        raise ConfigError.of("contacts.count", message, count)
    check_memory(wanted, MAX_MEMORY_PART * free_memory())
    return wanted


def run_live(config: Config, stop: StopRequest, show: Callable[[Results], None]) -> None:
    """Run the first realization of a configuration, and show the results so far: soon after the
    start, later less often, and at the end.

    The first picture is shown even after a stop, so that it follows a knob that is being turned.
    """
    start = time.perf_counter()
    due, work = FIRST_PICTURE, FIRST_WORK
    with Realization(config, 0) as realization:
        is_shown = False
        while not (realization.finished or (is_shown and stop.is_set())):
            before = time.perf_counter()
            realization.advance(work=work)
            now = time.perf_counter()
            work *= min(4.0, max(0.1, SEGMENT_SECONDS / max(now - before, 1e-9)))
            if realization.finished or now - start >= due:
                show(Results(config, [realization], realization.finished, now - start))
                is_shown = True
                due = PICTURE_RATIO * (time.perf_counter() - start)
