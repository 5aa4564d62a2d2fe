"""Laws of the relative breaking thresholds, evaluated by the kernels."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mesoslip import _core
from mesoslip.configuration import arguments
from mesoslip.configuration.kernel_parameters import Named, Parameters, named
from mesoslip.configuration.threshold_laws import LAWS
from mesoslip.configuration.threshold_laws.table import sample_problem
from mesoslip.errors import MesoslipError

# Logarithm of the largest odds of a draw in a mean.
SHARES = 20.0


@arguments.checked(
    law=arguments.text,
    relative_width=arguments.number(0),
    minimum=arguments.number(),
    samples=arguments.numbers,
    weights=arguments.numbers,
)
def _check_fields(
    law: str,
    relative_width: float,
    minimum: float,
    samples: tuple[float, ...] | None = None,
    weights: tuple[float, ...] | None = None,
) -> None:
    """Refuse fields of a law that are of another type."""


@dataclass(frozen=True)
class ThresholdLaw:
    """A law of the relative threshold u = f_si/f_s: mean 1, standard deviation ``relative_width``.

    Draws at or below ``minimum``, the back force over the mean threshold, are rejected. Mean and
    width are those before rejection. The law "table" has the cells of ``samples``, with ``weights``
    if they differ. Source: model section 2; the gaussian law is Braun's.

    Examples
    --------
    >>> import mesoslip
    >>> law = mesoslip.ThresholdLaw("gaussian", 0.1)
    >>> round(float(law.quantile(0.5)), 6), round(float(law.survival(1.0)), 6)
    (1.0, 0.5)
    """

    law: str
    relative_width: float
    minimum: float = 0.0
    samples: tuple[float, ...] | None = None
    weights: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        _check_fields(self.law, self.relative_width, self.minimum, self.samples, self.weights)
        for name in ("samples", "weights"):
            if getattr(self, name) is not None:
                object.__setattr__(self, name, arguments.numbers(getattr(self, name)))
        if self.law not in LAWS:
            raise MesoslipError(
                f"there is no threshold law {self.law!r}; there are {', '.join(LAWS)}"
            )
        if LAWS[self.law].is_sampled:
            key, message = sample_problem(self.samples or (), self.weights)
            if key:
                raise MesoslipError(f"{key} {message}")

    @property
    def acceptance(self) -> float:
        """Probability that a draw is not rejected."""
        return self._kernel("survival", np.empty(0))[1]

    @property
    def accepted_mean(self) -> float:
        """Mean of the draws that are not rejected."""
        shares = 1 / (1 + np.exp(np.linspace(-SHARES, SHARES, 2001)))
        thresholds = np.concatenate([[self.minimum], self.quantile(shares)])
        above = np.concatenate([[1.0], shares])
        return self.minimum + float(np.trapezoid(above, thresholds))

    @arguments.checked(probability=arguments.array)
    def quantile(self, probability: ArrayLike) -> NDArray[np.float64]:
        """Threshold that is exceeded with a probability.

        Raises
        ------
        MesoslipError
            If a probability is not above 0 and below 1.
        """
        values = np.asarray(probability, dtype=np.float64)
        wrong = values[~((values > 0) & (values < 1))]
        if wrong.size > 0:
            raise MesoslipError(f"a probability must be above 0 and below 1, not {wrong[0]:g}")
        return self._evaluate("quantile", probability)

    @arguments.checked(threshold=arguments.array)
    def density(self, threshold: ArrayLike) -> NDArray[np.float64]:
        """Probability density of the relative threshold."""
        return self._evaluate("density", threshold)

    @arguments.checked(threshold=arguments.array)
    def survival(self, threshold: ArrayLike) -> NDArray[np.float64]:
        """Probability that a relative threshold is greater."""
        return self._evaluate("survival", threshold)

    def _evaluate(self, function: str, argument: ArrayLike) -> NDArray[np.float64]:
        values = np.asarray(argument, dtype=np.float64)
        return self._kernel(function, values.ravel())[0].reshape(values.shape)

    @cached_property
    def _parameters(self) -> Named:
        parameters: Parameters = {"threshold_law": self.law}
        return named(parameters | LAWS[self.law].kernel_parameters(self))

    def _kernel(
        self, function: str, argument: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], float]:
        """Values of a function of the law, and the acceptance."""
        values, acceptance, status, message = _core.evaluate_threshold_law(
            *self._parameters, self.minimum, function, argument
        )
        if status != 0:
            raise MesoslipError(message.decode().strip())
        return values, acceptance
