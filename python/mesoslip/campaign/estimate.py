"""Estimates of time, memory and disk of a sweep, for --dry-run."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

from mesoslip.campaign.sweep import groups, stored_measures
from mesoslip.campaign.sweep_plan import Plan
from mesoslip.configuration.config import Config
from mesoslip.execution.store import Pieces
from mesoslip.simulation.realization import Realization

# Maximum number of combinations that are tried, and time for all of them [s].
MAX_TRIED = 12
TRIAL_SECONDS = 3.0
# Measured time of a point outside the kernel [s], and of the start of a worker.
OVERHEAD_SECONDS = 0.01
START_SECONDS = 1.5
# Memory of a process with its imports, and size of a stored point [bytes].
PROCESS_BYTES = 150e6
POINT_BYTES = 4096


@dataclass(frozen=True)
class Estimate:
    """Number of points, of those stored, wall time of the missing ones, memory and disk space."""

    points: int
    stored: int
    seconds: float
    memory_bytes: float
    disk_bytes: float


def estimate(plan: Plan, store: Pieces, workers: int) -> Estimate:
    """Estimate time, memory and disk of a sweep from the first moments of some combinations."""
    there = store.names()
    missing: list[int] = []
    stored_count = missing_count = max_chain = 0
    for group in groups(plan):
        copies = len(group.chains)
        chain = group.chains[0]
        for number in range(plan.realizations):
            stored = sum(
                name in there and stored_measures(store, plan, name) is not None
                for name in group.names(number)
            )
            stored_count += stored * copies
            if stored == len(chain):
                continue
            missing_count += len(chain)
            max_chain = max(max_chain, len(chain))
            if not missing or missing[-1] != chain[-1]:
                missing += chain
    step = max(1, len(missing) // MAX_TRIED)
    tried = missing[step // 2 :: step]
    seconds = [_seconds(plan.config(one), TRIAL_SECONDS / len(tried)) for one in tried]
    mean = float(np.mean(seconds)) + OVERHEAD_SECONDS if seconds else 0.0
    longest = max(seconds, default=0.0)
    # The runs of a chain follow one another.
    alone = max(longest, mean * max_chain)
    wall = max(mean * missing_count / workers, alone) + START_SECONDS if missing else 0.0
    # Three copies: in the tables of the kernel, in the tree, and in measures.
    memory = (workers + 1) * PROCESS_BYTES + 3 * workers * float(np.max(plan.record_bytes))
    memory += plan.memory_bytes
    disk: float = plan.count * (POINT_BYTES + 8 * (1 + len(plan.measures)))
    if plan.sweep.traces:
        disk += float(np.sum(plan.record_bytes)) * plan.realizations
    return Estimate(plan.count, stored_count, wall, memory, disk)


def _seconds(config: Config, max_seconds: float) -> float:
    """Time that a run takes [s], extrapolated from its start."""
    start = time.perf_counter()
    with Realization(config, 0) as realization:
        while not realization.finished and time.perf_counter() - start < max_seconds:
            realization.advance(work=2e4)
    return (time.perf_counter() - start) / max(realization.part_done, 1e-6)
