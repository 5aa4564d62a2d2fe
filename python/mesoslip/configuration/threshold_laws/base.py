"""What the configuration knows of a threshold law; its formulas are the kernels'."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, Protocol

# The widest law whose quantiles the kernels can still compute.
WIDEST = 20.0
# The narrowest one: in double precision narrower ones lose the digits of their shape.
NARROWEST = 1e-6


class Keys(Protocol):
    """The keys of [contacts.threshold] that laws are made of."""

    @property
    def relative_width(self) -> float: ...


@dataclass(frozen=True)
class ThresholdLawKind:
    """A law of the relative thresholds, whose mean is 1.

    Attributes
    ----------
    name
        Name of the law, in files and in the kernels.
    max_width
        Largest relative width.
    if_wider
        What is wrong with a larger one.
    jumps
        Ends of the law's support at which its density is not continuous.
    """

    name: str
    max_width: float = WIDEST
    if_wider: str = ""
    jumps: Literal["none", "lower", "both"] = "none"

    def width_problem(self, width: float) -> str:
        """What is wrong with a relative width; empty if it is possible."""
        if width < NARROWEST:
            return f"must be at least {NARROWEST:g} (is {width:g})"
        # A width given by four digits of an irrational bound is meant to be the bound.
        if width > self.max_width * (1 + 1e-4):
            return f"must be at most {self.max_width:.4g} for the {self.name} law{self.if_wider}"
        return ""

    def kernel_parameters(self, keys: Keys) -> dict[str, float]:
        """What the kernel makes the law of."""
        return {"relative_width": keys.relative_width}
