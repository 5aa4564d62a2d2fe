"""Reports on outputs: self-contained pages, without network or scripts."""

from __future__ import annotations

import os
from collections.abc import Sequence
from contextlib import ExitStack
from importlib.metadata import version
from importlib.resources import files
from pathlib import Path

from mesoslip.configuration.reading import PathLike, as_path
from mesoslip.errors import FileError
from mesoslip.output.inputs import OutputLike, opened, several
from mesoslip.output.kinds import kind_of_all
from mesoslip.output.targets import written_whole
from mesoslip.reports import content
from mesoslip.reports.content import Section, Subject
from mesoslip.reports.sections import SECTIONS, takes_arrays


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

    Examples
    --------
    >>> import mesoslip
    >>> path, *_ = mesoslip.example("klein")  # writes klein.toml
    >>> tree = mesoslip.run(mesoslip.Config.load(path, ["contacts.count=200", "run.duration=3 s"]))
    >>> mesoslip.report(tree, "klein.html")
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
        text = _page([Subject(*one) for one in zip(short, trees, strict=True)])
        with written_whole(path) as part:
            part.write_text(text, encoding="utf-8")


def _sections(subjects: Sequence[Subject]) -> list[Section]:
    """The sections of a page about outputs of one command."""
    if not subjects:
        raise FileError("there is no output to report on")
    kind = kind_of_all([one.tree for one in subjects], [one.name for one in subjects])
    made = (write(subjects) for write in SECTIONS[kind])
    return [one for one in made if one is not None]


def _page(subjects: Sequence[Subject]) -> str:
    from jinja2 import Environment, StrictUndefined

    environment = Environment(
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=StrictUndefined,
    )
    # The template asks for the type of a block.
    environment.tests |= {
        kind.__name__.lower(): lambda block, kind=kind: isinstance(block, kind)
        for kind in (content.Text, content.Table, content.Picture, content.Source)
    }
    sections = _sections(subjects)
    titles = dict.fromkeys(one.tree.attrs.get("title", one.name) for one in subjects)
    template = files("mesoslip.reports").joinpath("page.html").read_text("utf-8")
    return environment.from_string(template).render(
        title="; ".join(titles),
        names=[one.name for one in subjects],
        date=subjects[0].tree.attrs.get("date_created", ""),
        program=f"mesoslip {version('mesoslip')}",
        sections=sections,
    )
