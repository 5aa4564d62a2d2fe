"""The interface of all kinds of contacts."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from mesoslip.configuration.contacts.tables.contacts import Contacts
from mesoslip.configuration.contacts.tables.interaction import Interaction
from mesoslip.configuration.kernel_parameters import Parameters
from mesoslip.configuration.load import Load
from mesoslip.configuration.run_tables import Run
from mesoslip.configuration.table import Complaint, Complaints, Table

Array = NDArray[Any]

# Time that a contact takes which touches or separates as the load changes [s].
LOAD_CHANGE_SECONDS = 1e-7

# Keys that every kind answers, by `common_parameters` or in its own room. Any other key or table
# that is given belongs to the kinds that have it as a feature, and is refused by all others.
COMMON_KEYS = frozenset(
    f"contacts.{key}"
    for key in (
        *("count", "static_force", "stiffness", "area", "film_thickness", "film_density"),
        *("drag", "drag_rate", "delay", "delay_law", "back_force_ratio", "newborn_width"),
        *("coupling", "initial", "reattach", "threshold"),
    )
)


class Block(Protocol):
    """The properties of the slider that contacts use."""

    @property
    def ignores_delay(self) -> bool: ...
    @property
    def jumps(self) -> bool: ...
    @property
    def block_count(self) -> int: ...
    @property
    def block_spacing(self) -> float: ...


class Setting(Protocol):
    """The parts of the configuration that contacts use."""

    @property
    def run(self) -> Run: ...
    @property
    def contacts(self) -> Contacts: ...
    @property
    def interaction(self) -> Interaction | None: ...
    @property
    def pressing(self) -> Load: ...
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
    engine
        The engine that simulates it.
    features
        Keys and tables beyond the common ones that make it, such as "contacts.ageing".
    options
        Further keys and tables that it answers where they are given.
    is_discrete
        Whether contacts are counted in whole numbers.
    has_neighbours
        Whether neighbours have a share in the force at which a contact breaks.
    on_lattice
        Whether contacts have sites on a lattice.
    bytes_per_contact
        Memory of a realization per contact.
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
    engine: ClassVar[str]
    features: ClassVar[frozenset[str]] = frozenset()
    options: ClassVar[frozenset[str]] = frozenset({"contacts.renewal", "contacts.track", "load"})
    is_discrete: ClassVar[bool] = True
    has_neighbours: ClassVar[bool] = False
    residual_bound: ClassVar[float] = 1e-9
    step_work_bound: ClassVar[float] = 0.0
    force_error_bound: ClassVar[float] = 0.0
    remedy: ClassVar[str] = ""

    interaction: Interaction | None
    load: Load

    @property
    @abstractmethod
    def bytes_per_contact(self) -> int: ...

    @property
    def on_lattice(self) -> bool:
        return self.interaction is not None

    def site_count(self, contacts: Contacts) -> int:
        """Number of sites of contacts: that of contacts at the maximum of the load."""
        return self.load.site_count(contacts.count)

    def load_changes(self, config: Setting) -> float:
        """How often contacts touch or separate because the load changes in a realization; 0 where
        they are not counted one by one."""
        if not self.is_discrete:
            return 0.0
        path = self.load.path_length(config.expected_duration)
        return config.contacts.count * path / self.load.normal_force

    def dimensions(self, contacts: Contacts) -> dict[str, int]:
        """Dimensions of the contacts in outputs, and their lengths."""
        if self.interaction is None:
            return {"contact": self.site_count(contacts)}
        return {"row": self.interaction.rows, "column": self.interaction.columns}

    def positions(self, contacts: Contacts) -> dict[str, Array]:
        """Coordinates of the contacts in outputs, with the shape of their dimensions; in m."""
        if self.interaction is None:
            return {"contact": np.arange(self.site_count(contacts))}
        assert contacts.area is not None
        spacing = np.sqrt(contacts.area / contacts.count)
        x, y = self.interaction.sites
        return {"x": spacing * x, "y": spacing * y}

    @abstractmethod
    def kernel_parameters(self, config: Setting) -> Parameters:
        """Parameters of the contacts in the kernel, in SI; forces and stiffness of one contact."""

    def parameters_with(
        self,
        config: Setting,  # noqa: ARG002
        resolution: float,  # noqa: ARG002
    ) -> Parameters | None:
        """The same with a resolution; None where the numbers of a run do not depend on steps."""
        return None

    def problems(self, config: Setting, given: frozenset[str]) -> Complaints:
        """The combinations that this kind refuses, and the given keys that it does not answer."""
        complaints = list(self._problems(config))
        yield from complaints
        if config.run.force_tolerance is not None and not self.step_work_bound > 0:
            yield Complaint(
                "run.force_tolerance",
                'needs engine "me": contacts one by one have no steps, and no error of steps',
                config.run.force_tolerance,
            )
        if self.interaction is not None and "load" in given:
            yield Complaint(
                "load",
                "must be constant, with normal_force alone, beside [interaction]: contacts on a "
                "lattice have no heights at which they separate",
            )
            given -= {"load"}
        for key in sorted(given - COMMON_KEYS - self.features - self.options):
            if not any(f"{one.key}.".startswith(f"{key}.") for one in complaints):
                yield Complaint(
                    key, f'is not known to contacts of the kind "{self.kernel_kind}": leave it out'
                )

    @abstractmethod
    def _problems(self, config: Setting) -> Complaints:
        """The combinations that this kind refuses in its own words."""


def given_keys(contacts: Contacts, beside: Mapping[str, Table | None]) -> frozenset[str]:
    """Keys of [contacts] that differ from their defaults, and tables ``beside`` it that act."""
    fields = type(contacts).model_fields
    keys = {
        f"contacts.{name}"
        for name, field in fields.items()
        if getattr(contacts, name) != field.get_default()
    }
    return frozenset(keys | {name for name, table in beside.items() if table and table.acts})


def common_parameters(config: Setting) -> Parameters:
    """Parameters that contacts of all kinds have in the kernel."""
    contacts = config.contacts
    ignores_delay = config.slider.ignores_delay
    return {
        "count": config.pressing.site_count(contacts.count),
        **config.pressing.kernel_parameters(contacts.count),
        "static_force": contacts.contact_static_force,
        "stiffness": contacts.contact_stiffness,
        "drag": 0.0 if ignores_delay else contacts.contact_drag,
        "delay": 0.0 if ignores_delay else contacts.delay,
        "delay_law": "fixed" if ignores_delay or contacts.delay == 0 else contacts.delay_law,
        "back_force_ratio": contacts.back_force_ratio,
        "newborn_width": contacts.newborn_width,
        "coupling": contacts.coupling,
        "reattach": int(contacts.reattach),
        **_blocks(config),
        **contacts.threshold.kernel_parameters,
        **({} if contacts.renewal == "redraw" else {"keeps_thresholds": 1}),
        **_track(contacts),
    }


def _blocks(config: Setting) -> Parameters:
    """Parameters of contacts on the blocks of a slider."""
    load, blocks = config.pressing, config.slider.block_count
    if not blocks:
        return {}
    counts = load.block_counts(load.site_count(config.contacts.count), blocks)
    return {
        "block_counts": tuple(counts.tolist()),
        "block_spacing": config.slider.block_spacing,
    }


def _track(contacts: Contacts) -> Parameters:
    """Parameters of the strength along a track."""
    if contacts.track is None:
        return {}
    return contacts.track.kernel_parameters(contacts.strength_floor)
