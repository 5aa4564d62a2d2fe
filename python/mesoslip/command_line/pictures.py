"""``mesoslip plot``, and what its views show."""

from __future__ import annotations

import ast
import math
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import typer
from typer.core import TyperCommand, TyperOption

from mesoslip.array_packages import hidden
from mesoslip.command_line.options import (
    OutputsArgument,
    RevolutionOption,
    option,
    output_option,
    revolution_of,
    time_of,
)
from mesoslip.command_line.progress import progress_shown
from mesoslip.command_line.quick_matplotlib import import_matplotlib

FOLDER = Path(__file__).parents[1] / "plots" / "views"
# How a view begins in its file.
START = "\nVIEW = View("


class Summary(NamedTuple):
    """Name, kind and summary of a view."""

    name: str
    kind: str
    summary: str


def summaries() -> list[Summary]:
    """Those of all views, in the order of their files."""
    found = []
    for path in sorted(FOLDER.glob("*.py")):
        _, start, rest = path.read_text(encoding="utf-8").partition(START)
        if start:
            call = ast.parse(start + rest).body[0].value  # type: ignore[attr-defined]
            values = {one.arg: one.value for one in call.keywords}
            found.append(Summary(*(ast.literal_eval(values[one]) for one in Summary._fields)))
    return found


def summary_of_views() -> str:
    """The views of each kind of output that has several, with what they show; read from files,
    since importing them takes a second."""
    from mesoslip.output.kinds import KINDS

    kinds, views = [], summaries()
    for kind, (description, _) in KINDS.items():
        # The default view first.
        names = {one.name for one in views if one.kind == kind}
        texts = [
            f"{name} ({'; '.join(one.summary for one in views if one.name == name)})"
            for name in sorted(names, key=lambda name: (name != kind, name))
        ]
        if kind == "sweep":
            kinds.append(f"Of {description}: the name of a measure.")
        elif len(names) > 1:
            kinds.append(f"Of {description}: {', '.join(texts)}.")
    return " ".join(kinds)


# Endings of pictures and movies.
MOVIES = (".gif", ".mp4")
FORMATS = (".png", ".pdf", ".svg", ".eps", ".ps", ".jpg", ".tif", ".webp", *MOVIES)
VIEW_HELP = "What to draw; each kind of output has a default"


class PlotCommand(TyperCommand):
    """The command, whose help lists the views."""

    def complete_help(self) -> None:
        """Add the views to the help of ``--view``."""
        for one in self.params:
            if isinstance(one, TyperOption) and one.name == "view":
                one.help = f"{VIEW_HELP}. {summary_of_views()}"

    def format_help(self, ctx: Any, formatter: Any) -> None:
        self.complete_help()
        super().format_help(ctx, formatter)


class Against(StrEnum):
    """Abscissa of the picture of a run."""

    TIME = "time"
    DISPLACEMENT = "displacement"
    DRIVE = "drive"


def plot(
    outputs: OutputsArgument,
    figure: Annotated[
        Path | None,
        output_option("Picture, beside the first output by default; .gif, .mp4: a movie", "FIG"),
    ] = None,
    view: Annotated[str | None, option(VIEW_HELP, "VIEW")] = None,
    snapshot: Annotated[
        int | None,
        option(
            "Snapshot of the lattice; by default the one after the largest avalanche",
            "NUMBER",
            min=0,
        ),
    ] = None,
    realization: Annotated[
        int | None,
        option(
            "Realization of a run; by default the first one, in front of the others",
            "NUMBER",
            min=0,
        ),
    ] = None,
    start: Annotated[str | None, option("Time, such as '2 s'", "TIME", "--from")] = None,
    end: Annotated[str | None, option("Time, such as '2.5 s'", "TIME", "--to")] = None,
    x: Annotated[
        Against | None,
        typer.Option(
            "--x", help="Abscissa: time, or the displacement of the slider or of the drive"
        ),
    ] = None,
    period: RevolutionOption = None,
    file_format: Annotated[
        str | None,
        option(
            "Format, such as png, pdf, svg or eps; by default that of the ending of FIG",
            "FORMAT",
            "--format",
        ),
    ] = None,
    width: Annotated[
        str | None,
        option(
            "Width in print, such as '8.6 cm', or a column of a journal with its size of the "
            "font: aps-1, aps-2, elsevier-1, elsevier-1.5, elsevier-2, nature-1, nature-2",
            "LENGTH",
        ),
    ] = None,
    font_size: Annotated[
        float | None,
        option("Size of the font in points; by default that of the journal, or 8", "PT"),
    ] = None,
    title: Annotated[
        str | None,
        option("Title instead of those of the outputs; '' for none, as above a caption", "TEXT"),
    ] = None,
    letters: Annotated[
        bool, typer.Option("--letters", help="Letter the panels (a), (b), and so on")
    ] = False,
    style: Annotated[
        Path | None,
        option("Style file of matplotlib (.mplstyle), on top of that of mesoslip", "FILE"),
    ] = None,
) -> None:
    """Draw an output, or several in one picture."""
    from mesoslip.configuration.reading import is_file
    from mesoslip.output import targets

    import_matplotlib()
    from mesoslip.plots import plot as plots
    from mesoslip.plots.printing import JOURNALS, width_of

    first = outputs[0]
    path = _path(figure, first, file_format)
    there = [one for one in outputs if is_file(one)]
    if there:
        targets.check_writable(path, there)
    # A picture is drawn at once.
    is_quick = path.suffix.lower() not in MOVIES
    with hidden(), progress_shown(is_quick, "drawing") as progress:
        plots.plot(
            outputs,
            path,
            view=view,
            snapshot=snapshot,
            realization=realization,
            x=None if x is None else x.value,
            start=-math.inf if start is None else time_of(start, "--from"),
            end=math.inf if end is None else time_of(end, "--to"),
            period=revolution_of(period),
            width=width if width is None or width in JOURNALS else width_of(width, "--width"),
            font_size=font_size,
            title=title,
            letters=letters,
            style=style,
            progress=progress,
        )
    typer.echo(str(path), err=True)


def _path(picture: Path | None, output: Path, file_format: str | None) -> Path:
    """The file of a picture in a format, .png by default; by default it is beside the output."""
    from mesoslip.errors import ConfigError

    ending = f".{(file_format or 'png').lower().removeprefix('.')}"
    if picture is None:
        return output.parent / f"{output.stem or 'output'}{ending}"
    if file_format is None or picture.suffix.lower() == ending:
        return picture
    if picture.suffix.lower() in FORMATS:
        raise ConfigError.of("--format", f"is not the format of {picture.name}", file_format)
    return picture.with_name(f"{picture.name}{ending}")
