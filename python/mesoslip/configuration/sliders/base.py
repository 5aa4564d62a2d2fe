"""What every kind of slider answers."""

from __future__ import annotations

import math
from abc import abstractmethod
from typing import ClassVar, NamedTuple, Protocol

from mesoslip.configuration.contacts.base import ContactKind
from mesoslip.configuration.contacts.tables import Contacts
from mesoslip.configuration.drive import Drive
from mesoslip.configuration.table import Complaints, Table
from mesoslip.configuration.tables import Output


class Oscillator(NamedTuple):
    """A mass M [kg] on a spring K [N/m], with damping η_S [1/s] relative to its mean velocity."""

    mass: float
    stiffness: float
    damping: float

    @property
    def frequency(self) -> float:
        """Ω_S = √(K/M) [1/s]."""
        return math.sqrt(self.stiffness / self.mass)


class Setting(Protocol):
    """What a slider knows of the configuration that it is in."""

    @property
    def drive(self) -> Drive: ...
    @property
    def drive_speed(self) -> float: ...
    @property
    def expected_duration(self) -> float: ...
    @property
    def contacts(self) -> Contacts: ...
    @property
    def contact_kind(self) -> ContactKind: ...
    @property
    def output(self) -> Output: ...


class SliderTable(Table):
    """A kind of slider: its keys in the file, what the kernel is told, what it takes and refuses.

    What is defined here holds of a slider without inertia, slips, or layers.

    Attributes
    ----------
    jumps
        Whether the slider has no inertia: contacts break in avalanches while the drive stands.
    ignores_delay
        Whether contacts attach at once and bear no drag, whatever their delay and film.
    driven_by_force
        Whether the drive may be a force, without a spring.
    """

    jumps: ClassVar[bool] = False
    ignores_delay: ClassVar[bool] = False
    driven_by_force: ClassVar[bool] = False

    kind: str
    """Kind of the slider."""

    @property
    def kernel_kind(self) -> str:
        """The kernel's name of the kind."""
        return self.kind

    @abstractmethod
    def kernel_parameters(self, config: Setting) -> dict[str, float | str]:
        """What the kernel is told of the slider, in SI."""

    @property
    @abstractmethod
    def spring_stiffness(self) -> float:
        """K [N/m]; infinite for a prescribed slider, 0 for one that is driven by force."""

    @property
    def quiet_time(self) -> float:
        """Time without fast motion after which a slip is over [s]."""
        return 1.0

    def slip_velocity(self, config: Setting) -> float:  # noqa: ARG002
        """Velocity above the drive's that makes a slip [m/s]; 0 where there are no slips."""
        return 0.0

    @property
    def oscillator(self) -> Oscillator | None:
        """The slider as one mass on a spring (S40, S41); None if it is not one."""
        return None

    @property
    def layer_count(self) -> int:
        """Number of layers that the slider is made of."""
        return 1

    @property
    def extra_traces(self) -> tuple[str, ...]:
        """Names of what is traced besides what all sliders have."""
        return ()

    def layers_recorded(self, config: Setting) -> int:  # noqa: ARG002
        """Number of layers whose displacements are recorded."""
        return 0

    def solver_name(self, config: Setting) -> str | None:  # noqa: ARG002
        """How the motion is integrated, where there is a choice."""
        return None

    def residual_bound(self, config: Setting) -> float:  # noqa: ARG002
        """What the energy balance may lack, relative to the work of the drive."""
        return 0.0

    @property
    def remedy(self) -> str:
        """What makes a run keep that promise better."""
        return ""

    def problems(self, config: Setting) -> Complaints:  # noqa: ARG002
        """The combinations that this kind refuses."""
        yield from ()
