"""Laws of the relative breaking thresholds, as the kernels use them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mesoslip import _core
from mesoslip.errors import MesoslipError

LAWS = {"gaussian": 1, "uniform": 2, "lognormal": 3, "weibull": 4, "exponential": 5}


@dataclass(frozen=True)
class ThresholdLaw:
    """A law of the relative threshold u = f_si/f_s: mean 1, standard deviation ``relative_width``.

    Draws at or below ``minimum``, the back force over the mean threshold, are rejected. Mean and
    width are those before that. Source: model section 2; the gaussian law is Braun's.
    """

    law: str
    relative_width: float
    minimum: float = 0.0

    def quantile(self, probability: ArrayLike) -> NDArray[np.float64]:
        """Threshold that is exceeded with a given probability, 0 < probability < 1."""
        return self._evaluate(1, probability)

    def density(self, threshold: ArrayLike) -> NDArray[np.float64]:
        """Probability density of the relative threshold."""
        return self._evaluate(2, threshold)

    def survival(self, threshold: ArrayLike) -> NDArray[np.float64]:
        """Probability that a relative threshold is greater."""
        return self._evaluate(3, threshold)

    def _evaluate(self, what: int, argument: ArrayLike) -> NDArray[np.float64]:
        values = np.asarray(argument, dtype=np.float64)
        result, _, status, message = _core.evaluate_threshold_law(
            LAWS[self.law], self.relative_width, self.minimum, what, values.ravel()
        )
        if status != 0:
            raise MesoslipError(message.decode().strip())
        return result.reshape(values.shape)
