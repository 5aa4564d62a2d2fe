"""Threshold laws: names and limits. Their formulas are in the kernels."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, Protocol

from mesoslip.configuration.kernel_parameters import Parameters

# Maximum relative width at which the kernels can compute quantiles.
MAX_WIDTH = 20.0
# Minimum relative width: below it double precision does not resolve the shape of the law.
MIN_WIDTH = 1e-6


class Keys(Protocol):
    """The keys of [contacts.threshold] that laws are made of."""

    @property
    def relative_width(self) -> float: ...
    @property
    def samples(self) -> tuple[float, ...] | None: ...
    @property
    def weights(self) -> tuple[float, ...] | None: ...


@dataclass(frozen=True)
class ThresholdLawKind:
    """A law of the relative thresholds, whose mean is 1.

    Attributes
    ----------
    name
        Name of the law, in files and in the kernels.
    max_width
        Maximum relative width.
    if_wider
        Why a larger one is wrong, as the end of a message.
    jumps
        Ends of the law's support at which its density is not continuous.
    is_sampled
        Whether it is made of samples, not of a width.
    """

    name: str
    max_width: float = MAX_WIDTH
    if_wider: str = ""
    jumps: Literal["none", "lower", "both"] = "none"
    is_sampled: bool = False

    def width_problem(self, width: float) -> str:
        """The error of a relative width; empty if it is possible."""
        if width < MIN_WIDTH:
            return f"must be at least {MIN_WIDTH:g} (is {width:g})"
        # Four digits of an irrational bound stand for the bound.
        if width > self.max_width * (1 + 1e-4):
            return f"must be at most {self.max_width:.4g} for the {self.name} law{self.if_wider}"
        return ""

    def kernel_parameters(self, keys: Keys) -> Parameters:
        """Parameters of the law in the kernel."""
        return {"relative_width": keys.relative_width}
