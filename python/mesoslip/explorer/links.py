"""Links: the setting of a page as the query of its address.

``?run=klein&contacts.delay=1+ms`` is a ready run with changes. A configuration of one's own is in
the link as a whole, as compressed TOML.
"""

from __future__ import annotations

import binascii
import shlex
import zlib
from base64 import urlsafe_b64decode, urlsafe_b64encode
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import NamedTuple
from urllib.parse import urlencode

from mesoslip.configuration.config import Config
from mesoslip.errors import FileError
from mesoslip.examples import example_config, examples
from mesoslip.explorer.controls import BY_KEY, CONTROLS

RUN, FILE = "run", "toml"
# Keys that a link may change: those of the controls, and those that come with their choices.
KEYS = {
    *BY_KEY,
    *(key for one in CONTROLS for keys in one.required.values() for key in keys),
}
# Maximum length of a link, which mail programs and servers accept, and of its file [characters].
MAX_LINK, MAX_FILE = 6000, 200_000
# Source of a configuration that came with a link.
SHARED = "shared.toml"


class Setting(NamedTuple):
    """A configuration to start from, the words of a command that give it (a file, perhaps with
    changes), and the text of each key that was changed."""

    start: Config
    source: str
    changes: Mapping[str, str]


@cache
def presets() -> dict[str, str]:
    """Titles, by name, of the ready runs that the page can show: those whose slider has a knob."""
    kinds = BY_KEY["slider.kind"].choices
    return {
        name: title
        for name, title in examples().items()
        if "/" not in name and example_config(name).slider.kind in kinds
    }


def stem_of(source: str) -> str:
    """The name of the file of a source."""
    return Path(shlex.split(source)[0]).stem


def link_of(setting: Setting) -> str:
    """The query of a setting, with its question mark."""
    name = stem_of(setting.source)
    is_ready = name in examples() and example_config(name) == setting.start
    start = {RUN: name} if is_ready else {FILE: _packed(setting.start.to_toml())}
    return "?" + urlencode({**start, **setting.changes}, safe="/:[]{},")


def setting_of(query: Sequence[tuple[str, str]], home: Setting) -> Setting:
    """The setting of a query; without a run and a file it is the one at home with changes."""
    start, source, changes = home.start, home.source, {}
    for key, text in query:
        if key == RUN:
            if text not in examples():
                raise FileError(f"there is no ready run “{text}”")
            start, source = example_config(text), f"{text}.toml"
        elif key == FILE:
            start, source = Config.from_toml(_unpacked(text)), SHARED
        elif key in KEYS:
            changes[key] = text
        else:
            raise FileError(f"“{key}” is no key that a link may change")
    return Setting(start, source, changes)


def _packed(text: str) -> str:
    return urlsafe_b64encode(zlib.compress(text.encode(), 9)).decode().rstrip("=")


def _unpacked(packed: str) -> str:
    try:
        unpack = zlib.decompressobj()
        text = unpack.decompress(urlsafe_b64decode(packed + "=" * (-len(packed) % 4)), MAX_FILE)
        if not unpack.eof:
            raise FileError("its file is cut off, or too long")
        return text.decode()
    except (binascii.Error, zlib.error, UnicodeDecodeError, ValueError) as error:
        raise FileError("its file is damaged") from error
