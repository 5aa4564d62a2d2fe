"""Name of the running program, so that finished work of another version is not mixed with it."""

from __future__ import annotations

from importlib.metadata import version

from mesoslip import _build

# The running version: another one may be installed later.
_VERSION = version("mesoslip")


def program() -> str:
    """Version and commit of the program."""
    return f"mesoslip {_VERSION} {_build.COMMIT}"
