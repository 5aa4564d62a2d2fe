"""Arguments of the scripts, and their report of mistakes."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from mesoslip.errors import ConfigError, MesoslipError


def parser_of(
    description: str | None, known: Iterable[str], what: str, output: str, default: Path | None
) -> argparse.ArgumentParser:
    """A parser of the arguments of a script: the known names of its products, and its output."""
    parser = argparse.ArgumentParser(description=description)
    names = f"{what}s; all by default: {', '.join(known)}"
    parser.add_argument("names", nargs="*", metavar="NAME", help=names)
    parser.add_argument(
        "-o", dest="output", type=Path, metavar="PATH", help=output, default=default
    )
    parser.add_argument(
        "--from",
        dest="outputs",
        type=Path,
        default=Path("out"),
        metavar="DIR",
        help="folder of the outputs",
    )
    return parser


@contextmanager
def reporting_mistakes() -> Iterator[None]:
    """Report a mistake in one line, and exit: 2 for a wrong name, 1 for a missing output."""
    try:
        yield
    except MesoslipError as error:
        print(error, file=sys.stderr)
        sys.exit(2 if isinstance(error, ConfigError) else 1)
