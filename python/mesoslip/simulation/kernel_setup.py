"""Kernels with all their parts, as a configuration has them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mesoslip.configuration.drive import DrivePart
from mesoslip.configuration.kernel_parameters import Parameters
from mesoslip.simulation.kernel import Kernel

if TYPE_CHECKING:
    from mesoslip.configuration.config import Config

# End of a drive without end: the maximum double.
NEVER = float(np.finfo(np.float64).max)


def configured_kernel(
    config: Config,
    parameters: Parameters | Kernel,
    number: int = 0,
    *,
    start_time: float | None = None,
    end_time: float | None = None,
    interval: float | None = None,
    earlier_slips: int = 0,
) -> Kernel:
    """A kernel that can be started or restored; its contacts may be copied from another one.

    A run that continues another has ``start_time`` [s], until which the drive has an additional
    part, and ``earlier_slips``. ``end_time`` [s] of the drive and ``interval`` [s] of the trace
    replace those of the configuration.
    """
    slider, contacts, output = config.slider, config.contact_kind, config.output
    kernel = Kernel()
    if isinstance(parameters, Kernel):
        kernel.copy_contacts(parameters)
    else:
        kernel.set_contacts(contacts.kernel_kind, parameters, config.run.seed, number)
    kernel.set_slider(slider.kernel_kind, slider.kernel_parameters(config))
    parts = config.drive_parts
    forces = config.drive.start_forces(parts)
    if start_time is not None:
        parts = (DrivePart(start_time, 0.0, 0.0, -1), *parts)
        forces = None if forces is None else (0.0, *forces)
    durations, start_velocities, end_velocities, stages = (
        np.array(numbers) for numbers in zip(*parts, strict=True)
    )
    ends = np.minimum(np.cumsum(durations), NEVER)
    if end_time is not None:
        ends[-1] = min(end_time, NEVER)
    kernel.set_drive(ends, start_velocities, end_velocities, stages)
    if forces is not None:
        kernel.set_drive_values(np.array(forces))
    stop = config.run.stops
    kernel.set_stop(
        slips=stop.slips + earlier_slips if stop.slips else 0,
        displacement=stop.displacement or 0.0,
        block_distance=config.steady_block,
        blocks=stop.steady.blocks if stop.steady else 1,
        tolerance=stop.steady.tolerance * config.contacts.static_force if stop.steady else 0.0,
    )
    kernel.set_recorder(
        interval=interval or config.output_interval,
        slip_interval=config.slip_interval or 0.0,
        slip_velocity=slider.slip_velocity(config),
        quiet_time=slider.quiet_time,
        duration=float(ends[-1]),
        layers=slider.layers_recorded(config),
    )
    kernel.set_avalanches(
        min_size=float(output.avalanche_size or 1) * config.has_avalanches,
        snapshot_size=float(output.snapshot_size or 0),
        max_avalanches=config.run.avalanches or 0,
        snapshot_times=(start_time or 0.0) + np.array(output.snapshots, dtype=float),
    )
    return kernel
