"""Sweeps that are killed, stopped, or meet a disk that fails: nothing is lost."""

from __future__ import annotations

import numpy as np
from kill_sweep import Study
from test_sweep import sweep_file

__all__ = ["sweep_file"]


def test_kills_lose_nothing_and_repeat_nothing(tmp_path):
    """A short version of tests/resume/kill_sweep.py."""
    study = Study(tmp_path, 4, np.random.default_rng(3))
    whole = study.expected()
    study.attack("killed", whole, 8)
    assert study.wrong == []
    assert study.sweep_kills + study.worker_kills > 2
