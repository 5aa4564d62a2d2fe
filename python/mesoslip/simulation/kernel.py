"""The handle of a simulation that lives in the Fortran kernels."""

from __future__ import annotations

import threading
import weakref
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, NoReturn

import numpy as np
from numpy.typing import NDArray

from mesoslip import _core
from mesoslip.array_types import Array
from mesoslip.configuration.kernel_parameters import Named, Parameters, named, padded
from mesoslip.errors import NoMemoryError, RunError
from mesoslip.memory_limit import RESERVE, is_memory_short

Words = NDArray[np.int64]

# Maximum number of names in a list.
MAX_NAMES = 64
# Status of a kernel without enough memory (fortran/numerics/errors.f90).
NO_MEMORY = 2
# Room for the numbers in all rows of short realizations.
SHORT_NUMBERS = 2**18


class Progress(NamedTuple):
    """The progress of a simulation; ``ending`` says why it is over, and is empty before."""

    ending: str
    time: float
    """Time [s]."""
    displacement: float
    """Displacement of the slider [m]."""
    breaks: float
    detached: float
    """Number of detached contacts."""
    avalanche_slip: float
    """Displacement of the slider in avalanches [m]."""
    force_error: float
    """Estimated error of the contact force [N]; 0 where contacts are kept one by one."""
    advances: int
    """Advances of the slider, each at most to the next event."""
    avalanches: int
    integrator_counts: NDArray[np.int64]
    """Steps, evaluations and failed steps of the slider's integrator, if it has one."""


# A realization at its end: progress, terms of the energy balance [J], rows by table.
Completed = tuple[Progress, Array, dict[str, Array]]


def checked(results: Any) -> tuple[Any, ...]:
    """Results of a kernel without its status and message; raises a `RunError` if it failed."""
    *values, status, message = results
    if status != 0:
        kind = NoMemoryError if status == NO_MEMORY else RunError
        raise kind(message.decode().strip())
    return tuple(values)


def check_reserve() -> None:
    """Raise a `NoMemoryError` if there is hardly any memory."""
    if is_memory_short(RESERVE):
        raise NoMemoryError("there is not enough memory for a simulation")


