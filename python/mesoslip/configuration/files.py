"""Configuration files: TOML, merged with the base that they name, then with changes."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from mesoslip.configuration.reading import text_of
from mesoslip.configuration.sliders import DEFAULT, SLIDERS
from mesoslip.errors import ConfigError, FileError, Problem

# Keys that exclude each other: each replaces those of the base.
EXCLUSIVE = {
    "run": ("duration", "drive_displacement"),
    "drive": ("velocity", "stage", "cycle", "history", "force", "force_rate"),
    "cycle": ("velocity", "frequency"),
    "history": ("file", "time", "displacement", "normal_force"),
    "load": ("stage", "cycle", "history"),
    "threshold": ("relative_width", "file", "samples", "weights", "stiffnesses"),
    "slider": ("damping", "damping_ratio"),
}

# Keys that name a file, relative to the folder of the configuration.
FILES = (
    ("drive", "history", "file"),
    ("load", "history", "file"),
    ("load", "profile"),
    ("contacts", "threshold", "file"),
)

# Files of a chain of bases.
MAX_BASES = 50

# Value of a change that removes a key.
NONE = "none"

Change = str | Mapping[str, Any]


@dataclass
class Merged:
    """Merged tables, dotted keys that the new kind of slider does not have, and the tables of the
    base of a file, if it has one."""

    tables: dict[str, Any]
    dropped: list[str] = field(default_factory=list)
    base: dict[str, Any] | None = None


def read_toml(path: Path) -> Merged:
    """Tables of a file, merged with those of its base."""
    return _read(path, ())


def on_base(tables: Mapping[str, Any], source: str, folder: Path) -> Merged:
    """Tables merged with those of the file that their key ``base`` names, relative to a folder."""
    return _on_base(dict(tables), source, folder, ())


def _read(path: Path, outer: tuple[Path, ...]) -> Merged:
    return _on_base(
        parse_toml(text_of(path, "a configuration file"), str(path)),
        str(path),
        path.parent,
        (*outer, path),
    )


def _on_base(tables: dict[str, Any], source: str, folder: Path, outer: tuple[Path, ...]) -> Merged:
    base = tables.pop("base", None)
    for keys in FILES:
        _place_file(tables, keys, folder)
    if base is None:
        return Merged(tables)
    if not isinstance(base, str) or not base or "\0" in base:
        raise ConfigError([Problem(source, "base", "must be the name of a file", base)])
    path = folder / base
    if any(_are_the_same(path, one) for one in outer):
        raise ConfigError([Problem(source, "base", "files are based on each other", base)])
    if len(outer) > MAX_BASES:
        problem = f"more than {MAX_BASES} files are based on one another"
        raise ConfigError([Problem(source, "base", problem, base)])
    _check_base(path, source, base)
    below = _read(path, outer)
    return replace(_merge_over(below, tables), base=below.tables)


def _check_base(path: Path, source: str, base: str) -> None:
    """Check that a base exists; reading it finds other errors."""
    try:
        path.stat()
    except FileNotFoundError:
        raise FileError(
            f"{source}: base = {base!r}: there is no such file; mesoslip example "
            "writes an example and its base"
        ) from None
    except (OSError, ValueError):
        return


def _place_file(tables: dict[str, Any], keys: Sequence[str], folder: Path) -> None:
    """Replace the name of a file by its path, in copies of the tables."""
    key, *inner = keys
    value = tables.get(key)
    if inner and isinstance(value, Mapping):
        tables[key] = dict(value)
        _place_file(tables[key], inner, folder)
    elif not inner and isinstance(value, str) and value:
        tables[key] = str(folder / value)


def _are_the_same(path: Path, other: Path) -> bool:
    """Whether two paths lead to the same file."""
    try:
        return path.samefile(other)
    # Errors of the file are reported when it is read.
    except OSError:
        return False


def parse_toml(text: str, source: str) -> dict[str, Any]:
    """Tables of a text in TOML, which must be valid and not too deeply nested."""
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise ConfigError([Problem(source, "", "is nested too deeply")]) from None
    # The error of the parser, or of a number with too many digits.
    except ValueError as error:
        message = f'not valid TOML: {error}; quantities have quotes, as in "97 N/m"'
        raise ConfigError([Problem(source, "", message)]) from None


def check_no_files(tables: Mapping[str, Any], source: str, prefix: str = "") -> None:
    """Refuse names of files in the tables of an output, which contain the data themselves."""
    for key, value in tables.items():
        where = f"{prefix}{key}"
        if isinstance(value, Mapping):
            check_no_files(value, source, f"{where}.")
        elif key == "file" or (isinstance(value, str) and tuple(where.split(".")) in FILES):
            raise ConfigError([Problem(source, where, "an output must not name a file", value)])


def _merge_over(base: Merged, over: Mapping[str, Any]) -> Merged:
    """Merge tables over those of a base; a new kind of slider keeps the keys that it has too."""
    tables, dropped = base.tables, []
    slider, change = tables.get("slider"), over.get("slider")
    if isinstance(slider, Mapping) and isinstance(change, Mapping) and "kind" in change:
        kept = _of_kind(slider, change["kind"])
        dropped = [f"slider.{key}" for key in slider if key not in kept and key not in change]
        tables = {**tables, "slider": kept}
    return Merged(_merge(tables, over), base.dropped + dropped)


def _merge(base: Mapping[str, Any], over: Mapping[str, Any], table: str = "") -> dict[str, Any]:
    """Merge tables; a new key replaces those that it excludes, and None removes a key."""
    merged = dict(base)
    exclusive = EXCLUSIVE.get(table, ())
    if any(over.get(key) is not None for key in exclusive):
        dropped = {key for key in exclusive if key not in over}
        # Without the stages, the number of repetitions is dropped too.
        dropped |= {"repeat"} if "stage" in dropped else set()
        merged = {key: value for key, value in merged.items() if key not in dropped}
    for key, value in over.items():
        below = merged.get(key)
        if isinstance(value, Mapping) and isinstance(below, Mapping):
            merged[key] = _merge(below, value, key)
        elif value is None and key in merged:
            del merged[key]
        else:
            merged[key] = value
    return merged


def _of_kind(slider: Mapping[str, Any], kind: object) -> Mapping[str, Any]:
    """Keys of a slider, without those that another kind does not have."""
    old, new = (
        SLIDERS.get(name) if isinstance(name, str) else None
        for name in (slider.get("kind", DEFAULT), kind)
    )
    if old is None or new is None:
        return slider
    dropped = old.model_fields.keys() - new.model_fields.keys()
    return {key: value for key, value in slider.items() if key not in dropped}


def override(base: Merged, changes: Iterable[Change]) -> Merged:
    """Apply changes to tables: strings such as "contacts.delay=1ms", or tables, whose names may be
    dotted; "none", or None in tables, removes a key."""
    # All changes at once: keys set together with a new kind are not dropped.
    together: dict[str, Any] = {}
    for change in changes:
        tables_of_it = _parse_change(change) if isinstance(change, str) else undotted(change)
        together = _together(together, tables_of_it)
    return _merge_over(base, together)


def _together(first: Mapping[str, Any], second: Mapping[str, Any]) -> dict[str, Any]:
    """Combine two changes; None, which removes a key, is kept."""
    merged = _merge(first, second)
    for key, value in second.items():
        if value is None:
            merged[key] = None
        elif isinstance(value, Mapping) and isinstance(first.get(key), Mapping):
            merged[key] = _together(first[key], value)
    return merged


def _parse_change(text: str) -> dict[str, Any]:
    """The tables of a change such as "contacts.delay=1ms"."""
    key, equals, value = text.partition("=")
    key, value = key.strip(), value.strip()
    if not equals or not re.fullmatch(r"[A-Za-z_]\w*(\.[A-Za-z_]\w*)*", key):
        raise ConfigError([Problem("--set", text, "must look like contacts.delay=1ms")])
    if value == NONE:
        return undotted({key: None})
    try:
        parsed = tomllib.loads(f"value = {value}")["value"]
    except (ValueError, RecursionError):
        parsed = value
    return undotted({key: parsed})


def undotted(tables: Mapping[str, Any]) -> dict[str, Any]:
    """Tables whose names may be dotted, as nested ones."""
    nested: dict[str, Any] = {}
    for key, value in tables.items():
        *outer, last = str(key).split(".")
        one = {last: value}
        for name in reversed(outer):
            one = {name: one}
        nested = _merge(nested, one)
    return nested
