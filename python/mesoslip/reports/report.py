"""Report on outputs."""

from __future__ import annotations

import os
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

from mesoslip.configuration.reading import PathLike, as_path
from mesoslip.output.inputs import OutputLike, opened, several
from mesoslip.reports.content import Subject
from mesoslip.reports.page import write
from mesoslip.reports.sections import takes_arrays


def report(output: OutputLike | Sequence[OutputLike], file: PathLike) -> None:
    """Write a page about an output of any command, or about several of one command side by side.

    Differences, pictures, slips or avalanches with their distributions, the energy balance, the
    configuration, and the origin of the outputs. The page is self-contained: no network, no
    scripts.

    Parameters
    ----------
    output
        The output, or several.
    file
        The page (HTML).

    Raises
    ------
    FileError
        If an output cannot be read, outputs are of different commands, or the page cannot be
        written.
    """
    path = as_path(file)
    with ExitStack() as stack:
        outputs = several(output)
        trees, names = opened(outputs, stack, takes_arrays)
        stems = [
            Path(name).stem if isinstance(one, str | os.PathLike) else name
            for name, one in zip(names, outputs, strict=True)
        ]
        numbered = [f"{name} ({number})" for number, name in enumerate(names, 1)]
        # The shortest names that differ.
        short = next(one for one in (stems, names, numbered) if len(set(one)) == len(one))
        write([Subject(*one) for one in zip(short, trees, strict=True)], path)
