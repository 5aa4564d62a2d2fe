"""Where a run starts: at time 0, or at the end of another run, from which it goes on.

The motion goes on exactly: a chain of runs under one velocity after another is one run with stages
of the drive, to the bit. What a run records counts from its own start.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from mesoslip.configuration.kernel_parameters import Parameters
from mesoslip.simulation.archive import Archive
from mesoslip.simulation.kernel import Array, Kernel, Progress, Words
from mesoslip.simulation.kernel_setup import configured_kernel
from mesoslip.simulation.recorded_tables import COLUMNS, ENERGY_COLUMNS

if TYPE_CHECKING:
    from mesoslip.configuration.config import Config

# Keys of which the next run may have another value: those that leave the contacts as they are.
CONTINUED = ("drive.velocity", "drive.force", "slider.stiffness")
# Terms of the energy balance that are of the present state, not sums since the start.
PRESENT_TERMS = ("slider_energy", "contact_energy")
# The base has an origin of its own, which does not move.
FIXED_COLUMNS = ("base_displacement",)


class End(NamedTuple):
    """The end of a run, from which another can go on."""

    config: Config
    words: Words
    """State of the kernel."""


@dataclass(frozen=True)
class Start:
    """The start of a run, from which what it records is counted.

    Attributes
    ----------
    progress
        How far the kernel had come; None at time 0.
    slips
        Slips before.
    energy
        Terms of the energy balance at the start [J].
    """

    progress: Progress | None = None
    slips: int = 0
    energy: Array = field(default_factory=lambda: np.zeros(len(ENERGY_COLUMNS)))

    def configured_kernel(self, config: Config, parameters: Parameters, number: int) -> Kernel:
        """A kernel of the run, to be restored, or started at time 0."""
        time = None if self.progress is None else self.progress.time
        return configured_kernel(
            config, parameters, number, start_time=time, earlier_slips=self.slips
        )

    def progress_since(self, now: Progress) -> Progress:
        """How far the run has come."""
        if self.progress is None:
            return now
        before = self.progress
        return now._replace(
            time=now.time - before.time,
            displacement=now.displacement - before.displacement,
            breaks=now.breaks - before.breaks,
            avalanche_slip=now.avalanche_slip - before.avalanche_slip,
            advances=now.advances - before.advances,
            avalanches=now.avalanches - before.avalanches,
            integrator_counts=now.integrator_counts - before.integrator_counts,
        )

    def rows_since(self, table: str, rows: Array) -> Array:
        """Rows of a table of the kernel as those of the run."""
        if self.progress is None or not rows.size:
            return rows
        if table == "layers":
            return rows - self.progress.displacement
        shift = np.array([self._shift(table, name) for name in COLUMNS[table]])
        return rows - shift if shift.size else rows

    def _shift(self, table: str, name: str) -> float:
        """Value at the start of what a column counts."""
        assert self.progress is not None
        if name.endswith("time"):
            return self.progress.time
        if name.endswith("displacement") and name not in FIXED_COLUMNS:
            return self.progress.displacement
        if name == "slip" and table in {"slips", "slip_trace"}:
            return float(self.slips)
        return 0.0

    def energy_since(self, terms: Array) -> Array:
        """Terms of the energy balance since the start [J]."""
        return terms - self.energy


START = Start()


def follow(config: Config, parameters: Parameters, number: int, end: End) -> tuple[Kernel, Start]:
    """A kernel that goes on from the end of another run, and its start.

    Parameters
    ----------
    config
        The configuration, of which the keys of `CONTINUED` may differ from that of the other run.
    parameters
        Parameters of the contacts.
    number
        Number of the realization, the same as that of the other run.
    end
        The end of the other run.
    """
    archive = Archive(end.words)
    slider = archive.section_with("drive part")
    slips = int(archive.number("slips", "slip_count"))
    kernel = configured_kernel(
        config,
        parameters,
        number,
        start_time=archive.number(slider, "time"),
        earlier_slips=slips,
    )
    words = end.words
    if config.spring_stiffness != end.config.spring_stiffness:
        put_on_spring(archive, slider, end.config, config)
        words = archive.words()
    kernel.restore(words)
    kernel.follow()
    energy = kernel.energy()
    energy[[ENERGY_COLUMNS.index(name) for name in PRESENT_TERMS]] = 0.0
    return kernel, Start(kernel.ask(), slips, energy)


def put_on_spring(archive: Archive, slider: str, before: Config, config: Config) -> None:
    """Put a state of a rigid slider on another spring and damper.

    Velocities, also the damper's, and all forces but that of the damper stay as they are. The drive
    is displaced, so that the spring bears the same force.
    """
    here, value = (archive.number(slider, name) for name in ("displacement", "drive value"))
    time, since, rate = (
        archive.number(slider, name) for name in ("time", "drive time", "drive rate")
    )
    drive = value + rate * (time - since)
    gap = (drive - here) * before.spring_stiffness / config.spring_stiffness
    archive.set_number(slider, "drive value", value + (here + gap - drive))
    earlier, now = before.slider.oscillator, config.slider.oscillator
    if earlier is not None and now is not None and earlier.damping > 0:
        # The damper pulls in proportion to its rate, which a damping ratio ties to stiffness and
        # mass.
        damper, acceleration = (archive.number(slider, one) for one in ("damper", "acceleration"))
        change = damper * (now.damping / earlier.damping - 1)
        archive.set_number(slider, "damper", damper + change)
        archive.set_number(slider, "acceleration", acceleration - change)
