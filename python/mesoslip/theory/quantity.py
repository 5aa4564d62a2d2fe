"""A derived quantity."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from mesoslip.text_rows import named_meanings


class Quantity(NamedTuple):
    """A derived quantity: its name, its value in SI, the unit, and its meaning."""

    name: str
    value: float
    unit: str
    meaning: str


def named_quantities(rows: str) -> Callable[[str, float], Quantity]:
    """A quantity by its name and value, with unit and meaning from rows of a text."""
    known = named_meanings(rows)
    return lambda name, value: Quantity(name, value, *known[name])
