"""Example configurations, installed with the package."""

from __future__ import annotations

import difflib
import tomllib
from importlib.resources import files
from pathlib import Path

from mesoslip.configuration.config import Config
from mesoslip.configuration.reading import PathLike, as_path, is_file
from mesoslip.errors import ConfigError, FileError

ENDING = ".toml"


def _folder() -> Path:
    """The folder of the installed examples; in a development build that of the sources."""
    installed = Path(str(files("mesoslip") / "runs"))
    return installed if installed.is_dir() else Path(__file__).parents[2] / "runs"


def examples() -> dict[str, str]:
    """Titles of the examples by name; the first line of the file if it has no title."""
    found = {}
    folder = _folder()
    for path in sorted(folder.rglob(f"*{ENDING}")):
        text = path.read_text(encoding="utf-8")
        first = text.partition("\n")[0].lstrip("# ").rstrip()
        title = tomllib.loads(text).get("title", first)
        found[path.relative_to(folder).with_suffix("").as_posix()] = str(title)
    return found


def example_config(name: str) -> Config:
    """The configuration of an example."""
    return Config.load(_folder() / f"{name}{ENDING}")


def example(name: str, file: PathLike | None = None) -> list[Path]:
    """Write an example configuration, and the files that it needs.

    Parameters
    ----------
    name
        One of `examples`, such as "klein".
    file
        The file to write; ``NAME.toml`` in the current folder by default.

    Returns
    -------
    list of pathlib.Path
        The files that were written: the example, and in its folder the files that it is based on
        and the data of a measurement, unless they exist.

    Raises
    ------
    ConfigError
        If there is no such example.
    FileError
        If the file exists, or cannot be written.

    Examples
    --------
    >>> import mesoslip
    >>> [path.name for path in mesoslip.example("sweeps/delay-stiffness")]
    ['delay-stiffness.toml', 'klein.toml']
    """
    known = examples()
    if not isinstance(name, str) or name not in known:
        near = difflib.get_close_matches(str(name), known, 3, 0.6)
        message = "no such example; " + (
            f"did you mean {' or '.join(near)}?" if near else "mesoslip example lists them"
        )
        raise ConfigError.of("example", message, name)
    target = as_path(file or f"{Path(name).name}{ENDING}")
    if is_file(target):
        raise FileError(f"{target}: exists already; give another name with -o, or remove it")
    written = []
    source: Path | None = _folder() / f"{name}{ENDING}"
    while source is not None:
        text = source.read_text(encoding="utf-8")
        tables = tomllib.loads(text)
        base = tables.get("base")
        if base is not None:
            # The base is written to the same folder.
            text = text.replace(f'"{base}"', f'"{Path(base).name}"', 1)
        _write_new(target, text.encode())
        written.append(target)
        for data in sorted(source.parent.glob(f"{source.stem}.*")):
            beside = target.with_name(data.name)
            if data.suffix != ENDING and not is_file(beside):
                _write_new(beside, data.read_bytes())
                written.append(beside)
        source = None if base is None else source.parent / base
        if source is not None:
            target = target.with_name(source.name)
            source = None if is_file(target) else source
    return written


def _write_new(path: Path, contents: bytes) -> None:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        # Mode x: a file of that name may have been made in the meantime.
        with path.open("xb") as stream:
            try:
                stream.write(contents)
                stream.flush()
            except OSError:
                path.unlink()
                raise
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise FileError(f"{path}: cannot be written: {reason}") from error
