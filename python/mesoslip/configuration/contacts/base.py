"""What every kind of contacts answers."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar, Protocol

from mesoslip.configuration.contacts.tables import Contacts, Interaction
from mesoslip.configuration.table import Complaints
from mesoslip.configuration.tables import Run


class Block(Protocol):
    """What contacts know of the slider."""

    @property
    def ignores_delay(self) -> bool: ...
    @property
    def jumps(self) -> bool: ...


class Setting(Protocol):
    """What contacts know of the configuration that they are in."""

    @property
    def run(self) -> Run: ...
    @property
    def contacts(self) -> Contacts: ...
    @property
    def interaction(self) -> Interaction | None: ...
    @property
    def slider(self) -> Block: ...


@dataclass(frozen=True)
class ContactKind(ABC):
    """A kind of contacts: what the kernel is told of them, what they take, and what they refuse.

    Attributes
    ----------
    kernel_kind
        The kernel's name of the kind.
    is_discrete
        Whether numbers of contacts are whole.
    on_lattice
        Whether contacts have places.
    bytes_per_contact
        Memory that a realization takes for each contact.
    most_realizations
        How many realizations differ from each other.
    residual_bound
        What the energy balance may lack, relative to the work of the drive.
    force_error_bound
        What the contact force may be off by over the static force; 0 if it is exact.
    remedy
        What makes a run keep these promises better.
    """

    kernel_kind: ClassVar[str]
    is_discrete: ClassVar[bool] = True
    most_realizations: ClassVar[int] = 2**31 - 1
    residual_bound: ClassVar[float] = 1e-9
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
    def kernel_parameters(self, config: Setting) -> dict[str, float | str]:
        """What the kernel is told of the contacts, in SI; forces and stiffness of one contact."""

    @abstractmethod
    def problems(self, config: Setting) -> Complaints:
        """The combinations that this kind refuses."""


def common_parameters(config: Setting) -> dict[str, float | str]:
    """What the kernel is told of contacts of every kind."""
    contacts = config.contacts
    ignores_delay = config.slider.ignores_delay
    return {
        "count": contacts.count,
        "static_force": contacts.contact_static_force,
        "stiffness": contacts.contact_stiffness,
        "drag": 0.0 if ignores_delay else contacts.contact_drag,
        "delay": 0.0 if ignores_delay else contacts.delay,
        "back_force_ratio": contacts.back_force_ratio,
        "coupling": contacts.coupling,
        "reattach": int(contacts.reattach),
        **contacts.threshold.kernel_parameters,
    }
