"""Rate-and-state friction: the motion of a spring slider, and fits to records."""

from mesoslip.analysis.rate_and_state.fitting import Fit, fit
from mesoslip.analysis.rate_and_state.measured import (
    measured_fits,
    measured_rows,
    preferred_law,
    records_of,
)
from mesoslip.analysis.rate_and_state.motion import (
    LAWS,
    Loading,
    Motion,
    RateAndState,
    spring_slider,
)
from mesoslip.analysis.rate_and_state.points import Points
from mesoslip.analysis.rate_and_state.record import (
    Noise,
    Record,
    make_record,
    noise_of,
    record_of,
)
from mesoslip.analysis.rate_and_state.rows import FIT, MAX_MISFIT, fit_rows
from mesoslip.analysis.rate_and_state.search import MEASURED_LAWS, MeasuredFit, fit_laws

__all__ = [
    "FIT",
    "LAWS",
    "MAX_MISFIT",
    "MEASURED_LAWS",
    "Fit",
    "Loading",
    "MeasuredFit",
    "Motion",
    "Noise",
    "Points",
    "RateAndState",
    "Record",
    "fit",
    "fit_laws",
    "fit_rows",
    "make_record",
    "measured_fits",
    "measured_rows",
    "noise_of",
    "preferred_law",
    "record_of",
    "records_of",
    "spring_slider",
]
