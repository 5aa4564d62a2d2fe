"""The table [contacts.ageing]: how thresholds change with age."""

from __future__ import annotations

from typing import Annotated, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import Field, model_validator

from mesoslip.configuration.kernel_parameters import Parameters
from mesoslip.configuration.table import Number, Table, Time, choice, problem
from mesoslip.configuration.threshold_laws.base import MIN_WIDTH

AGEING_LAWS = ("relax", "log")
# Keys that belong to one law each.
AGEING_KEYS = {"relax": ("young_force_ratio", "young_relative_width"), "log": ("growth",)}
# Age of contacts that are fully aged [s].
INFINITE_AGE = 1e300


class Ageing(Table):
    """How the threshold of a contact changes with its age (model section 9).

    The static force and the relative width of [contacts] are those of old contacts with the law
    `relax`, and of new contacts with the law `log`. Contacts start a run with these thresholds,
    unless ``initial_age`` gives another age.
    """

    law: Annotated[str, choice(AGEING_LAWS)] = "relax"
    """`relax`: exponential approach to the old thresholds; `log`: logarithmic growth with age."""
    time: Annotated[Time, Field(gt=0)]
    """Time scale of ageing, τ_a."""
    young_force_ratio: Annotated[Number, Field(gt=0)] | None = None
    """With `relax`: mean threshold of young contacts, relative to that of old ones."""
    young_relative_width: Annotated[Number, Field(ge=MIN_WIDTH)] | None = None
    """With `relax`: relative standard deviation of the thresholds of young contacts."""
    growth: Annotated[Number, Field(ge=0)] | None = None
    """With `log`: growth β per e-fold of age, in f_s [1 + β ln(1 + age/time)]."""
    initial_age: Annotated[Time, Field(ge=0)] | None = None
    """Age of the contacts at the start; by default fully aged with `relax`, 0 with `log`."""

    @model_validator(mode="after")
    def _keys_of_the_law(self) -> Self:
        for law, keys in AGEING_KEYS.items():
            for key in keys:
                is_given = getattr(self, key) is not None
                if is_given and law != self.law:
                    raise problem(key, f'is for law = "{law}", not "{self.law}"')
                if not is_given and law == self.law:
                    raise problem(key, f'needed for law = "{law}"')
        return self

    @property
    def start_age(self) -> float:
        """Age of the contacts at the start of a run [s]."""
        if self.initial_age is not None:
            return self.initial_age
        return INFINITE_AGE if self.law == "relax" else 0.0

    def kernel_parameters(self) -> Parameters:
        return {
            "ageing": self.law,
            "ageing_time": self.time,
            "initial_age": self.start_age,
            **{key: getattr(self, key) for key in AGEING_KEYS[self.law]},
        }

    def threshold(self, configured: ArrayLike, width: float, age: ArrayLike) -> NDArray[np.float64]:
        """Thresholds at an age [s], from the configured ones; both relative to the static force.

        ``width`` is the relative width of the configured thresholds.
        """
        old, relative_age = np.asarray(configured), np.asarray(age) / self.time
        if self.law == "log":
            return np.asarray(old * (1 + (self.growth or 0.0) * np.log1p(relative_age)))
        ratio, young_width = self.young_force_ratio or 1.0, self.young_relative_width or width
        young = ratio * (1 + young_width * (old - 1) / width)
        return np.asarray(old + (young - old) * np.exp(-relative_age))

    def configured(self, threshold: float, width: float, age: float) -> float:
        """Configured threshold of a contact, from its threshold at an age."""
        at_zero, at_one = self.threshold([0.0, 1.0], width, age)
        return float((threshold - at_zero) / (at_one - at_zero))
