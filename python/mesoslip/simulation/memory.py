"""Whether a run fits into the memory of the machine, before it starts."""

from __future__ import annotations

import math
import os
from pathlib import Path
from typing import TYPE_CHECKING

from mesoslip.errors import ConfigError, Problem
from mesoslip.simulation.recorded_tables import BLOCK_NUMBERS, COLUMNS, SNAPSHOT_NUMBERS

if TYPE_CHECKING:
    from mesoslip.configuration.config import Config

# Memory of a run for each row of a table [bytes].
BYTES_PER_SAMPLE = 3 * 7 * 8
BYTES_PER_SAMPLE_OF_SLIP = 3 * 10 * 8
BYTES_PER_NUMBER = 2 * 8
BYTES_PER_AVALANCHE = 3 * 10 * 8
BYTES_PER_CONTACT_IN_SNAPSHOT = 3 * 3 * 8


def machine_memory() -> int:
    """Memory of this machine [bytes]."""
    return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")


def free_memory() -> int:
    """Free memory of this machine [bytes]; all of it where the system does not report it."""
    try:
        lines = Path("/proc/meminfo").read_text("ascii").splitlines()
        return next(1024 * int(one.split()[1]) for one in lines if one.startswith("MemAvailable:"))
    except (OSError, StopIteration):
        return machine_memory()


def finer_samples(config: Config) -> float:
    """Expected number of finer samples around the slips of a realization."""
    fine = config.slip_interval
    return 0.0 if fine is None else config.slider.time_in_slips(config) / fine


def output_bytes(config: Config, *, has_finer: bool = True) -> float:
    """Expected size of the output of a run, or of its tables in memory, with snapshots and finer
    samples [bytes]."""
    samples = config.expected_duration / config.output_interval + 1
    layers = config.slider.layers_recorded(config)
    blocks = len(BLOCK_NUMBERS) * config.slider.block_count
    numbers = samples * (len(COLUMNS["trace"]) + layers + blocks)
    numbers += has_finer * finer_samples(config) * len(COLUMNS["slip_trace"])
    snapshots = len(config.output.snapshots) * config.contacts.count
    numbers += snapshots * len(SNAPSHOT_NUMBERS)
    return 8.0 * numbers * config.run.realizations


def check_memory(config: Config, available: float | None = None) -> None:
    """Refuse a run whose record exceeds the available memory [bytes], with a `ConfigError` for each
    key that needs too much."""
    problems = memory_problems(config, available)
    if problems:
        raise ConfigError(problems)


def memory_problems(config: Config, available: float | None = None) -> list[Problem]:
    """The keys by which a record exceeds the available memory [bytes]."""
    run, output, contacts = config.run, config.output, config.contacts
    memory = machine_memory() if available is None else available
    owner = "the machine has" if available is None else "it may take"
    together = min(run.realizations, os.cpu_count() or 1)
    in_catalogue = (run.avalanches or 0) if output.avalanche_size is None else 0
    slider = config.slider
    further = slider.layers_recorded(config) + len(BLOCK_NUMBERS) * slider.block_count
    per_sample = BYTES_PER_SAMPLE + BYTES_PER_NUMBER * further
    finer = finer_samples(config)
    sites = config.contact_kind.site_count(contacts)
    lattices = BYTES_PER_CONTACT_IN_SNAPSHOT * sites * run.realizations
    after = 0.0 if output.snapshot_size is None else _breaks(config) / output.snapshot_size
    problems = []
    samples = config.expected_duration / config.output_interval
    contact_bytes = config.contact_kind.bytes_per_contact * sites * together
    for key, needed, value in (
        ("contacts.count", contact_bytes, contacts.count),
        ("run.avalanches", BYTES_PER_AVALANCHE * in_catalogue * run.realizations, run.avalanches),
        ("output.snapshots", lattices * len(output.snapshots), f"{len(output.snapshots)} times"),
        (
            "output.snapshot_size",
            lattices * min(after, run.avalanches or math.inf),
            output.snapshot_size,
        ),
        ("output.interval", per_sample * samples * run.realizations, config.output_interval),
        (
            "output.slip_interval",
            BYTES_PER_SAMPLE_OF_SLIP * finer * run.realizations,
            config.slip_interval,
        ),
    ):
        if needed > memory:
            message = (
                f"the run may need {needed / 2**30:.3g} GiB for this, and {owner} "
                f"{memory / 2**30:.3g} GiB"
            )
            problems.append(Problem("", key, message, value))
    return problems


def _breaks(config: Config) -> float:
    """Estimated number of breaks: each contact breaks once in each mean breaking stretch, under a
    force about once before the slider slides without end."""
    contacts = config.contacts
    if not contacts.reattach or config.drive.is_force:
        return contacts.count
    path_length = math.fsum(part.path_length for part in config.drive_parts)
    return contacts.count * path_length / contacts.break_stretch
