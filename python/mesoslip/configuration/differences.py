"""Differences between configurations, key by key, with values in suitable units."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple, Protocol

from mesoslip.configuration.config import Config
from mesoslip.configuration.files import Change, Merged, override
from mesoslip.configuration.keys import key_kind
from mesoslip.errors import ConfigError, Problem
from mesoslip.quantities import number, scale_for, with_unit

# Maximum number of characters of a value.
MAX_LENGTH = 60
# Significant digits of numbers.
DIGITS = 6
MISSING = "not given"
BOOKKEEPING = ("run.", "output.", "curve.")


def is_bookkeeping(key: str) -> bool:
    """Whether a key affects the length of a run and its record, but not the motion."""
    return key.startswith(BOOKKEEPING) and key != "run.engine"


class Setting(Protocol):
    """Writes a key with its value in a configuration, the only one or one of several."""

    def __call__(self, key: str, value: str, config: Config, /, *, is_alone: bool) -> str: ...


class Difference(NamedTuple):
    """A key, and its values in the compared configurations as texts."""

    key: str
    values: tuple[str, ...]


def differences(configs: Sequence[Config]) -> list[Difference]:
    """The keys whose values differ or that some do not have, in the order of the file; titles do
    not count."""
    tables = [flat(config) for config in configs]
    keys = dict.fromkeys(key for table in tables for key in table if key != "title")
    found = []
    for key in keys:
        values = [table.get(key) for table in tables]
        if any(value != values[0] for value in values):
            found.append(Difference(key, tuple(text_of(key, value) for value in values)))
    return found


def flat(config: Config) -> dict[str, Any]:
    """Values of a configuration by dotted key, including defaults; lists are not split."""
    return by_dotted_key(config.to_dict())


def by_dotted_key(tables: Mapping[str, Any], outer: str = "") -> dict[str, Any]:
    """Values of nested tables by dotted key."""
    values: dict[str, Any] = {}
    for name, value in tables.items():
        if isinstance(value, Mapping):
            values |= by_dotted_key(value, f"{outer}{name}.")
        else:
            values[outer + name] = value
    return values


def check_changes(changes: Iterable[Change], setters: Mapping[str, str], source: str) -> None:
    """Refuse changes without an effect, of keys that something else sets: its name by key."""
    changed = by_dotted_key(override(Merged({}), changes).tables)
    found = [
        Problem(source, key, f"cannot be changed, as {setters[key]} sets it; change that instead")
        for key in changed
        if key in setters
    ]
    if found:
        raise ConfigError(found)


def text_of(key: str, value: Any) -> str:
    """A value of a key in SI as text with a suitable unit, such as "0.5 ms"."""
    if value is None:
        return MISSING
    if isinstance(value, list | tuple):
        inner = ", ".join(_text_in_list(key, one) for one in value)
        return _shortened(f"[{inner}]", len(value))
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float) and math.isfinite(value):
        kind = key_kind(key)
        return with_unit(value, kind.unit if kind is not None and kind.unit else "1", DIGITS)
    return str(value)


def in_one_unit(key: str, values: Sequence[Any]) -> tuple[str, tuple[str, ...]]:
    """A key with a unit, such as "contacts.delay (ms)", and its values (SI, or None) in that unit
    as texts."""
    kind = key_kind(key)
    numbers = [one for value in values for one in _numbers(value)]
    if kind is None or kind.unit is None or not numbers:
        return key, tuple(text_of(key, value) for value in values)
    scale = scale_for(max(abs(one) for one in numbers), kind.unit)

    def text(value: Any) -> str:
        if value is None:
            return MISSING
        if isinstance(value, list | tuple):
            return _shortened(f"[{', '.join(text(one) for one in value)}]", len(value))
        return number(value / scale.size, DIGITS)

    return scale.label(key), tuple(text(value) for value in values)


def _numbers(value: Any) -> list[float]:
    inner = value if isinstance(value, list | tuple) else [value]
    return [
        one
        for one in inner
        if isinstance(one, int | float) and not isinstance(one, bool) and math.isfinite(one)
    ]


def _shortened(text: str, count: int) -> str:
    """The text of a list, cut off if it is long."""
    return text if len(text) <= MAX_LENGTH else f"{text[: MAX_LENGTH - 10]} … ({count} in total)"


def _text_in_list(key: str, value: Any) -> str:
    if isinstance(value, Mapping):
        inner = ", ".join(text_of(f"{key}.{name}", one) for name, one in value.items())
        return f"({inner})"
    return text_of(key, value)


def changes(config: Config, base: Config) -> list[Difference]:
    """Changes of a configuration relative to a base: keys with the value and that before, which may
    be `MISSING`; bookkeeping comes last.

    Keys that only the base has, and defaults that only the configuration has, are left out.
    """
    own = by_dotted_key(config.model_dump(exclude_none=True, exclude_defaults=True, by_alias=True))
    found = [
        one
        for one in differences([config, base])
        if one.values[0] != MISSING and (one.values[1] != MISSING or one.key in own)
    ]
    return sorted(found, key=lambda one: is_bookkeeping(one.key))


def _plain_setting(key: str, value: str, _: Config, *, is_alone: bool) -> str:  # noqa: ARG001
    return f"{key} = {value}"


def labels(
    configs: Sequence[Config], names: Sequence[str], setting: Setting = _plain_setting
) -> list[str]:
    """A label for each configuration, from the keys in which it differs from the others.

    Keys of [run], [output] and [curve] count only if no others differ. Equal configurations are
    labelled with their names, and equal labels have the names in addition.
    """
    all_found = differences(configs)
    found = [one for one in all_found if not is_bookkeeping(one.key)] or all_found
    texts = []
    for index, (config, name) in enumerate(zip(configs, names, strict=True)):
        given = [one for one in found if one.values[index] != MISSING] or found
        alone = len(given) == 1
        parts = [setting(one.key, one.values[index], config, is_alone=alone) for one in given[:3]]
        parts += [f"and {len(given) - 3} more"] if len(given) > 3 else []
        texts.append(", ".join(parts) if parts else name)
    return [
        text if texts.count(text) == 1 or not found else f"{name}: {text}"
        for text, name in zip(texts, names, strict=True)
    ]
