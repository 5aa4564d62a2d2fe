"""The table [contacts.thermal]: thermally activated breaking."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any, Self

from pydantic import Field, model_validator

from mesoslip.configuration.table import Length, Number, Rate, Table, Temperature, problem

# Boltzmann's constant [J/K], exact in the SI.
BOLTZMANN = 1.380649e-23


class Thermal(Table):
    """Thermally activated breaking (model section 13).

    A contact that bears the force f below its threshold f_s breaks at the rate
    ω_0 exp((|f| − f_s)/f_T), and at once at the threshold, which may change with age. The force f_T
    is given relative to the mean threshold, or as k_B T over an activation length.
    """

    rate: Annotated[Rate, Field(gt=0)]
    """Rate of breaking at the threshold, ω_0."""
    force_ratio: Annotated[Number, Field(gt=0)] | None = None
    """Force scale of activation relative to the mean threshold, f_T/f_s."""
    temperature: Annotated[Temperature, Field(gt=0)] | None = None
    """Temperature T, in place of `force_ratio`; f_T = k_B T/x_a."""
    activation_length: Annotated[Length, Field(gt=0)] | None = None
    """Activation length x_a, with `temperature`."""

    @model_validator(mode="before")
    @classmethod
    def _all_that_is_missing(cls, values: Any) -> Any:
        """Report keys that depend on one another together with the rate."""
        if not isinstance(values, Mapping):
            return values
        has = {key for key, value in values.items() if value is not None}
        if "rate" in has or "force_ratio" in has:
            return values
        pair = ("temperature", "activation_length")
        missing = [key for key in pair if key not in has]
        if len(missing) == 1:
            raise problem("rate", f"missing, and so is {missing[0]}: f_T = k_B T/x_a needs both")
        return values

    @model_validator(mode="after")
    def _one_force(self) -> Self:
        if self.force_ratio is not None:
            for key in ("temperature", "activation_length"):
                if getattr(self, key) is not None:
                    raise problem(
                        key,
                        "give either force_ratio, or temperature and activation_length: both "
                        "determine the force f_T = k_B T/x_a",
                    )
        elif self.temperature is None and self.activation_length is None:
            raise problem("force_ratio", "needed, or temperature and activation_length")
        else:
            for key in ("temperature", "activation_length"):
                if getattr(self, key) is None:
                    raise problem(key, "needed without force_ratio: f_T = k_B T/x_a")
        return self

    def ratio(self, contact_static_force: float) -> float:
        """f_T/f_s, from the mean threshold of a contact [N]."""
        if self.force_ratio is not None:
            return self.force_ratio
        assert self.temperature is not None
        assert self.activation_length is not None
        return BOLTZMANN * self.temperature / self.activation_length / contact_static_force

    def rate_under(self, force_ratio: float, contact_static_force: float) -> float:
        """Rate at which a contact of mean threshold breaks under a force relative to it [1/s]."""
        return self.rate * math.exp((force_ratio - 1) / self.ratio(contact_static_force))
