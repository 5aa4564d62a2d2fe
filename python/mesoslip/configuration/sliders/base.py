"""The interface of all kinds of sliders."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Iterator
from typing import ClassVar, NamedTuple, Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

from mesoslip.configuration.contacts.base import ContactKind
from mesoslip.configuration.contacts.tables.contacts import Contacts
from mesoslip.configuration.drive import Drive
from mesoslip.configuration.load import Load
from mesoslip.configuration.run_tables import Output
from mesoslip.configuration.table import Complaints, Table

# Messages about a configuration that is right, but may not be what is meant.
Notes: TypeAlias = Iterator[str]


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
    """The parts of the configuration that a slider uses."""

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
    def pressing(self) -> Load: ...
    @property
    def block_shares(self) -> NDArray[np.float64]: ...
    @property
    def output(self) -> Output: ...


class SliderTable(Table):
    """A kind of slider; its defaults are those without inertia, slips or layers."""

    # Whether it has no inertia: contacts break in avalanches while the drive stands still.
    jumps: ClassVar[bool] = False
    # Whether contacts attach at once and have no drag, whatever their delay and film.
    ignores_delay: ClassVar[bool] = False
    # Whether the drive may be a force that grows from 0, and whether it may be any force.
    driven_by_force: ClassVar[bool] = False
    takes_forces: ClassVar[bool] = False

    kind: str
    """Kind of the slider."""

    @property
    def kernel_kind(self) -> str:
        """The kernel's name of the kind."""
        return self.kind

    @abstractmethod
    def kernel_parameters(self, config: Setting) -> dict[str, float | str]:
        """Parameters of the slider in the kernel, in SI."""

    @property
    @abstractmethod
    def spring_stiffness(self) -> float:
        """K [N/m]; infinite for a prescribed slider, 0 for one driven by a force."""

    @property
    def series_stiffness(self) -> float:
        """Stiffness of all springs in series with the contacts [N/m]."""
        return self.spring_stiffness

    @property
    def quiet_time(self) -> float:
        """Time without fast motion after which a slip is over [s]."""
        return 1.0

    def slip_velocity(self, config: Setting) -> float:  # noqa: ARG002
        """Velocity relative to the drive above which it slips [m/s]; 0 if it has no slips."""
        return 0.0

    def ringing_period(self, config: Setting) -> float:  # noqa: ARG002
        """Period of its oscillation on the pinned contacts [s]; infinite without inertia."""
        return math.inf

    def time_in_slips(self, config: Setting) -> float:  # noqa: ARG002
        """Estimated duration of all slips of a run together [s]."""
        return 0.0

    @property
    def oscillator(self) -> Oscillator | None:
        """The slider as one mass on a spring (S40, S41); None if it is not one."""
        return None

    @property
    def layer_count(self) -> int:
        return 1

    @property
    def block_count(self) -> int:
        """Number of blocks with contacts of their own, whose motion is recorded; 0 for a slider of
        one displacement."""
        return 0

    @property
    def block_spacing(self) -> float:
        """Distance of neighbouring blocks [m]."""
        return 0.0

    @property
    def neighbour_spring(self) -> float:
        """Stiffness of the springs between blocks [N/m]."""
        return 0.0

    @property
    def springs_from_above(self) -> bool:
        """Whether the drive pulls every block, not the first one alone."""
        return True

    @property
    def block_time(self) -> float:
        """Time of sound over a block [s]."""
        return 0.0

    @property
    def extra_traces(self) -> tuple[str, ...]:
        """Names of traces of this kind only."""
        return ()

    def layers_recorded(self, config: Setting) -> int:  # noqa: ARG002
        """Number of layers whose displacements are recorded."""
        return 0

    def solver_name(self, config: Setting) -> str | None:  # noqa: ARG002
        """Method of integration, if there is a choice."""
        return None

    def residual_bound(self, config: Setting) -> float:  # noqa: ARG002
        """Maximum residual of the energy balance, relative to the work of the drive."""
        return 0.0

    @property
    def remedy(self) -> str:
        """Advice for runs with a larger residual."""
        return ""

    @property
    def caveat(self) -> str | None:
        """Limits of theory that knows a rigid slider only; None if there are none."""
        return None

    def notes(self, config: Setting) -> Notes:  # noqa: ARG002
        """Messages about keys that may not be meant so."""
        yield from ()

    def problems(self, config: Setting) -> Complaints:  # noqa: ARG002
        """The combinations that this kind refuses."""
        yield from ()
