"""Every picture that a command makes, of small runs, on one page: ``make gallery``.

    python tests/gallery/gallery.py [PART…] [-o build/gallery]

Pictures whose names have a PART in them are drawn; all by default. Outputs are kept. The page is
``index.html``; the same pictures stand on sheets, ``sheet-1.png`` and so on.
"""

import argparse
import html
import shlex
import shutil
import sys
import time
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from commands import FILES, RUNS, SOURCE
from matplotlib.figure import Figure
from mesoslip.output.files import opened
from mesoslip.plots.draw import movie_of
from mesoslip.plots.style import styled
from pictures import MOVIES, PICTURES, REPORTS
from PIL import Image, ImageDraw

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "runs" / "source"))

# Size of a picture on a sheet, with its name [pixels], and pictures of a sheet.
TILE, COLUMNS, ROWS = (800, 640), 3, 3


class Outputs:
    """Outputs in a folder, made by commands when they are asked for."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        folder.mkdir(parents=True, exist_ok=True)

    def path(self, name: str) -> Path:
        """The path of an output, which is made unless it was, by the same command."""
        if name in FILES:
            command, text = FILES[name]
            file = self.folder / f"{name}.toml"
            text = text.replace("{root}", str(ROOT))
            typed = shlex.split(command.format(folder=self.folder))
            for one in typed[1:]:
                self.path(Path(one).stem)
            _write(file, text)
            return self._made(name, [*typed, str(file)], file)
        if name in SOURCE:
            source = ROOT / "runs" / "source" / f"{name}.toml"
            changes = [one for change in SOURCE[name] for one in ("--set", change)]
            return self._made(name, ["run", str(source), *changes], source)
        command, file_name, *more = RUNS[name]
        source = ROOT / file_name.format(folder=self.folder)
        if source.suffix == ".nc":
            return self._made(name, [command, str(self.path(source.stem)), *more], None)
        return self._made(name, [command, str(source), *more], source)

    def _made(self, name: str, typed: list[str], source: Path | None) -> Path:
        path, stamp = self.folder / f"{name}.nc", self.folder / f"{name}.typed"
        text = f"{shlex.join(typed)}\n{source.read_text() if source else ''}"
        if path.exists() and stamp.exists() and stamp.read_text() == text:
            return path
        path.unlink(missing_ok=True)
        command([*typed, "-o", str(path)])
        stamp.write_text(text)
        return path


def command(arguments: list[str]) -> None:
    """Run a command of mesoslip in this process."""
    from mesoslip.command_line.main import main

    start, before = time.process_time(), sys.argv
    sys.argv = ["mesoslip", *arguments]
    try:
        main()
    except SystemExit as end:
        if end.code:
            sys.exit(f"{shlex.join(sys.argv)}: exit status {end.code}")
    finally:
        sys.argv = before
    print(f"{time.process_time() - start:6.1f} s  {shlex.join(arguments)}")


def source_figures(outputs: Outputs, parts: Iterable[str], folder: Path) -> list[Path]:
    """The source's figures, from shorter runs."""
    from figures import FIGURES, draw

    renamed = {
        "S18.curve": "curve", "S19a.onset": "onset", "S19b.onset": "onset-wide",
        "avalanche": "lattice", "bundle": "bundle",
    }  # fmt: skip
    drawn = []
    for name, one in FIGURES.items():
        if not _is_wanted(f"source-{name}", parts):
            continue
        for run in one.runs:
            made = outputs.path(renamed.get(run, run))
            if made.stem != run:
                shutil.copyfile(made, made.with_name(f"{run}.nc"))
        (path,) = draw([name], outputs.folder, folder)
        drawn.append(path.rename(path.with_name(f"source-{name}.png")))
    return drawn


