"""Contacts that break by thermal activation."""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np

from mesoslip.configuration.contacts.ageing import age_problems, ageing_of
from mesoslip.configuration.contacts.base import Setting
from mesoslip.configuration.contacts.ensemble import EnsembleContacts
from mesoslip.configuration.contacts.populations import PopulationContacts
from mesoslip.configuration.contacts.tables.contacts import Contacts
from mesoslip.configuration.contacts.tables.thermal import Thermal
from mesoslip.configuration.kernel_parameters import Parameters
from mesoslip.configuration.table import Complaint, Complaints

# Ages of the life of a contact that bears the back force: the first over the scales of time, and
# their number; exponent beyond which a rate is infinite.
MIN_AGE, AGES, MAX_EXPONENT = 1e-3, 400, 500.0
# Maximum number of times that a contact breaks in a run without bearing more than the back force.
MAX_IDLE_BREAKS = 1e9
# Maximum delay relative to the mean life of such a contact.
MAX_IDLE_DELAY = 1e6


def thermal_of(config: Setting) -> Thermal:
    """The table of contacts that break by thermal activation."""
    assert config.contacts.thermal is not None
    return config.contacts.thermal


def thermal_parameters(config: Setting) -> Parameters:
    """Parameters of activation in the kernel."""
    thermal, force = thermal_of(config), config.contacts.contact_static_force
    return {"activation_rate": thermal.rate, "activation_force": thermal.ratio(force) * force}


def thermal_problems(config: Setting) -> Complaints:
    """Combinations that thermally activated contacts refuse, in both engines."""
    contacts, thermal = config.contacts, thermal_of(config)
    if contacts.coupling != "equal":
        yield Complaint(
            "contacts.coupling",
            'must be "equal" with contacts.thermal: the rates of contacts of one stiffness change '
            "by one factor as the slider moves",
            contacts.coupling,
        )
    if config.interaction is not None and config.interaction.strength > 0:
        yield Complaint(
            "interaction.strength",
            "must be 0 with contacts.thermal: the forces of neighbours change the rate at which a "
            "contact breaks, which neither engine follows",
            config.interaction.strength,
        )
    life = _idle_life(contacts, thermal, config.expected_duration)
    breaks = config.expected_duration / (contacts.delay + life)
    if breaks > MAX_IDLE_BREAKS or contacts.delay > MAX_IDLE_DELAY * life:
        yield Complaint(
            "contacts.thermal.rate",
            f"makes contacts break at once: one that bears no more than the back force has a mean "
            f"life of {life:.3g} s; a lower rate or f_T is needed",
            thermal.rate,
        )


def _idle_life(contacts: Contacts, thermal: Thermal, duration: float) -> float:
    """Mean life of a contact of mean threshold that bears the back force [s], up to a duration."""
    static, back = contacts.contact_static_force, contacts.back_force_ratio
    rate = thermal.rate_under(back, static)
    if contacts.ageing is None:
        return 1 / rate if rate > 0 else math.inf
    first = MIN_AGE * min(1 / thermal.rate, contacts.ageing.time, duration)
    age = np.concatenate([[0.0], np.geomspace(first, duration, AGES)])
    threshold = contacts.ageing.threshold(1.0, contacts.threshold.relative_width, age)
    exponent = np.minimum((back - threshold) / thermal.ratio(static), MAX_EXPONENT)
    rates = thermal.rate * np.exp(exponent)
    steps = np.diff(age)
    hazard = np.concatenate([[0.0], np.cumsum(steps * (rates[1:] + rates[:-1]) / 2)])
    # Constant hazard rates between ages: exact where a life is shorter than a step.
    passed = np.diff(hazard)
    share = np.where(passed > 0, -np.expm1(-passed) / np.where(passed > 0, passed, 1.0), 1.0)
    return float(np.sum(steps * np.exp(-hazard[:-1]) * share))


class ThermalContacts(EnsembleContacts):
    """Independent contacts that break by thermal activation, simulated one by one."""

    kernel_kind: ClassVar[str] = "thermal"
    features: ClassVar[frozenset[str]] = frozenset({"contacts.thermal"})

    def kernel_parameters(self, config: Setting) -> Parameters:
        return super().kernel_parameters(config) | thermal_parameters(config)

    def _problems(self, config: Setting) -> Complaints:
        yield from super()._problems(config)
        yield from thermal_problems(config)


class ThermalAgeingContacts(ThermalContacts):
    """The same contacts with thresholds that change with age."""

    kernel_kind: ClassVar[str] = "thermal ageing"
    features: ClassVar[frozenset[str]] = frozenset({"contacts.thermal", "contacts.ageing"})
    # A contact whose threshold moves breaks within a tiny gap of it.
    force_error_bound: ClassVar[float] = 1e-9

    def kernel_parameters(self, config: Setting) -> Parameters:
        return (
            super().kernel_parameters(config)
            | ageing_of(config).kernel_parameters()
            | {"slider_jumps": int(config.slider.jumps)}
        )

    def _problems(self, config: Setting) -> Complaints:
        yield from super()._problems(config)
        yield from age_problems(config)


class ThermalPopulations(PopulationContacts):
    """Infinitely many contacts that break by thermal activation."""

    kernel_kind: ClassVar[str] = "thermal populations"
    features: ClassVar[frozenset[str]] = frozenset({"contacts.thermal"})
    options: ClassVar[frozenset[str]] = frozenset({"load"})
    # A slider that hardly oscillates is taken to creep: what energy it oscillates with is lost.
    residual_bound: ClassVar[float] = 1e-5

    def kernel_parameters(self, config: Setting) -> Parameters:
        return super().kernel_parameters(config) | thermal_parameters(config)

    def _problems(self, config: Setting) -> Complaints:
        yield from super()._problems(config)
        # PopulationContacts refuses interaction already.
        yield from (one for one in thermal_problems(config) if one.key != "interaction.strength")
        if config.contacts.track is not None:
            yield Complaint(
                "contacts.track",
                'is not for contacts.thermal with engine "me", which tabulates the survivors of '
                'activation for one strength: run.engine = "eq" has both',
            )
        if config.contacts.initial == "uniform":
            yield Complaint(
                "contacts.initial",
                'must be "relaxed" or "steady" with contacts.thermal and engine "me": in the other '
                "state thresholds do not have the law by which activation is tabulated",
                config.contacts.initial,
            )


class ThermalAgeingPopulations(ThermalPopulations):
    """Infinitely many contacts that break by thermal activation and age."""

    kernel_kind: ClassVar[str] = "thermal ageing populations"
    features: ClassVar[frozenset[str]] = frozenset({"contacts.thermal", "contacts.ageing"})

    def kernel_parameters(self, config: Setting) -> Parameters:
        return super().kernel_parameters(config) | ageing_of(config).kernel_parameters()

    def _problems(self, config: Setting) -> Complaints:
        yield from super()._problems(config)
        yield from age_problems(config)
