"""Packages that some formats of files need."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from mesoslip.errors import FileError


def needed(module: str, kind: str, package: str) -> Any:
    """A module, or a message that names the package to install."""
    try:
        return import_module(module)
    except ImportError:
        raise FileError(
            f"is {kind}, which needs {package}: pip install 'mesoslip[files]', or export the "
            "measurement as text"
        ) from None
