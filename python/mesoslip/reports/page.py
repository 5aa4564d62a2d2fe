"""A report as one self-contained page: no network, no scripts."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.metadata import version
from importlib.resources import files
from pathlib import Path

from mesoslip.errors import FileError
from mesoslip.output.kinds import kind_of_all
from mesoslip.output.targets import written_whole
from mesoslip.reports import content
from mesoslip.reports.content import Section, Subject
from mesoslip.reports.sections import SECTIONS


def sections_of(subjects: Sequence[Subject]) -> list[Section]:
    """The sections of a report about outputs of one command.

    Raises
    ------
    FileError
        If there is no output, or they are of different commands.
    """
    if not subjects:
        raise FileError("there is no output to report on")
    kind = kind_of_all([one.tree for one in subjects], [one.name for one in subjects])
    made = (write(subjects) for write in SECTIONS[kind])
    return [one for one in made if one is not None]


def page(subjects: Sequence[Subject]) -> str:
    """The page about outputs of one command, side by side; see `sections_of`."""
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
    sections = sections_of(subjects)
    titles = dict.fromkeys(one.tree.attrs.get("title", one.name) for one in subjects)
    template = files("mesoslip.reports").joinpath("page.html").read_text("utf-8")
    return environment.from_string(template).render(
        title="; ".join(titles),
        names=[one.name for one in subjects],
        date=subjects[0].tree.attrs.get("date_created", ""),
        program=f"mesoslip {version('mesoslip')}",
        sections=sections,
    )


def write(subjects: Sequence[Subject], path: Path) -> None:
    """Write the page; the file appears only when it is complete.

    Raises
    ------
    FileError
        If the outputs are of different commands, or the page cannot be written.
    """
    text = page(subjects)
    with written_whole(path) as part:
        part.write_text(text, encoding="utf-8")
