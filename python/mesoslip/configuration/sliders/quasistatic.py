"""A block without inertia."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import Field

from mesoslip.configuration.sliders.base import Setting, SliderTable
from mesoslip.configuration.table import Complaint, Complaints, Stiffness


class QuasistaticSlider(SliderTable):
    """A block without inertia that follows the stable equilibrium of spring and contacts.

    Its contacts attach at once and have no drag, whatever their delay and film. With
    drive.force_rate a force drives it, without a spring.
    """

    jumps: ClassVar[bool] = True
    ignores_delay: ClassVar[bool] = True
    driven_by_force: ClassVar[bool] = True

    kind: Literal["quasistatic"] = "quasistatic"
    """A block without inertia."""
    stiffness: Annotated[Stiffness, Field(gt=0)] | None = None
    """Stiffness of the drive's spring, K; not with drive.force_rate."""

    @property
    def spring_stiffness(self) -> float:
        return self.stiffness or 0.0

    @property
    def kernel_kind(self) -> str:
        return "quasistatic_force" if self.stiffness is None else self.kind

    def kernel_parameters(self, config: Setting) -> dict[str, float | str]:  # noqa: ARG002
        return {} if self.stiffness is None else {"stiffness": self.stiffness}

    def problems(self, config: Setting) -> Complaints:
        by_force = config.drive.force_rate is not None
        if not by_force and self.stiffness is None:
            yield Complaint(
                "slider.stiffness", "missing; only with drive.force_rate there is no spring"
            )
        elif by_force and self.stiffness is not None:
            yield Complaint(
                "slider.stiffness",
                "is not for drive.force_rate, which acts on the slider without a spring",
                self.stiffness,
            )
        if not config.contact_kind.is_discrete:
            yield Complaint(
                "slider.kind",
                'needs engine "eq"; mesoslip curve computes the force of infinitely many contacts '
                "over the displacement of a slider without inertia",
                self.kind,
            )
