"""Kernels with all their parts, as a configuration has them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mesoslip import _core
from mesoslip.configuration.drive import DrivePart
from mesoslip.configuration.kernel_parameters import Parameters, named
from mesoslip.simulation.kernel import Kernel
from mesoslip.simulation.recorded_tables import TABLES

if TYPE_CHECKING:
    from mesoslip.configuration.config import Config

# End of a drive without end: the maximum double.
NEVER = float(np.finfo(np.float64).max)


class KernelSetup:
    """The parts of the kernels of a configuration, of which realizations differ in the contacts.

    Contacts may be copied from another kernel. A run that continues another has ``start_time`` [s],
    until which the drive has an additional part, and ``earlier_slips``. The ``interval`` [s] of the
    trace replaces that of the configuration.
    """

    def __init__(
        self,
        config: Config,
        parameters: Parameters | Kernel,
        *,
        start_time: float | None = None,
        interval: float | None = None,
        earlier_slips: int = 0,
    ) -> None:
        slider, output, stop = config.slider, config.output, config.run.stops
        self._seed = config.run.seed
        self._contacts = config.contact_kind.kernel_kind
        self._parameters = parameters if isinstance(parameters, Kernel) else named(parameters)
        self._slider = slider.kernel_kind, named(slider.kernel_parameters(config))
        parts = config.drive_parts
        forces = config.drive.start_forces(parts)
        if start_time is not None:
            parts = (DrivePart(start_time, 0.0, 0.0, -1), *parts)
            forces = None if forces is None else (0.0, *forces)
        durations, start_velocities, end_velocities, stages = (
            np.array(numbers) for numbers in zip(*parts, strict=True)
        )
        ends = np.minimum(np.cumsum(durations), NEVER)
        self._drive = {
            "part_end": ends,
            "start_rate": start_velocities,
            "end_rate": end_velocities,
            "stage": stages,
        }
        ends_early = {
            "slips": stop.slips + earlier_slips if stop.slips else 0,
            "displacement": stop.displacement or 0.0,
            "block_distance": config.steady_block,
            "blocks": stop.steady.blocks if stop.steady else 1,
            "tolerance": stop.steady.tolerance * config.contacts.static_force
            if stop.steady
            else 0.0,
        }
        self._recorder = {
            "interval": interval or config.output_interval,
            "slip_interval": config.slip_interval or 0.0,
            "slip_velocity": slider.slip_velocity(config),
            "quiet_time": slider.quiet_time,
            "layers": slider.layers_recorded(config),
            "blocks": slider.block_count,
        }
        avalanches = {
            "min_size": float(output.avalanche_size or 1) * config.has_avalanches,
            "snapshot_size": float(output.snapshot_size or 0),
            "max_avalanches": config.run.avalanches or 0,
            "snapshot_time": (start_time or 0.0) + np.array(output.snapshots, dtype=float),
        }
        self._settings: list[tuple[Any, dict[str, Any]]] = [
            (_core.set_stop, ends_early),
            (_core.set_avalanches, avalanches),
        ]
        if forces is not None:
            self._settings.insert(0, (_core.set_drive_values, {"start_value": np.array(forces)}))

    def open(self, number: int = 0, *, end_time: float | None = None) -> Kernel:
        """A kernel of a realization that can be started or restored; ``end_time`` [s] of the drive
        replaces that of the configuration."""
        kernel = Kernel()
        if isinstance(self._parameters, Kernel):
            kernel.copy_contacts(self._parameters)
        else:
            kernel.set_contacts(self._contacts, self._parameters, self._seed, number)
        kernel.set_slider(*self._slider)
        drive = self._drive
        if end_time is not None:
            ends = np.append(drive["part_end"][:-1], min(end_time, NEVER))
            drive = drive | {"part_end": ends}
        kernel.set(_core.set_drive, **drive)
        kernel.set(_core.set_recorder, **self._recorder, duration=float(drive["part_end"][-1]))
        for procedure, values in self._settings:
            kernel.set(procedure, **values)
        return kernel


def tables_of(config: Config) -> tuple[str, ...]:
    """Tables that a run of a configuration records; the others stay empty."""
    slider, output = config.slider, config.output
    has_slips = slider.slip_velocity(config) > 0
    has_snapshots = bool(output.snapshots or output.snapshot_size)
    recorded = {
        "slips": has_slips,
        "slip_trace": has_slips and bool(config.slip_interval),
        "layers": slider.layers_recorded(config) > 0,
        **dict.fromkeys(("blocks", "ruptures", "fronts"), slider.block_count > 0),
        "avalanches": config.has_avalanches,
        "snapshot_events": has_snapshots,
        "snapshots": has_snapshots,
    }
    return tuple(table for table in TABLES if recorded.get(table, True))
