"""A run that is shown while it goes on, and cut off by the next one."""

from __future__ import annotations

import ctypes
import gc
import os
import sys
import threading
import time
from collections.abc import Callable

from mesoslip.configuration.config import Config
from mesoslip.simulation.realization import Realization
from mesoslip.simulation.runner import Results
from mesoslip.simulation.stop import StopFlag

Job = Callable[[StopFlag], None]

# Work of the first segment, and wall time that later ones are to take [s]: how long a run may go on
# after it was cut off.
FIRST_WORK = 5_000.0
SEGMENT_SECONDS = 0.03
# When a run is first shown, after its start [s]; the next times are this factor later each.
FIRST_LOOK = 0.1
LATER = 2.0

# How long a picture waits for the one before it to be drawn [s].
LONGEST_WAIT = 1.0

# Samples of a trace, and of the finer traces of slips, at most.
MOST_SAMPLES = 20_000
MOST_FINE_SAMPLES = 100_000
# Samples of a slip, in half a period of the slider.
SAMPLES_IN_SLIP = 100
# Snapshots of the lattice, and their greatest size [bytes].
SNAPSHOTS = 100
SNAPSHOT_BYTES = 50_000_000
BYTES_PER_CONTACT = 24


class Pace:
    """Lets a run send a picture when the one before it was drawn, so that none queue up."""

    def __init__(self) -> None:
        self._drawn = threading.Event()
        self._drawn.set()

    def sent(self) -> None:
        """A picture is on its way."""
        self._drawn.clear()

    def drawn(self) -> None:
        """It was drawn."""
        self._drawn.set()

    def wait(self) -> None:
        """Wait until the last picture was drawn; not for long, as a tab in the background draws
        none.
        """
        self._drawn.wait(LONGEST_WAIT)


class Worker:
    """A thread that does the newest of the jobs that it is given.

    A job is told to stop by the next one; of those that were not begun only the newest is done. A
    job that fails does not end the thread.

    Parameters
    ----------
    name
        Name of the thread.
    delay
        How long a job waits for one that is newer [s].
    """

    def __init__(self, name: str, delay: float = 0.0) -> None:
        self._condition = threading.Condition()
        self._delay = delay
        self._next: Job | None = None
        self._stop = StopFlag()
        self._is_closed = False
        self._thread = threading.Thread(target=self._work, name=name, daemon=True)
        self._thread.start()

    def submit(self, job: Job) -> None:
        """Do a job instead of that under way."""
        with self._condition:
            self._stop.set()
            self._next = job
            self._condition.notify()

    def cancel(self) -> None:
        """Do nothing until the next job."""
        with self._condition:
            self._stop.set()
            self._next = None

    def close(self) -> None:
        """End the thread, as soon as the job under way looks at its flag."""
        with self._condition:
            self._stop.set()
            self._next = None
            self._is_closed = True
            self._condition.notify()

    @property
    def is_alive(self) -> bool:
        """Whether the thread has not ended."""
        return self._thread.is_alive()

    def _work(self) -> None:
        while True:
            with self._condition:
                self._condition.wait_for(lambda: self._next is not None or self._is_closed)
                newest = self._next
                # As long as newer ones keep coming, none is begun.
                while self._delay and not self._is_closed:
                    self._condition.wait(self._delay)
                    if self._next is newest:
                        break
                    newest = self._next
                if self._is_closed:
                    return
                job, self._next = self._next, None
                self._stop = stop = StopFlag()
            if job is not None:
                try:
                    job(stop)
                except Exception:
                    # Told where the program was started, as for any thread.
                    threading.excepthook(
                        threading.ExceptHookArgs((*sys.exc_info(), threading.current_thread()))
                    )
            # Nothing of them stays until the next one.
            job = newest = None
            _give_back_memory()


def _give_back_memory() -> None:
    """Free what is left of runs, and give it back to the system where the C library has a way to.

    Trees of data refer to themselves, so that they wait for the collector of garbage. The C library
    keeps what it gets back otherwise, for each thread: after many runs as much as the largest of
    them took, several times.
    """
    gc.collect()
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None) if os.name == "posix" else None
    if trim is not None:
        trim(0)


def explored(config: Config) -> Config:
    """A configuration as it is run for the page: one realization, with as many samples as pictures
    show, and snapshots of a lattice. The motion is the same.

    Raises
    ------
    ConfigError
        If it cannot be run so.
    """
    expected = config.expected_duration
    interval = max(config.output_interval, expected / MOST_SAMPLES)
    output: dict[str, object] = {"interval": interval, "layers": False}
    if config.slider.slip_velocity(config) > 0:
        fine = config.output.slip_interval or config.slider.quiet_time / SAMPLES_IN_SLIP
        output["slip_interval"] = min(interval, max(fine, expected / MOST_FINE_SAMPLES))
    if config.contact_kind.on_lattice:
        size = BYTES_PER_CONTACT * config.contacts.count
        count = min(SNAPSHOTS, SNAPSHOT_BYTES // size)
        times = [expected * (number + 1) / count for number in range(count - 1)]
        output |= {"snapshots": times, "avalanche_size": max(1, config.contacts.count // 100)}
    return config.replace({"run.realizations": 1}, {"output": output})


def follow(config: Config, stop: StopFlag, show: Callable[[Results], None]) -> None:
    """Run the first realization of a configuration, and show what there is now and then.

    The first picture comes in any case, so that a knob that is being turned is followed by the
    picture, and not only when it rests.

    Parameters
    ----------
    config
        What to run.
    stop
        Set by who does not want to see more than the first picture.
    show
        Called with the results so far, soon after the start, later less often, and at the end.

    Raises
    ------
    RunError
        If the run fails.
    """
    realization = Realization(config, 0)
    start = time.perf_counter()
    due, work = FIRST_LOOK, FIRST_WORK
    try:
        is_shown = False
        while not (realization.finished or (is_shown and stop.is_set())):
            before = time.perf_counter()
            realization.advance(work=work)
            now = time.perf_counter()
            work *= min(4.0, max(0.1, SEGMENT_SECONDS / max(now - before, 1e-9)))
            if realization.finished or now - start >= due:
                show(Results(config, [realization], realization.finished, now - start))
                is_shown = True
                due = LATER * (time.perf_counter() - start)
    finally:
        realization.close()
