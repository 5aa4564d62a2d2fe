"""Laws of the relative breaking thresholds, as the kernels use them.

Adding a law is adding a line to `LAWS`, and its formulas to the kernels.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mesoslip import _core
from mesoslip.errors import MesoslipError

# The widest law whose quantiles the kernels can still compute.
WIDEST = 20.0
# The narrowest one: in double precision narrower ones lose the digits of their shape.
NARROWEST = 1e-6


@dataclass(frozen=True)
class Law:
    """What there is to know of a law: its code in the kernels, its widest relative width, and
    what is wrong with a wider one."""

    code: int
    widest: float = WIDEST
    if_wider: str = ""


_NOT_NEGATIVE = ", whose least threshold would be negative"

LAWS = {
    "gaussian": Law(1),
    "uniform": Law(2, 1 / math.sqrt(3), _NOT_NEGATIVE),
    "lognormal": Law(3),
    "weibull": Law(4),
    "exponential": Law(5, 1.0, _NOT_NEGATIVE),
}


@dataclass(frozen=True)
class ThresholdLaw:
    """A law of the relative threshold u = f_si/f_s: mean 1, standard deviation ``relative_width``.

    Draws at or below ``minimum``, the back force over the mean threshold, are rejected. Mean and
    width are those before that. Source: model section 2; the gaussian law is Braun's.
    """

    law: str
    relative_width: float
    minimum: float = 0.0

    def __post_init__(self) -> None:
        if self.law not in LAWS:
            raise MesoslipError(f"there is no law {self.law!r}, but there are {', '.join(LAWS)}")

    @property
    def acceptance(self) -> float:
        """Probability that a draw is not rejected."""
        return self._kernel(3, np.empty(0))[1]

    def quantile(self, probability: ArrayLike) -> NDArray[np.float64]:
        """Threshold that is exceeded with a given probability.

        Raises
        ------
        MesoslipError
            If a probability is not above 0 and below 1.
        """
        values = np.asarray(probability, dtype=np.float64)
        wrong = values[~((values > 0) & (values < 1))]
        if wrong.size > 0:
            raise MesoslipError(f"a probability must be above 0 and below 1, not {wrong[0]:g}")
        return self._evaluate(1, probability)

    def density(self, threshold: ArrayLike) -> NDArray[np.float64]:
        """Probability density of the relative threshold."""
        return self._evaluate(2, threshold)

    def survival(self, threshold: ArrayLike) -> NDArray[np.float64]:
        """Probability that a relative threshold is greater."""
        return self._evaluate(3, threshold)

    def _evaluate(self, what: int, argument: ArrayLike) -> NDArray[np.float64]:
        values = np.asarray(argument, dtype=np.float64)
        return self._kernel(what, values.ravel())[0].reshape(values.shape)

    def _kernel(
        self, what: int, argument: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], float]:
        """Values of a function of the law, and the acceptance."""
        values, acceptance, status, message = _core.evaluate_threshold_law(
            LAWS[self.law].code, self.relative_width, self.minimum, what, argument
        )
        if status != 0:
            raise MesoslipError(message.decode().strip())
        return values, acceptance
