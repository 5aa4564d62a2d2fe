"""Laws of the delay between detaching and attaching, in steady sliding and in holds."""

from __future__ import annotations

import abc
from typing import TYPE_CHECKING

import numpy as np

from mesoslip.array_types import Complex
from mesoslip.errors import ConfigError, MesoslipError

if TYPE_CHECKING:
    from mesoslip.configuration.config import Config


class DelayLaw(abc.ABC):
    """A law of delays with a mean [s]."""

    def __init__(self, mean: float) -> None:
        self.mean = mean

    @abc.abstractmethod
    def late(self, rate: Complex) -> tuple[Complex, Complex]:
        """Average of e^(-λ t) over the delays t, and 1 less that to all digits."""

    @property
    @abc.abstractmethod
    def turning(self) -> float:
        """Delay that turns the response at high frequencies [s]; 0 if delays differ."""

    @abc.abstractmethod
    def common(self, subject: str) -> float:
        """The delay that all contacts have [s]; an error about a subject if they differ."""


class FixedDelay(DelayLaw):
    """All contacts wait for the same time."""

    def late(self, rate: Complex) -> tuple[Complex, Complex]:
        return np.exp(-rate * self.mean), -np.expm1(-rate * self.mean)

    @property
    def turning(self) -> float:
        return self.mean

    def common(self, subject: str) -> float:
        del subject
        return self.mean


class ExponentialDelay(DelayLaw):
    """Each delay is drawn from the exponential law."""

    def late(self, rate: Complex) -> tuple[Complex, Complex]:
        late: Complex = 1 / (1 + rate * self.mean)
        return late, rate * self.mean * late

    @property
    def turning(self) -> float:
        return 0.0

    def common(self, subject: str) -> float:
        if self.mean > 0:
            raise MesoslipError(
                f'{subject} is known for contacts.delay_law = "fixed" or without delay'
            )
        return 0.0


LAWS: dict[str, type[DelayLaw]] = {"fixed": FixedDelay, "exponential": ExponentialDelay}


def delay_law(config: Config) -> DelayLaw:
    """The law of the delays of a configuration; a law without a theory is refused."""
    name = config.contacts.delay_law
    if name not in LAWS:
        raise ConfigError.of("contacts.delay_law", "has no theory", name)
    return LAWS[name](mean_delay(config))


def mean_delay(config: Config) -> float:
    """Mean delay of contacts under the slider of a configuration [s]."""
    return 0.0 if config.slider.ignores_delay else config.contacts.delay


def drag_impulse(config: Config, velocity: float) -> float:
    """Drag of all contacts in a delay each, N m η v τ_d [N s]."""
    contacts = config.contacts
    return contacts.contact_drag * contacts.count * velocity * mean_delay(config)
