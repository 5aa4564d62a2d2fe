"""The axes of a sweep, and the values of a combination in words."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from mesoslip.configuration.keys import key_kind

Value = float | int | str | bool


@dataclass(frozen=True)
class Axis:
    """Keys that vary together, with a row of their values, in SI, for each index."""

    dimension: str
    keys: tuple[str, ...]
    rows: tuple[tuple[Value, ...], ...]


def described(values: Mapping[str, Value]) -> str:
    """Values of keys, for messages."""
    parts = []
    for key, value in values.items():
        kind = key_kind(key)
        unit = "" if kind is None or kind.unit in {None, "1"} else f" {kind.unit}"
        text = f"{value:g}" if isinstance(value, float) else str(value)
        parts.append(f"{key} = {text}{unit}")
    return ", ".join(parts)
