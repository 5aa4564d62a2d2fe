"""Threshold laws, each in a file of its own and listed here.

Adding a law is adding a file with a `ThresholdLawKind` and naming it in `LAWS`, and the same in the
kernels (`fortran/contacts/threshold_laws`).
"""

from __future__ import annotations

from mesoslip.configuration.threshold_laws.base import ThresholdLawKind
from mesoslip.configuration.threshold_laws.exponential import EXPONENTIAL
from mesoslip.configuration.threshold_laws.gaussian import GAUSSIAN
from mesoslip.configuration.threshold_laws.lognormal import LOGNORMAL
from mesoslip.configuration.threshold_laws.table import TABLE
from mesoslip.configuration.threshold_laws.uniform import UNIFORM
from mesoslip.configuration.threshold_laws.weibull import WEIBULL

LAWS: dict[str, ThresholdLawKind] = {
    law.name: law for law in (GAUSSIAN, UNIFORM, LOGNORMAL, WEIBULL, EXPONENTIAL, TABLE)
}
