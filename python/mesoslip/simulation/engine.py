"""The engines, earthquake-like and master equation: realizations, side by side on threads.

The kernel's whole state is plain arrays held here, so a realization can stop after any segment
and go on; its numbers do not depend on where segments end, or on what runs beside it.
"""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, wait
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from mesoslip import _core
from mesoslip.errors import RunError

if TYPE_CHECKING:
    from mesoslip.configuration.config import Config

Array = NDArray[np.float64]

TRACE_COLUMNS = (
    "time",
    "drive_displacement",
    "displacement",
    "velocity",
    "spring_force",
    "contact_force",
    "detached_contacts",
    "elastic_force",
    "base_displacement",
)
SLIP_COLUMNS = (
    "slip",
    "start_time",
    "end_time",
    "force_before",
    "force_after",
    "peak_velocity",
    "contacts_broken",
)
AVALANCHE_COLUMNS = (
    "time",
    "displacement",
    "size",
    "force_before",
    "force_drop",
    "slip",
    "area",
    "width",
    "height",
    "generations",
)
SNAPSHOT_COLUMNS = ("time", "displacement", "size")
ENERGY_COLUMNS = (
    "drive_work",
    "slider_energy",
    "contact_energy",
    "damping_loss",
    "drag_loss",
    "break_loss",
    "birth_gain",
    "residual",
)

ENGINES = {"eq": 1, "me": 2}
SLIDERS = {"rigid": 1, "prescribed": 2, "layered": 3, "quasistatic": 4}
FORCE_DRIVEN = 5
# What the kernel's interface takes of a slider, and a kind may not have.
NO_SLIDER = {
    "mass": 1.0,
    "stiffness": 1.0,
    "damping": 0.0,
    "layers": 1,
    "base_mass": 0.0,
    "base_stiffness": 0.0,
    "base_damping": 0.0,
    "solver": 0,
    "relative_tolerance": 1e-8,
    "absolute_tolerance": 1e-17,
}
ENDINGS = {
    1: "the drive came to its end",
    2: "as many avalanches as wanted",
    3: "no contact is left to break",
    4: "contacts break under the force without end",
}

# Work of the drive over the energy of all contacts about to break, below which it does not count.
LEAST_ENERGY = 1e-9

TOO_MUCH = (
    "not enough memory for what is recorded: a larger output.avalanche_size or "
    "output.snapshot_size, or a longer output.interval, takes less"
)

# The end of a drive that does not end: the greatest double.
NEVER = float(np.finfo(np.float64).max)

# Wall time of a segment, between two looks at progress and Ctrl-C [s].
SEGMENT_SECONDS = 0.25
SEGMENT_ADVANCES = 100_000
# Rows of the buffers that a segment fills; each must hold the most samples of one advance twice.
TRACE_ROWS = 20_000
SLIP_ROWS = 2_000
AVALANCHE_ROWS = 100_000
# Numbers of contacts in the buffer of snapshots after avalanches, and most of them.
SNAPSHOT_CONTACTS = 2_000_000
SNAPSHOTS = 64
# What no stretch can be: that of a detached contact.
DETACHED = 1e300
# Numbers kept for a population of the master equation, and for a packet of detached contacts.
POPULATION_COLUMNS = 12
PACKET_ROWS = 4
# Populations and packets at first; there is room for more when they are needed.
POPULATIONS = 4096


