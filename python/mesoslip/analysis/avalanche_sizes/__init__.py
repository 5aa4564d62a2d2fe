"""Statistics of avalanche sizes: histograms, power laws, other laws.

The law is p(s) = s^-τ C(s) (1 + …)/Z for integers s from ``min_size`` to ``max_size``, C being an
exponential or a Gaussian cutoff. It is fitted here and not by the library ``powerlaw``, whose
distances of a discrete law with a cutoff are those of a continuous one, and which gives neither
errors of such a law nor its goodness of fit.

The choice of the minimum size and the coverage of the errors were measured: see
``tests/studies/exponent_coverage.py`` and its results in ``docs/exponents.md``.
"""

from mesoslip.analysis.avalanche_sizes.comparison import LawComparison, compare_laws
from mesoslip.analysis.avalanche_sizes.laws import EXPONENTIAL_CUTOFF, FORMS, Form
from mesoslip.analysis.avalanche_sizes.power_law import (
    REJECTED,
    FittedForm,
    LocalExponent,
    PowerLawFit,
    fit_power_law,
    local_exponents,
)
from mesoslip.analysis.avalanche_sizes.tally import LogarithmicBins, ccdf, logarithmic_bins

__all__ = [
    "EXPONENTIAL_CUTOFF",
    "FORMS",
    "REJECTED",
    "FittedForm",
    "Form",
    "LawComparison",
    "LocalExponent",
    "LogarithmicBins",
    "PowerLawFit",
    "ccdf",
    "compare_laws",
    "fit_power_law",
    "local_exponents",
    "logarithmic_bins",
]
