"""The program that runs: finished work of another one is not mixed with it."""

from __future__ import annotations

from importlib.metadata import version

from mesoslip import _build

# The version that runs, not one installed later on.
_VERSION = version("mesoslip")


def program() -> str:
    """The program: its version and commit."""
    return f"mesoslip {_VERSION} {_build.COMMIT}"
