"""The runs that come with the program, to start from."""

from __future__ import annotations

import difflib
import tomllib
from importlib.resources import files
from pathlib import Path

from mesoslip.errors import ConfigError, FileError, Problem

ENDING = ".toml"


def _folder() -> Path:
    """Where the runs are installed; they are those of the repository."""
    return Path(str(files("mesoslip") / "runs"))


def examples() -> dict[str, str]:
    """Titles of the runs that come with the program, by name.

    A run without a title has the first line of its comment.
    """
    found = {}
    folder = _folder()
    for path in sorted(folder.rglob(f"*{ENDING}")):
        text = path.read_text(encoding="utf-8")
        first = text.partition("\n")[0].lstrip("# ").rstrip()
        title = tomllib.loads(text).get("title", first)
        found[path.relative_to(folder).with_suffix("").as_posix()] = str(title)
    return found


def example(name: str, file: Path) -> list[Path]:
    """Write a run that comes with the program, and beside it what it is based on.

    Parameters
    ----------
    name
        One of `examples`.
    file
        Where to write it.

    Returns
    -------
    list of pathlib.Path
        The files that were written; what it is based on is not if it is there already.

    Raises
    ------
    ConfigError
        If there is no such run.
    FileError
        If there is a file of the name already, or it cannot be written.
    """
    known = examples()
    if name not in known:
        near = difflib.get_close_matches(name, known, 3, 0.6)
        told = "no such example; " + (
            f"did you mean {' or '.join(near)}?" if near else "mesoslip example lists them"
        )
        raise ConfigError([Problem("", "example", told, name)])
    if file.exists():
        raise FileError(f"{file}: is there already; give another name with -o, or remove it")
    written = []
    path: Path | None = _folder() / f"{name}{ENDING}"
    while path is not None:
        text = path.read_text(encoding="utf-8")
        base = tomllib.loads(text).get("base")
        if base is not None:
            # What it is based on stands beside it, wherever it stands here.
            text = text.replace(f'"{base}"', f'"{Path(base).name}"', 1)
        try:
            file.parent.mkdir(parents=True, exist_ok=True)
            # Never over a file of somebody, not even one that has come meanwhile.
            with file.open("x", encoding="utf-8") as stream:
                stream.write(text)
        except (OSError, ValueError) as error:
            reason = getattr(error, "strerror", None) or error
            raise FileError(f"{file}: cannot be written: {reason}") from error
        written.append(file)
        path = None if base is None else path.parent / base
        if path is not None:
            file = file.with_name(path.name)
            path = None if file.exists() else path
    return written