def report_figures(outputs: Outputs, parts: Iterable[str], folder: Path) -> list[Path]:
    """The figures of reports, which have a few of their own."""
    drawn: list[Path] = []
    save = Figure.savefig
    for name, inputs in REPORTS.items():
        if not _is_wanted(name, parts):
            continue

        def save_too(figure: Figure, *given: Any, name: str = name, **more: Any) -> None:
            number = sum(path.stem.startswith(name) for path in drawn) + 1
            drawn.append(folder / f"{name}-{number}.png")
            save(figure, drawn[-1])
            save(figure, *given, **more)

        Figure.savefig = save_too
        try:
            files = [str(outputs.path(one)) for one in inputs]
            command(["report", *files, "-o", str(outputs.folder / f"{name}.html")])
        finally:
            Figure.savefig = save
    return drawn


def frames(outputs: Outputs, parts: Iterable[str], folder: Path) -> list[Path]:
    """A frame from the middle of each movie."""
    drawn = []
    for name, (run, view) in MOVIES.items():
        if not _is_wanted(name, parts):
            continue
        with opened(outputs.path(run)) as tree, styled():
            movie = movie_of(tree, view)
            movie.show(movie.count // 2)
            drawn.append(folder / f"{name}.png")
            movie.figure.savefig(drawn[-1])
    return drawn


def _is_wanted(name: str, parts: Iterable[str]) -> bool:
    return not parts or any(part in name for part in parts)


def _write(file: Path, text: str) -> None:
    if not file.exists() or file.read_text() != text:
        file.write_text(text)


def page(paths: list[Path], folder: Path) -> None:
    """A page of pictures, each a link to itself."""
    figures = "\n".join(
        f'<figure><a href="{name}"><img src="{name}" alt="{html.escape(path.stem)}"></a>'
        f"<figcaption>{html.escape(path.stem)}</figcaption></figure>"
        for path in paths
        if (name := path.relative_to(folder).as_posix())
    )
    style = "figure{display:inline-block;width:30%;margin:1%;vertical-align:top}img{width:100%}"
    (folder / "index.html").write_text(
        f'<!doctype html><meta charset="utf-8"><title>Pictures of mesoslip</title>'
        f"<style>{style}</style>\n{figures}\n",
        encoding="utf-8",
    )


def sheets(paths: list[Path], folder: Path) -> list[Path]:
    """Sheets with the pictures, as images."""
    for old in folder.glob("sheet-*.png"):
        old.unlink()
    made = []
    for first in range(0, len(paths), COLUMNS * ROWS):
        sheet = Image.new("RGB", (COLUMNS * TILE[0], ROWS * TILE[1]), "white")
        for place, path in enumerate(paths[first : first + COLUMNS * ROWS]):
            left, top = place % COLUMNS * TILE[0], place // COLUMNS * TILE[1]
            with Image.open(path) as picture:
                small = picture.convert("RGB")
            small.thumbnail((TILE[0] - 20, TILE[1] - 40))
            sheet.paste(small, (left, top + 24))
            ImageDraw.Draw(sheet).text((left + 4, top + 4), path.stem, fill="blue")
        made.append(folder / f"sheet-{len(made) + 1}.png")
        sheet.save(made[-1])
    return made


def main() -> None:
    parser = argparse.ArgumentParser(description="Draw every picture that a command makes.")
    parser.add_argument("parts", nargs="*", metavar="PART", help="part of the name of a picture")
    parser.add_argument("-o", dest="folder", type=Path, default=ROOT / "build" / "gallery")
    given = parser.parse_args()
    start = time.perf_counter()
    folder = given.folder.resolve()
    outputs, drawn = Outputs(folder / "outputs"), folder / "pictures"
    drawn.mkdir(exist_ok=True)
    paths = []
    for name, (inputs, options) in PICTURES.items():
        if _is_wanted(name, given.parts):
            path = drawn / f"{name}.png"
            files = [str(outputs.path(one)) for one in inputs]
            command(["plot", *files, *options, "-o", str(path)])
            paths.append(path)
    for others in (frames, report_figures, source_figures):
        paths += others(outputs, given.parts, drawn)
    page(paths, folder)
    print(*sheets(paths, folder), sep="\n")
    print(f"{folder / 'index.html'}: {len(paths)} pictures in {time.perf_counter() - start:.0f} s")


if __name__ == "__main__":
    main()