class Kernel:
    """A simulation in Fortran: its parts are set, then it is started or restored, then it advances.

    Simulations are independent of each other; each is used by one thread at a time. Every method
    raises a `RunError` if the simulation is closed, in use on another thread, incomplete, or fails.
    """

    def __init__(self) -> None:
        check_reserve()
        self._handle: Words = np.zeros(2, dtype=np.int64)
        self._lock = threading.Lock()
        _core.open_simulation(self._handle)
        # The finalizer holds the handle, not this object.
        self._free = weakref.finalize(self, _core.close_simulation, self._handle)
        # At exit a thread may still use the simulation.
        self._free.atexit = False

    def _call(self, procedure: Any, *arguments: Any, **by_name: Any) -> tuple[Any, ...]:
        if not self._lock.acquire(blocking=False):
            raise RunError("the simulation is at work on another thread")
        try:
            return checked(procedure(self._handle, *arguments, **by_name))
        finally:
            self._lock.release()

    def close(self) -> None:
        """Free the simulation when no thread uses it any more."""
        with self._lock:
            self._free()

    @property
    def is_open(self) -> bool:
        return self._free.alive

    def __copy__(self) -> NoReturn:
        raise TypeError("a simulation cannot be copied; save it, and restore another one from it")

    def __deepcopy__(self, _: Any) -> NoReturn:
        self.__copy__()

    def __reduce__(self) -> NoReturn:
        self.__copy__()

    def set_contacts(
        self, kind: str, parameters: Parameters | Named, seed: int, realization: int
    ) -> None:
        """Make the contacts of a kind from named parameters."""
        self._call(_core.set_contacts, kind, *named(parameters), seed, realization)

    def copy_contacts(self, template: Kernel) -> None:
        """Copy the contacts of a simulation that is not started, which is faster than making them
        again."""
        self._call(_core.copy_contacts, template._handle)

    def set_slider(self, kind: str, parameters: Mapping[str, float | str] | Named) -> None:
        """Make the slider of a kind from named parameters."""
        self._call(_core.set_slider, kind, *named(parameters))

    def set(self, procedure: Any, **values: Any) -> None:
        """Set the drive, the stops or the recorder, by ``_core.set_drive``, ``_core.set_stop`` or
        another procedure, with its arguments by name."""
        self._call(procedure, **values)

    def start(self, initial: str) -> None:
        """Draw the contacts in an initial state, with the slider in equilibrium with them."""
        self._call(_core.start_simulation, initial)

    def advance(self, max_advances: int, max_work: float) -> None:
        """Advance by a number of advances or an amount of work, until buffers should be drained, or
        to the end; the unit of work is an advance of a rigid slider or the break of a contact."""
        check_reserve()
        self._call(_core.advance_simulation, max_advances, max_work)

    def run_realizations(
        self, numbers: Sequence[int], initial: str, tables: Sequence[str], max_work: float
    ) -> list[Completed]:
        """Run realizations of this simulation, which is not started, each to its end, up to one
        that is long, records much or fails; tables without rows are left out."""
        check_reserve()
        values = np.empty(SHORT_NUMBERS)
        done, *results, columns, rows = self._call(
            _core.run_realizations,
            np.array(numbers, dtype=np.int64),
            initial,
            max_work,
            padded(tables),
            values,
        )
        progress, counts, energy, lengths = (one.T[:done] for one in (*results, rows))
        widths = tuple(zip(tables, columns.tolist(), strict=True))
        completed: list[Completed] = []
        start = 0
        for reals, (ending, advances, avalanches, *_), integrator, terms, several in zip(
            progress.tolist(), counts.tolist(), counts[:, 3:], energy, lengths.tolist(), strict=True
        ):
            found = {}
            for (table, width), length in zip(widths, several, strict=True):
                if length:
                    end = start + length * width
                    # Its own, as one that stays in memory would keep those of all others there.
                    found[table] = values[start:end].reshape(length, width).copy()
                    start = end
            now = Progress._make((ENDING_NAMES[ending], *reals, advances, avalanches, integrator))
            completed.append((now, terms, found))
        return completed

    def ask(self) -> Progress:
        """The present progress."""
        ending, *numbers = self._call(_core.ask_simulation)
        return Progress(ending.decode().strip(), *numbers)

    def energy(self) -> Array:
        """Terms of the energy balance [J]."""
        (values,) = self._call(_core.ask_energy)
        return np.asarray(values)

    def contacts(self, count: int) -> Array:
        """Origin, stiffness, breaking stretch and renewals of each contact, shape (4, count)."""
        (values,) = self._call(_core.ask_contacts, count)
        return np.asarray(values)

    def drain(self, *tables: str) -> dict[str, Array]:
        """Remove the recorded rows of some tables; returns them by table, shape (rows, columns)."""
        drained = {}
        counts = self._call(_core.count_rows, len(TABLE_NAMES))
        for table, columns, rows in zip(
            TABLE_NAMES, *(one.tolist() for one in counts), strict=True
        ):
            if table in tables:
                drained[table] = values = np.empty((rows, columns))
                if rows:
                    self._call(_core.drain_rows, table, values.T)
        return drained

    def save(self) -> Words:
        """The whole state, from which another simulation with the same parts can continue."""
        (length,) = self._call(_core.save_simulation)
        words = np.empty(length, dtype=np.int64)
        self._call(_core.fetch_state, words)
        return words

    def displace_drive(self, distance: float) -> None:
        """Displace the drive instantly by a distance [m]."""
        self._call(_core.displace_drive, distance)

    def follow(self) -> None:
        """Continue another run from its restored end, with its time, displacement and counts, by
        the second part of the drive."""
        self._call(_core.follow_simulation)

    def restore(self, words: Words) -> None:
        """Continue from a state, instead of starting."""
        self._call(_core.restore_simulation, words)


def name_list(which: str) -> tuple[str, ...]:
    """A list of names that the kernels define: the columns of a table, or kinds of parts."""
    names, count = checked(_core.list_names(which, MAX_NAMES))
    return tuple(str(name) for name in np.char.strip(np.char.decode(names[:count])))


# Tables that a simulation records, and reasons why it is over by their numbers.
TABLE_NAMES = name_list("tables")
ENDING_NAMES = ("", *name_list("endings"))
