"""Fits that are killed: nothing is lost, and the posterior is the same to the bit."""

import kill_fit
import numpy as np
import pytest


@pytest.mark.long
@pytest.mark.timeout(0)
def test_killed_fits_go_on(tmp_path):
    """A short version of tests/resume/kill_fit.py."""
    folder = tmp_path / "folder"
    folder.mkdir()
    tally = kill_fit.attack(2, folder, np.random.default_rng(2))
    assert tally.kills["fits"] >= 2
    assert tally.compared > 0
    assert (tally.differing, tally.lost) == ([], [])
