"""Errors that mesoslip raises; the command line prints them and exits with their status."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass


class MesoslipError(Exception):
    """Anything that mesoslip itself finds wrong."""

    exit_status = 1


@dataclass(frozen=True)
class Problem:
    """One thing that is wrong in a configuration: where, what, and what would be right."""

    source: str
    key: str
    message: str
    value: object = None

    def __str__(self) -> str:
        place = ": ".join(part for part in (self.source, self.key) if part)
        if self.value is None:
            return f"{place}: {self.message}"
        return f"{place} = {self.value!r}: {self.message}"


class ConfigError(MesoslipError):
    """A configuration that cannot be run; ``problems`` holds everything that is wrong with it."""

    exit_status = 2

    def __init__(self, problems: Sequence[Problem]) -> None:
        self.problems = tuple(problems)
        super().__init__("\n".join(str(problem) for problem in problems))


class FileError(MesoslipError):
    """A file that cannot be read or written."""

    exit_status = 2


class WriteError(FileError):
    """A file that the system failed to write, such as on a full disk."""

    exit_status = 1


class RunError(MesoslipError):
    """A run that failed."""
