"""A block that moves with the drive."""

from __future__ import annotations

import math
from typing import Literal

from mesoslip.configuration.sliders.base import Setting, SliderTable


class PrescribedSlider(SliderTable):
    """A block that moves with the drive, K = ∞."""

    kind: Literal["prescribed"] = "prescribed"
    """A block that moves with the drive."""

    @property
    def spring_stiffness(self) -> float:
        return math.inf

    def kernel_parameters(self, config: Setting) -> dict[str, float | str]:  # noqa: ARG002
        return {}
