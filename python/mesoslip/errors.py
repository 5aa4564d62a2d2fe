"""Errors that mesoslip raises; the command line prints them and exits with their status."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

# Characters of the longest value in a message.
MAX_SHOWN = 100


class MesoslipError(Exception):
    """Any error that mesoslip itself finds."""

    exit_status = 1

    def __str__(self) -> str:
        return "\n".join(map(printable, super().__str__().split("\n")))


def printable(text: str) -> str:
    """A text as a terminal may show it: characters that would steer it are escaped.

    So are bytes of names of files that are not text, and characters that change the direction of
    writing.
    """
    return "".join(
        one if one.isprintable() else one.encode("unicode_escape").decode() for one in text
    )


@dataclass(frozen=True)
class Problem:
    """One error in a configuration: where, what, and what would be right."""

    source: str
    key: str
    message: str
    value: object = None

    def __str__(self) -> str:
        place = ": ".join(printable(part) for part in (self.source, self.key) if part)
        if self.value is None:
            return f"{place}: {self.message}"
        return f"{place} = {shown(self.value)}: {self.message}"


def shown(value: object) -> str:
    """A value as a message shows it, shortened if it is long."""
    try:
        text = repr(value)
    # Python writes no integer of thousands of digits, and no tables in tables without end.
    except (ValueError, RecursionError):
        return f"a {type(value).__name__} that is too long to show"
    return text if len(text) <= MAX_SHOWN else f"{text[: MAX_SHOWN - 10]} ... {text[-5:]}"


class ConfigError(MesoslipError):
    """A configuration that cannot be run; ``problems`` has all its errors."""

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
