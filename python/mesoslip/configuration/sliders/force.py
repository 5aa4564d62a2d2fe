"""A block with a mass under a force, without a spring."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import Field

from mesoslip.configuration.sliders.base import Setting, SliderTable
from mesoslip.configuration.table import Complaint, Complaints, Mass, Rate


class ForceSlider(SliderTable):
    """A block with a mass under a force, without a spring: M dV/dt = F_ext − F − M η_S V.

    It starts at rest; a constant force acts suddenly. It creeps or slides without end, so it has no
    slips, and only damping limits its velocity when it slides.
    """

    driven_by_force: ClassVar[bool] = True
    takes_forces: ClassVar[bool] = True

    kind: Literal["force"] = "force"
    """A block with a mass under a force."""
    mass: Annotated[Mass, Field(gt=0)]
    """Mass of the slider, M."""
    damping: Annotated[Rate, Field(ge=0)] = 0.0
    """Damping rate of the slider, η_S, relative to the ground."""

    @property
    def spring_stiffness(self) -> float:
        return 0.0

    def kernel_parameters(self, config: Setting) -> dict[str, float | str]:  # noqa: ARG002
        return {"mass": self.mass, "damping": self.damping}

    def problems(self, config: Setting) -> Complaints:
        if not config.drive.is_force:
            yield Complaint(
                "drive",
                "must be a force: drive.force, drive.force_rate, or [[drive.stage]] tables with "
                "force, or start_force and end_force",
            )
        if config.contacts.initial != "relaxed":
            yield Complaint(
                "contacts.initial",
                'must be "relaxed" for a slider under a force, which starts without one',
                config.contacts.initial,
            )
