"""What a sweep will take, before it is run: time, memory, disk."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

from mesoslip.campaign.plan import Combination, Plan
from mesoslip.campaign.runner import places, taken_from
from mesoslip.campaign.store import Points
from mesoslip.simulation.realization import Realization
from mesoslip.simulation.tables import COLUMNS

# Combinations that are begun to see how long they take, and time for all of them [s].
TRIED = 12
TRIAL_SECONDS = 3.0
# Time of a point beside the kernel [s], and of the start of a worker; as measured.
OVERHEAD_SECONDS = 0.01
START_SECONDS = 1.5
# Memory of a process with what it imports [bytes]; size of a stored point.
PROCESS_BYTES = 150e6
POINT_BYTES = 4096
# Compressed traces take about half of what they hold.
COMPRESSED = 0.5


@dataclass(frozen=True)
class Estimate:
    """What a sweep will take.

    Attributes
    ----------
    points, stored
        All points, and those that are there already.
    seconds
        Wall time of those that are missing.
    memory_bytes
        Of all processes.
    disk_bytes
        Of the points and the dataset.
    """

    points: int
    stored: int
    seconds: float
    memory_bytes: float
    disk_bytes: float


def estimate(plan: Plan, store: Points, workers: int) -> Estimate:
    """Estimate what a sweep will take: combinations from all over it are begun for a moment.

    Raises
    ------
    ConfigError
        If a combination cannot be run.
    RunError
        If one of those that are begun fails.
    """
    there = store.names()
    missing: list[Combination] = []
    stored = 0
    for place in places(plan):
        if place.name in there and taken_from(store, plan, place):
            stored += 1
        else:
            missing.append(place.combination)
    chosen = sorted({id(one): one for one in missing}.values(), key=lambda one: one.place)
    step = max(1, len(chosen) // TRIED)
    tried = chosen[step // 2 :: step]
    seconds = [_seconds(one, TRIAL_SECONDS / len(tried)) for one in tried]
    mean = float(np.mean(seconds)) + OVERHEAD_SECONDS if seconds else 0.0
    longest = max(seconds, default=0.0)
    wall = max(mean * len(missing) / workers, longest) + START_SECONDS if missing else 0.0
    trace_bytes = max((_trace_bytes(one) for one in plan.combinations), default=0.0)
    # In the kernel's tables, in the tree, and in what is measured.
    memory = (workers + 1) * PROCESS_BYTES + 3 * workers * trace_bytes
    disk: float = plan.count * (POINT_BYTES + 8 * (1 + len(plan.measures)))
    if plan.sweep.traces:
        disk += COMPRESSED * sum(map(_trace_bytes, plan.combinations)) * plan.realizations
    return Estimate(plan.count, stored, wall, memory, disk)


def _seconds(combination: Combination, patience: float) -> float:
    """Time that a combination takes [s], from how far it comes."""
    realization = Realization(combination.config, 0)
    start = time.perf_counter()
    try:
        while not realization.finished and time.perf_counter() - start < patience:
            realization.advance(work=2e4)
    finally:
        realization.close()
    return (time.perf_counter() - start) / max(realization.part_done, 1e-6)


def _trace_bytes(combination: Combination) -> float:
    """Size of the trace of a run, without the finer ones around slips."""
    config = combination.config
    samples = config.expected_duration / config.output_interval + 1
    return 8.0 * samples * (len(COLUMNS["trace"]) + config.slider.layers_recorded(config))
