"""How pictures look, and how they are saved."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from mesoslip.errors import FileError

STYLE: Any = {
    "font.size": 8,
    "axes.titlesize": 8,
    "axes.labelsize": 8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "legend.frameon": False,
    "legend.fontsize": 7,
    "lines.linewidth": 0.9,
    "figure.dpi": 200,
    "savefig.dpi": 200,
    "figure.constrained_layout.use": True,
}

# As in the source: the spring force in red and dashed, the contact force in black.
SPRING: dict[str, Any] = {"color": "tab:red", "linestyle": "--", "label": "spring force $F_d$"}
CONTACT: dict[str, Any] = {"color": "black", "label": "contact force $F$"}


@contextmanager
def written_whole(path: Path) -> Iterator[Path]:
    """A file to write in the place of another, whose name appears only when it is whole.

    Raises
    ------
    FileError
        If it cannot be written, or its ending names no kind of picture.
    """
    part = path.with_name(f".part.{path.name}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        yield part
        part.replace(path)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise FileError(f"{path}: cannot be written: {reason}") from error
    finally:
        part.unlink(missing_ok=True)


def save(figure: Figure, path: Path) -> None:
    """Save a figure.

    Raises
    ------
    FileError
        If it cannot be written, or its ending names no kind of picture.
    """
    with written_whole(path) as part:
        figure.savefig(part)
