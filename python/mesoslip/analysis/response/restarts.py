"""Restarts of a slider under a force, after holds under a smaller force."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np

from mesoslip.analysis.experiment_stages import Experiment, Stage
from mesoslip.analysis.response.columns import RESTARTS, empty_row
from mesoslip.analysis.response.forces import SAME_FORCE
from mesoslip.analysis.response.scatter import scatter


def restart_rows(experiment: Experiment, number: int) -> list[dict[str, Any]]:
    """Each stage of constant force after a smaller constant force, or none.

    The slider has restarted when it has moved by the mean breaking stretch f_s/k since the end of
    the hold.

    Parameters
    ----------
    experiment
        The output.
    number
        Its number.
    """
    rows = []
    for hold, stage in itertools.pairwise(experiment.stages):
        if not (hold.is_constant_force and stage.is_constant_force):
            continue
        held, force = (float(experiment.force_at(one, "start")[0]) for one in (hold, stage))
        if held * force < 0 or abs(held) > (1 - SAME_FORCE) * abs(force):
            continue
        row = empty_row(RESTARTS, number, stage) | {
            "stage_start_time": stage.start,
            "hold_time": hold.duration,
            "hold_force": held,
            "force": force,
        }
        row["note"] = _fill_restart(experiment, stage, float(np.sign(force)), row)
        rows.append(row)
    return rows


def _fill_restart(experiment: Experiment, stage: Stage, sign: float, row: dict[str, Any]) -> str:
    """Fill the time to the restart; the note on it."""
    assert experiment.config is not None
    length = experiment.config.contacts.break_stretch
    inside = experiment.samples(stage)
    time = experiment.time[inside] - stage.start
    start = experiment.displacement_at_start(stage)[:, np.newaxis]
    moved = sign * (experiment.displacement[:, inside] - start)
    if np.any(moved[:, -1] < length):
        return "does not restart: the slider moves by less than the breaking stretch"
    times = np.array([_first_time(time, one, length) for one in moved])
    row |= {"restart_time": float(times.mean()), "restart_time_error": scatter(times)}
    return ""


def _first_time(time: np.ndarray, moved: np.ndarray, length: float) -> float:
    """The first time at which a displacement, 0 at the time 0, has a length; between samples it is
    linear."""
    after = int(np.argmax(moved >= length))
    before = (0.0, 0.0) if after == 0 else (time[after - 1], moved[after - 1])
    share = (length - before[1]) / (moved[after] - before[1])
    return float(before[0] + share * (time[after] - before[0]))
