"""A derived quantity."""

from __future__ import annotations

from typing import NamedTuple


class Quantity(NamedTuple):
    """A derived quantity: its name, its value in SI, the unit, and its meaning."""

    name: str
    value: float
    unit: str
    meaning: str
