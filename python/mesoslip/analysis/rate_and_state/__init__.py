"""Rate-and-state friction: laws fitted to records of runs and to measured traces."""

from mesoslip.analysis.rate_and_state.law import LAWS, RateAndState
from mesoslip.analysis.rate_and_state.noise import Noise, NoiseModel, estimated_noise, known_noise
from mesoslip.analysis.rate_and_state.points import Loading, Points, points_of_run, points_of_trace
from mesoslip.analysis.rate_and_state.records import Record, records_of
from mesoslip.analysis.rate_and_state.rows import FIT, assessment, fit_rows, fitted_trend
from mesoslip.analysis.rate_and_state.search import MAX_MISFIT, Fit, fit_laws, preferred_law

__all__ = [
    "FIT",
    "LAWS",
    "MAX_MISFIT",
    "Fit",
    "Loading",
    "Noise",
    "NoiseModel",
    "Points",
    "RateAndState",
    "Record",
    "assessment",
    "estimated_noise",
    "fit_laws",
    "fit_rows",
    "fitted_trend",
    "known_noise",
    "points_of_run",
    "points_of_trace",
    "preferred_law",
    "records_of",
]
