"""The table [contacts.track]: strength along the track of the slider."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from mesoslip.configuration.kernel_parameters import Parameters
from mesoslip.configuration.table import Length, Number, Table, choice

CORRELATIONS = ("gaussian", "exponential")


class Track(Table):
    """Strength of the interface along the track of the slider (model section 18).

    The threshold of a contact that attaches while the slider is at X is multiplied by 1 + w g(X).
    g is Gaussian, with mean 0 and variance 1, and another function for each realization. The same X
    meets the same strength in each stroke. Contacts at the start have the strength of X = 0.
    """

    spread: Annotated[Number, Field(gt=0, le=1)]
    """Standard deviation of the strength relative to its mean, w. The factor is at least 0.05, and
    at least so high that a hundredth of the thresholds exceeds the back force."""
    length: Annotated[Length, Field(gt=0)]
    """Correlation length l, at least a tenth of the breaking stretch F_s/(N k)."""
    correlation: Annotated[str, choice(CORRELATIONS)] = "gaussian"
    """Correlation of the strength at two places ΔX apart: `gaussian`, exp(−(ΔX/l)²/2), which is
    smooth; `exponential`, exp(−|ΔX|/l), which is rough at all scales."""

    def kernel_parameters(self, floor: float) -> Parameters:
        """Parameters of the track in the kernel, with the minimum factor."""
        return {
            "track_spread": self.spread,
            "track_length": self.length,
            "track_floor": floor,
            "track_correlation": self.correlation,
        }
