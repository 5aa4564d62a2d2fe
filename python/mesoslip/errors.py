"""Exceptions of mesoslip; the command line prints them and exits with their status."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import PurePath
from typing import Self

# Maximum number of characters of a value in messages.
MAX_SHOWN = 100


class MesoslipError(Exception):
    """Base class of all errors of mesoslip."""

    exit_status = 1

    def __str__(self) -> str:
        return "\n".join(map(printable, super().__str__().split("\n")))


def printable(text: str) -> str:
    """A text that is safe on a terminal: control characters, undecodable bytes of file names, and
    characters that change the direction of writing are escaped."""
    return "".join(
        one if one.isprintable() else one.encode("unicode_escape").decode() for one in text
    )


@dataclass(frozen=True)
class Problem:
    """One error of a configuration: source, key, value, and the fix."""

    source: str
    key: str
    message: str
    value: object = None

    def __str__(self) -> str:
        where = ": ".join(printable(part) for part in (self.source, self.key) if part)
        if self.value is None:
            return f"{where}: {self.message}"
        return f"{where} = {shown(self.value)}: {self.message}"


def shown(value: object) -> str:
    """A value as a message shows it, shortened if it is long; a path as it is written."""
    try:
        text = str(value) if isinstance(value, PurePath) else repr(value)
    # Python refuses integers of thousands of digits and tables nested without end.
    except (ValueError, RecursionError):
        return f"a {type(value).__name__} that is too long to show"
    return text if len(text) <= MAX_SHOWN else f"{text[: MAX_SHOWN - 10]} ... {text[-5:]}"


class ConfigError(MesoslipError):
    """A wrong configuration; ``problems`` has all its errors."""

    exit_status = 2

    def __init__(self, problems: Sequence[Problem]) -> None:
        self.problems = tuple(problems)
        super().__init__("\n".join(str(problem) for problem in problems))

    @classmethod
    def of(cls, key: str, message: str, value: object = None) -> Self:
        """The error of one key, in no file."""
        return cls([Problem("", key, message, value)])


class FileError(MesoslipError):
    """A file that cannot be read or written."""

    exit_status = 2


class WriteError(FileError):
    """A file that could not be written, as on a full disk."""

    exit_status = 1


class RunError(MesoslipError):
    """A run that failed."""


class NoMemoryError(RunError):
    """A run that failed for lack of memory, and would not with more."""
