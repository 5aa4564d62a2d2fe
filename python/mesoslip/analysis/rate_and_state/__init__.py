"""Rate-and-state friction: the motion of a spring slider, and fits to records."""

from mesoslip.analysis.rate_and_state.fitting import Fit, fit
from mesoslip.analysis.rate_and_state.motion import (
    LAWS,
    Loading,
    Motion,
    RateAndState,
    spring_slider,
)
from mesoslip.analysis.rate_and_state.record import (
    Noise,
    Record,
    make_record,
    noise_of,
    record_of,
)
from mesoslip.analysis.rate_and_state.rows import FIT, MAX_MISFIT, fit_rows

__all__ = [
    "FIT",
    "LAWS",
    "MAX_MISFIT",
    "Fit",
    "Loading",
    "Motion",
    "Noise",
    "RateAndState",
    "Record",
    "fit",
    "fit_rows",
    "make_record",
    "noise_of",
    "record_of",
    "spring_slider",
]
