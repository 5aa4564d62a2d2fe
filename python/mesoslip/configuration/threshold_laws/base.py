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
    """The keys of [contacts.threshold] that define a law."""

    @property
    def relative_width(self) -> float: ...
    @property
    def samples(self) -> tuple[float, ...] | None: ...
    @property
    def weights(self) -> tuple[float, ...] | None: ...


@dataclass(frozen=True)
class ThresholdLawKind:
    """A law of the relative thresholds, whose mean is 1."""

    name: str
    """The name in files and in the kernels."""
    max_width: float = MAX_WIDTH
    """Maximum relative width."""
    if_wider: str = ""
    """Why a larger width is wrong, as the end of a message."""
    jumps: Literal["none", "lower", "both"] = "none"
    """Ends of the support at which the density is discontinuous."""
    is_sampled: bool = False
    """Whether the law is made of samples, not of a width."""

    def width_problem(self, width: float) -> str:
        """The error of a relative width; empty if it is possible."""
        # An irrational bound may be given with four digits.
        if width > self.max_width * (1 + 1e-4):
            return f"must be at most {self.max_width:.4g} for the {self.name} law{self.if_wider}"
        return ""

    def kernel_parameters(self, keys: Keys) -> Parameters:
        return {"relative_width": keys.relative_width}