@dataclass
class Realization:
    """One run of an engine, advanced in segments.

    ``trace`` has shape (samples, 9) with the columns `TRACE_COLUMNS`, ``slips`` (slips, 7) with
    `SLIP_COLUMNS`, ``slip_trace`` (samples, 10): a trace and the number of the slip;
    ``layer_trace`` (samples, layers) the displacements of layers, if the output asks for them;
    ``avalanches`` (avalanches, 10) with `AVALANCHE_COLUMNS`; ``snapshot_places`` (snapshots, 3)
    with `SNAPSHOT_COLUMNS`, and ``snapshots`` (snapshots, contacts, 3): stretch, NaN if detached,
    force over threshold, and generation in the avalanche that the snapshot was taken after.
    """

    config: Config
    number: int
    time: float = 0.0
    ending: str = ""
    breaks: float = 0.0
    detached: float = 0.0
    advances: int = 0
    kernel_seconds: float = 0.0
    avalanche_count: int = 0
    avalanche_slip: float = 0.0
    displacement: float = 0.0
    energy: Array = field(default_factory=lambda: np.full(len(ENERGY_COLUMNS), np.nan))

    def __post_init__(self) -> None:
        self._traces: list[Array] = []
        self._slip_traces: list[Array] = []
        self._slips: list[Array] = []
        self._layer_traces: list[Array] = []
        self._avalanches: list[Array] = []
        self._snapshot_places: list[Array] = []
        self._snapshots: list[Array] = []
        self.integrator_counts = np.zeros(3, dtype=np.int64)
        self._started = False
        # Every segment orders the queue anew, which must cost little beside its advances.
        self._is_exact = self.config.contact_kind.is_discrete
        self._segment = SEGMENT_ADVANCES
        # CVODE starts anew with each segment, which must therefore not depend on computing times.
        self._grows = self.config.slider.solver_name(self.config) is None
        if self._is_exact:
            self._segment = max(SEGMENT_ADVANCES, self.config.contacts.count)

    def _allocate(self) -> None:
        """Make the arrays of the state, and the buffers that a segment fills."""
        count = self.config.contacts.count if self._is_exact else 1
        populations = 1 if self._is_exact else POPULATIONS
        if self.config.contacts.initial != "relaxed" and not self._is_exact:
            width = self.config.contacts.threshold.relative_width
            populations = max(
                populations, int(32 / (self.config.run.resolution * min(width, 0.35)))
            )
        reals, integers = _core.state_sizes()
        self._state_real = np.zeros(reals)
        self._state_integer = np.zeros(integers, dtype=np.int64)
        self._record = np.zeros((5, count), order="F")
        self._detached = np.zeros((2, count), order="F")
        self._detached_contact = np.zeros(count, dtype=np.int32)
        self._population = np.zeros((populations, POPULATION_COLUMNS), order="F")
        self._packet = np.zeros((PACKET_ROWS, populations), order="F")
        layers = self._layers
        self._layer_state = np.zeros((layers + 1, 2), order="F")
        self._layer_trace = np.empty(
            (layers if self.config.output.layers else 0, TRACE_ROWS), order="F"
        )
        self._trace = np.empty((len(TRACE_COLUMNS), TRACE_ROWS), order="F")
        self._slip_trace = np.empty((len(TRACE_COLUMNS) + 1, TRACE_ROWS), order="F")
        self._slip = np.empty((len(SLIP_COLUMNS), SLIP_ROWS), order="F")
        output = self.config.output
        on_lattice = self.config.interaction is not None
        self._track = np.zeros((2, count if on_lattice else 0), dtype=np.int32, order="F")
        self._avalanche = np.empty(
            (len(AVALANCHE_COLUMNS), AVALANCHE_ROWS if self.config.has_avalanches else 0), order="F"
        )
        room = 1 + len(output.snapshots)
        if output.snapshot_size is not None:
            room += min(SNAPSHOTS, SNAPSHOT_CONTACTS // count)
        self._snapshot_place = np.empty((len(SNAPSHOT_COLUMNS), room), order="F")
        self._snapshot = np.empty((3, count if on_lattice else 0, room), order="F")

    @property
    def _layers(self) -> int:
        return getattr(self.config.slider, "layers", 1)

    def _make_room(self) -> None:
        """Double the arrays of the master equation's state."""
        population, packet = self._population, self._packet
        count = len(population)
        self._population = np.zeros((2 * count, POPULATION_COLUMNS), order="F")
        self._population[:count] = population
        self._packet = np.zeros((PACKET_ROWS, 2 * count), order="F")
        self._packet[:, :count] = packet

    def release(self) -> None:
        """Give back the memory of the state, of a realization that will not go on."""
        del self._record, self._detached, self._detached_contact
        del (
            self._trace,
            self._slip_trace,
            self._slip,
            self._population,
            self._packet,
            self._layer_trace,
            self._track,
            self._avalanche,
            self._snapshot,
        )

    @property
    def trace(self) -> Array:
        return np.concatenate([np.empty((0, len(TRACE_COLUMNS))), *self._traces])

    @property
    def slips(self) -> Array:
        return np.concatenate([np.empty((0, len(SLIP_COLUMNS))), *self._slips])

    @property
    def slip_trace(self) -> Array:
        rows = np.concatenate([np.empty((0, len(TRACE_COLUMNS) + 1)), *self._slip_traces])
        slips = self.slips
        number = rows[:, -1].astype(int)
        rows, number = rows[number < len(slips)], number[number < len(slips)]
        # Fast motion that came to nothing may have been sampled under the number of a later slip.
        kept: Array = rows[rows[:, 0] >= slips[number, 1]]
        return kept

    @property
    def layer_trace(self) -> Array:
        layers = self._layers if self.config.output.layers else 0
        return np.concatenate([np.empty((0, layers)), *self._layer_traces])

    @property
    def avalanches(self) -> Array:
        return np.concatenate([np.empty((0, len(AVALANCHE_COLUMNS))), *self._avalanches])

    @property
    def snapshot_places(self) -> Array:
        return np.concatenate([np.empty((0, len(SNAPSHOT_COLUMNS))), *self._snapshot_places])

    @property
    def snapshots(self) -> Array:
        count = self.config.contacts.count if self.config.interaction is not None else 0
        values = np.concatenate([np.empty((0, count, 3)), *self._snapshots])
        values[values > DETACHED] = np.nan
        return values

    @property
    def finished(self) -> bool:
        """Whether the run is over."""
        return bool(self.ending)

    @property
    def part_done(self) -> float:
        """Part of the run that is done, 0 to 1."""
        if self.finished:
            return 1.0
        wanted = self.config.run.avalanches
        by_avalanches = self.avalanche_count / wanted if wanted else 0.0
        return min(1.0, max(by_avalanches, self.time / self.config.duration))

    @property
    def energy_residual(self) -> float:
        """What the energy balance lacks, relative to the work of the drive or its largest term."""
        contacts = self.config.contacts
        # A run in which hardly anything happens is measured by what may happen.
        unit = contacts.static_force**2 / contacts.stiffness
        scale = abs(self.energy[0]) or float(np.max(np.abs(self.energy)))
        return float(self.energy[-1] / max(scale, LEAST_ENERGY * unit))

    def advance(self, advances: int | None = None) -> None:
        """Go on for one segment: about a quarter of a second, or a number of advances.

        Raises
        ------
        RunError
            If the kernel cannot go on.
        """
        config = self.config
        slider, stages, output = config.slider, config.drive_stages, config.output
        contacts = {"bond": 0.0, "lattice": 0, "columns": 0, "rows": 0}
        contacts |= config.contact_kind.kernel_parameters(config)
        contacts["lattice_rows"] = contacts.pop("rows")
        contacts.setdefault("resolution", config.run.resolution)
        block = NO_SLIDER | slider.kernel_parameters(config)
        kind = SLIDERS[slider.kernel_kind]
        if slider.driven_by_force and slider.spring_stiffness == 0:
            kind = FORCE_DRIVEN
        if not self._started:
            self._allocate()
        segment = advances or self._segment
        start = time.perf_counter()
        results = _core.run_segment(
            engine=ENGINES[config.run.engine],
            **contacts,
            initial=config.initial_code,
            seed=config.run.seed,
            realization=self.number,
            slider_kind=kind,
            mass=block["mass"],
            spring=block["stiffness"] or 1.0,
            damping=block["damping"],
            layers=block["layers"],
            layer_damping=block["damping"],
            base=np.array([block[f"base_{name}"] for name in ("mass", "stiffness", "damping")]),
            solver=block["solver"],
            tolerances=np.array([block["relative_tolerance"], block["absolute_tolerance"]]),
            stage_end=np.minimum(np.cumsum([stage.duration for stage in stages]), NEVER),
            stage_velocity=np.array([stage.velocity for stage in stages]),
            interval=config.output_interval,
            slip_interval=config.output.slip_interval or 0.0,
            slip_velocity=slider.slip_velocity(config),
            quiet_time=slider.quiet_time,
            least_avalanche=float(output.avalanche_size or 1) * config.has_avalanches,
            snapshot_size=float(output.snapshot_size or 0),
            most_avalanches=config.run.avalanches or 0,
            snapshot_time=np.array(output.snapshots, dtype=float),
            started=int(self._started),
            state_real=self._state_real,
            state_integer=self._state_integer,
            record=self._record,
            detached=self._detached,
            detached_contact=self._detached_contact,
            track=self._track,
            population=self._population,
            packet=self._packet,
            layer_state=self._layer_state,
            layer_trace=self._layer_trace,
            trace=self._trace,
            slip_trace=self._slip_trace,
            slips=self._slip,
            avalanches=self._avalanche,
            snapshot_place=self._snapshot_place,
            snapshot=self._snapshot,
            most_advances=segment,
        )
        seconds = time.perf_counter() - start
        rows, ending, full, now, breaks, detached, made, counts, energy = results[:9]
        self.avalanche_count, self.avalanche_slip, self.displacement, status, message = results[9:]
        self.kernel_seconds += seconds
        # A segment may also end because a buffer is full; a longer one would be no use then.
        was_all_made = made - self.advances >= segment
        if advances is None and self._grows and was_all_made and seconds < 0.5 * SEGMENT_SECONDS:
            self._segment *= 2
        self._started = True
        if status != 0:
            raise RunError(f"realization {self.number}: {message.decode().strip()}")
        self._traces.append(self._trace[:, : rows[0]].T.copy())
        self._slip_traces.append(self._slip_trace[:, : rows[1]].T.copy())
        self._layer_traces.append(self._layer_trace[:, : rows[0]].T.copy())
        self.integrator_counts += counts
        self._slips.append(self._slip[:, : rows[2]].T.copy())
        self._avalanches.append(self._avalanche[:, : rows[3]].T.copy())
        self._snapshot_places.append(self._snapshot_place[:, : rows[4]].T.copy())
        self._snapshots.append(self._snapshot[:, :, : rows[4]].T.copy())
        if full:
            self._make_room()
        self.ending = ENDINGS.get(ending, "")
        self.time, self.advances, self.energy = now, made, energy
        self.breaks = int(breaks) if self._is_exact else breaks
        self.detached = detached

    @property
    def contacts(self) -> dict[str, Array]:
        """Of each of N contacts: origin [m], stiffness [N/m], 0 if it is detached, breaking stretch
        [m], number of renewals."""
        names = ("origin", "stiffness", "break_stretch", "renewals")
        return {name: self._record[row].copy() for row, name in enumerate(names)}


def run_realizations(
    config: Config,
    *,
    workers: int | None = None,
    progress: Callable[[float], None] | None = None,
) -> tuple[list[Realization], bool]:
    """Run all realizations of a configuration on threads.

    Parameters
    ----------
    config
        What to run.
    workers
        Realizations that run at the same time; as many as there are processors by default.
    progress
        Called now and then, from this thread, with the part of the work that is done.

    Returns
    -------
    realizations, complete
        The realizations, and whether they came to their ends; not so after Ctrl-C.

    Raises
    ------
    RunError
        If a realization fails.
    """
    realizations = [Realization(config, number) for number in range(config.run.realizations)]
    workers = min(workers or os.cpu_count() or 1, len(realizations))
    stop = threading.Event()

    def finish(realization: Realization) -> None:
        while not (realization.finished or stop.is_set()):
            realization.advance()
        if realization.finished:
            realization.release()

    def report() -> None:
        if progress is not None:
            progress(sum(one.part_done for one in realizations) / len(realizations))

    with ThreadPoolExecutor(workers) as pool:
        pending = {pool.submit(finish, realization) for realization in realizations}
        try:
            while pending:
                done, pending = wait(pending, timeout=0.1, return_when="FIRST_EXCEPTION")
                for future in done:
                    try:
                        future.result()
                    except MemoryError:
                        raise RunError(TOO_MUCH) from None
                report()
        except KeyboardInterrupt:
            pass
        finally:
            stop.set()
            for future in pending:
                future.cancel()
    return realizations, all(one.finished for one in realizations)
