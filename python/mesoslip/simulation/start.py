"""The start of a run: time 0, or the end of another run, which it continues.

The motion continues exactly: a chain of runs at successive velocities equals one run with stages of
the drive to the bit. Times, displacements and counts of a run are relative to its own start.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from mesoslip.array_types import Array
from mesoslip.configuration.kernel_parameters import Parameters
from mesoslip.errors import ConfigError
from mesoslip.simulation.archive import Archive
from mesoslip.simulation.kernel import Kernel, Progress, Words
from mesoslip.simulation.kernel_setup import KernelSetup
from mesoslip.simulation.recorded_tables import BLOCK_NUMBERS, COLUMNS, ENERGY_COLUMNS

if TYPE_CHECKING:
    from mesoslip.configuration.config import Config

# Keys whose values may change from one run to the next: those that do not affect the contacts.
CONTINUED = ("drive.velocity", "drive.force", "slider.stiffness")
# Terms of the energy balance that belong to the present state; the others add up from the start.
PRESENT_TERMS = ("slider_energy", "contact_energy")
# Columns with an origin that does not move.
FIXED_COLUMNS = ("base_displacement",)


class End(NamedTuple):
    """The end of a run, which another one can continue: configuration and state of the kernel."""

    config: Config
    words: Words


@dataclass(frozen=True)
class Start:
    """The start of a run: progress of the kernel (None at time 0), earlier slips, and terms of the
    energy balance [J], which are subtracted from those of the kernel."""

    progress: Progress | None = None
    slips: int = 0
    energy: Array = field(default_factory=lambda: np.zeros(len(ENERGY_COLUMNS)))

    def setup(self, config: Config, parameters: Parameters) -> KernelSetup:
        """The parts of a kernel of the run, to be restored or, at time 0, started."""
        time = None if self.progress is None else self.progress.time
        return KernelSetup(config, parameters, start_time=time, earlier_slips=self.slips)

    def progress_since(self, now: Progress) -> Progress:
        """The progress of the run, from that of the kernel."""
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
        """Rows of a table of the run, from those of the kernel."""
        if self.progress is None or not rows.size:
            return rows
        if table == "layers":
            return rows - self.progress.displacement
        if table == "blocks":
            count = rows.shape[1] // len(BLOCK_NUMBERS)
            return np.concatenate(
                [rows[:, :count] - self.progress.displacement, rows[:, count:]], axis=1
            )
        shift = np.array([self._shift(table, name) for name in COLUMNS[table]])
        return rows - shift if shift.size else rows

    def _shift(self, table: str, name: str) -> float:
        """Value of a column at the start."""
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
    """A kernel that continues another run of the same number, whose configuration may differ in the
    keys of `CONTINUED`, and its start."""
    if config.pressing.varies:
        raise ConfigError.of(
            "load", "must be constant in a run that continues another: its stages start with a run"
        )
    archive = Archive(end.words)
    slider = archive.section_with("drive part")
    slips = int(archive.number("slips", "slip_count"))
    start_time = archive.number(slider, "time")
    setup = KernelSetup(config, parameters, start_time=start_time, earlier_slips=slips)
    kernel = setup.open(number)
    words = end.words
    if config.spring_stiffness != end.config.spring_stiffness:
        put_on_spring(archive, slider, end.config, config)
        words = archive.words()
    kernel.restore(words)
    kernel.follow()
    energy = kernel.energy()
    energy[[ENERGY_COLUMNS.index(name) for name in PRESENT_TERMS]] = 0.0
    return kernel, Start(kernel.ask(), slips, energy)


def drive_displacement(archive: Archive, slider: str) -> float:
    """Displacement of the drive in a state [m]."""
    value, rate, time, start = (
        archive.number(slider, name) for name in ("drive value", "drive rate", "time", "drive time")
    )
    return value + rate * (time - start)


def put_on_spring(archive: Archive, slider: str, before: Config, config: Config) -> None:
    """Change spring and damper of a rigid slider in a state.

    Velocities, also the damper's, and all forces but the damper's stay the same: the drive is
    displaced, so that the spring bears the same force.
    """
    here, value = (archive.number(slider, name) for name in ("displacement", "drive value"))
    drive = drive_displacement(archive, slider)
    gap = (drive - here) * before.spring_stiffness / config.spring_stiffness
    archive.set_number(slider, "drive value", value + (here + gap - drive))
    earlier, now = before.slider.oscillator, config.slider.oscillator
    if earlier is not None and now is not None and earlier.damping > 0:
        # The damper's force is proportional to its rate, which a damping ratio derives from
        # stiffness and mass.
        damper, acceleration = (archive.number(slider, one) for one in ("damper", "acceleration"))
        change = damper * (now.damping / earlier.damping - 1)
        archive.set_number(slider, "damper", damper + change)
        archive.set_number(slider, "acceleration", acceleration - change)
