"""Configuration files: TOML, laid over the files that they are based on, with changes laid over."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from mesoslip.errors import ConfigError, FileError, Problem

# Keys that exclude each other: laid over a base, one replaces the other.
EXCLUSIVE = {
    "run": ("duration", "drive_displacement"),
    "drive": ("velocity", "stage", "force_rate"),
    "slider": ("damping", "damping_ratio"),
}


def read_toml(path: Path, outer: tuple[Path, ...]) -> dict[str, Any]:
    """Tables of a file, laid over those of its base."""
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise FileError(f"{path}: no such file") from None
    except IsADirectoryError:
        raise FileError(f"{path}: is a directory, not a configuration file") from None
    except (OSError, UnicodeDecodeError) as error:
        raise FileError(f"{path}: cannot be read: {error}") from None
    tables = parse_toml(text, str(path))
    base = tables.pop("base", None)
    if base is None:
        return tables
    if not isinstance(base, str):
        raise ConfigError([Problem(str(path), "base", "must be the name of a file", base)])
    outer = (*outer, path.resolve())
    base_path = path.parent / base
    if base_path.resolve() in outer:
        raise ConfigError([Problem(str(path), "base", "files are based on each other", base)])
    return _merge(read_toml(base_path, outer), tables)


def parse_toml(text: str, source: str) -> dict[str, Any]:
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ConfigError([Problem(source, "", f"not valid TOML: {error}")]) from None


def _merge(base: Mapping[str, Any], over: Mapping[str, Any], table: str = "") -> dict[str, Any]:
    """Lay tables over others.

    Of keys that exclude each other the one laid over stays; another kind of slider starts anew.
    """
    merged = dict(base)
    kind = base.get("kind", "rigid")
    if table == "slider" and over.get("kind", kind) != kind:
        merged = {}
    exclusive = EXCLUSIVE.get(table, ())
    if any(key in over for key in exclusive):
        merged = {key: value for key, value in merged.items() if key not in exclusive}
    for key, value in over.items():
        below = merged.get(key)
        if isinstance(value, Mapping) and isinstance(below, Mapping):
            merged[key] = _merge(below, value, key)
        else:
            merged[key] = value
    return merged


def override(tables: dict[str, Any], overrides: Iterable[str]) -> dict[str, Any]:
    """Lay changes such as "contacts.delay=1ms" over tables."""
    for change in overrides:
        tables = _merge(tables, _parse_change(change))
    return tables


def _parse_change(text: str) -> dict[str, Any]:
    """The tables of a change such as "contacts.delay=1ms"."""
    key, equals, value = text.partition("=")
    key, value = key.strip(), value.strip()
    if not equals or not re.fullmatch(r"[A-Za-z_]\w*(\.[A-Za-z_]\w*)*", key):
        raise ConfigError([Problem("--set", text, "must look like contacts.delay=1ms")])
    try:
        parsed = tomllib.loads(f"value = {value}")["value"]
    except tomllib.TOMLDecodeError:
        parsed = value
    outer, _, last = key.rpartition(".")
    tables = {last: parsed}
    for part in reversed(outer.split(".") if outer else ()):
        tables = {part: tables}
    return tables
