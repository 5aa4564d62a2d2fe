"""Text files that users name."""

from __future__ import annotations

import os
import stat
from pathlib import Path
from typing import TypeAlias

from mesoslip.errors import FileError, shown

PathLike: TypeAlias = str | os.PathLike[str]

# Maximum size of a file [bytes]; a million stages take less.
MAX_BYTES = 2**26


def as_path(path: PathLike) -> Path:
    """The path of a file; raises a `FileError` for other objects."""
    if not isinstance(path, str | os.PathLike):
        raise FileError(f"{shown(path)}: is not the path of a file")
    return Path(path)


def is_file(path: Path) -> bool:
    """Whether there is a regular file; false for names that the system refuses."""
    return stat.S_ISREG(_mode(path))


def is_directory(path: Path) -> bool:
    """Whether there is a directory; false for names that the system refuses."""
    return stat.S_ISDIR(_mode(path))


def _mode(path: Path) -> int:
    """Type and permissions of a file; 0 if there is no file."""
    try:
        return path.stat().st_mode
    except (OSError, ValueError):
        return 0


def text_of(path: Path, kind: str, max_bytes: int = MAX_BYTES) -> str:
    """Text of a regular file; errors name its kind, such as "a configuration file"."""
    try:
        state = path.stat()
        if stat.S_ISDIR(state.st_mode):
            raise FileError(f"{path}: is a directory, not {kind}")
        if not stat.S_ISREG(state.st_mode):
            raise FileError(f"{path}: is not a regular file")
        if state.st_size > max_bytes:
            raise FileError(
                f"{path}: {state.st_size / 2**20:.0f} MiB is too large for {kind}; "
                f"the maximum is {max_bytes / 2**20:.0f} MiB"
            )
        # Editors of Windows begin a text with a mark.
        return path.read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        # The folder is that of the configuration, or the present one for a name in --set.
        beside = "" if path.is_absolute() else f" in {Path.cwd()}"
        raise FileError(f"{path}: no such file{beside}") from None
    except OSError as error:
        raise FileError(f"{path}: cannot be read: {error.strerror}") from None
    except UnicodeDecodeError as error:
        raise FileError(f"{path}: is not {kind} (text in UTF-8): {error.reason}") from None
    except ValueError as error:
        raise FileError(f"{shown(path)}: is not the name of a file: {error}") from None
