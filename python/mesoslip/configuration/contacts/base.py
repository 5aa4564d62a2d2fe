"""The interface of all kinds of contacts."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar, Protocol

from mesoslip.configuration.contacts.tables import Contacts, Interaction
from mesoslip.configuration.kernel_parameters import Parameters
from mesoslip.configuration.run_tables import Run
from mesoslip.configuration.table import Complaints


class Block(Protocol):
    """The properties of the slider that contacts use."""

    @property
    def ignores_delay(self) -> bool: ...
    @property
    def jumps(self) -> bool: ...


class Setting(Protocol):
    """The parts of the configuration that contacts use."""

    @property
    def run(self) -> Run: ...
    @property
    def contacts(self) -> Contacts: ...
    @property
    def interaction(self) -> Interaction | None: ...
    @property
    def slider(self) -> Block: ...
    @property
    def expected_duration(self) -> float: ...


@dataclass(frozen=True)
class ContactKind(ABC):
    """A kind of contacts: its parameters in the kernel, its limits, the combinations it refuses.

    Attributes
    ----------
    kernel_kind
        The kernel's name of the kind.
    is_discrete
        Whether contacts are counted in whole numbers.
    on_lattice
        Whether contacts have sites on a lattice.
    bytes_per_contact
        Memory of a realization per contact.
    max_realizations
        Maximum number of realizations that differ from each other.
    residual_bound
        Maximum residual of the energy balance, relative to the work of the drive.
    step_work_bound
        Maximum work of steps beyond that of the contacts, relative to the same.
    force_error_bound
        Maximum error of the contact force, relative to the static force; 0 if it is exact.
    remedy
        Advice for a run that exceeds these bounds.
    """

    kernel_kind: ClassVar[str]
    is_discrete: ClassVar[bool] = True
    max_realizations: ClassVar[int] = 2**31 - 1
    residual_bound: ClassVar[float] = 1e-9
    step_work_bound: ClassVar[float] = 0.0
    force_error_bound: ClassVar[float] = 0.0
    remedy: ClassVar[str] = ""

    interaction: Interaction | None

    @classmethod
    @abstractmethod
    def is_meant(cls, run: Run, contacts: Contacts, interaction: Interaction | None) -> bool:
        """Whether the tables of a configuration describe contacts of this kind."""

    @property
    @abstractmethod
    def bytes_per_contact(self) -> int: ...

    @property
    def on_lattice(self) -> bool:
        return self.interaction is not None

    @abstractmethod
    def kernel_parameters(self, config: Setting) -> Parameters:
        """Parameters of the contacts in the kernel, in SI; forces and stiffness of one contact."""

    def coarse_parameters(
        self,
        config: Setting,  # noqa: ARG002
        coarsening: float,  # noqa: ARG002
    ) -> Parameters | None:
        """The same with longer steps; None where the numbers of a run do not depend on steps."""
        return None

    @abstractmethod
    def problems(self, config: Setting) -> Complaints:
        """The combinations that this kind refuses."""


def common_parameters(config: Setting) -> Parameters:
    """Parameters that contacts of all kinds have in the kernel."""
    contacts = config.contacts
    ignores_delay = config.slider.ignores_delay
    return {
        "count": contacts.count,
        "static_force": contacts.contact_static_force,
        "stiffness": contacts.contact_stiffness,
        "drag": 0.0 if ignores_delay else contacts.contact_drag,
        "delay": 0.0 if ignores_delay else contacts.delay,
        "delay_law": "fixed" if ignores_delay or contacts.delay == 0 else contacts.delay_law,
        "back_force_ratio": contacts.back_force_ratio,
        "newborn_width": contacts.newborn_width,
        "coupling": contacts.coupling,
        "reattach": int(contacts.reattach),
        **contacts.threshold.kernel_parameters,
    }
