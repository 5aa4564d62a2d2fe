"""Notebooks of pages, to download: their text, and cells with their commands and Python."""

from __future__ import annotations

import json
import re
import shlex
from pathlib import Path
from typing import Any

DOCS = Path(__file__).parents[1]
# Folder beneath docs, which git ignores; pages that have a notebook, by its name.
FOLDER = "reference/generated/notebooks"
PAGES = {
    "tutorial": "tutorial.md",
    "campaigns": "campaigns.md",
    "fit": "tutorial-fit.md",
    "own-analysis": "how-to/read-an-output.md",
}
BLOCK = re.compile(r"^```(\w*)\n(.*?)^```\n", re.MULTILINE | re.DOTALL)
COMMENT = re.compile(r"^<!--.*?-->\n", re.MULTILINE | re.DOTALL)
LEFT_OUT = re.compile(r"<!-- not run: [^\n]*-->\n\Z")
FILE = re.compile(r"# ([\w/.-]+\.toml)\n")
# Programs that a cell can call.
CALLED = {"mesoslip", "head"}
# Commands that do not end by themselves.
ENDLESS = {"explore"}


def notebook(page: Path) -> dict[str, Any]:
    """A page as a notebook of format 4."""
    text = page.read_text(encoding="utf-8")
    cells: list[dict[str, Any]] = []
    place = 0
    for match in BLOCK.finditer(text):
        before, code = text[place : match.start()], _cell(*match.groups())
        if code is None or LEFT_OUT.search(before):
            continue
        cells += [_text(before), _code(code)]
        place = match.end()
    cells.append(_text(text[place:]))
    return {
        "cells": [{"id": f"cell-{i}", **one} for i, one in enumerate(cells) if one["source"]],
        "metadata": {
            "kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"},
            "language_info": {"name": "python"},
        },
        "nbformat": 4,
        "nbformat_minor": 5,
    }


def _cell(language: str, block: str) -> str | None:
    """A block as code; None if it is not meant to be run."""
    if language == "python":
        return block.rstrip()
    if language == "toml":
        named = FILE.match(block)
        return f"%%writefile {named[1]}\n{block.rstrip()}" if named else None
    if language in {"", "bash", "sh", "console"}:
        return "\n".join(_calls(block)) or None
    return None


def _calls(block: str) -> list[str]:
    """The calls of a block of a shell, each followed by the picture that it draws."""
    lines = block.replace("\\\n", " ").splitlines()
    typed = [line.removeprefix("$ ") for line in lines if line.startswith("$ ")] or lines
    calls = []
    for line in typed:
        words = shlex.split(line, comments=True)
        if not words or words[0] not in CALLED or ENDLESS & {*words[1:2]}:
            continue
        calls.append(f"!{line.partition(' #')[0].rstrip()}")
        if words[:2] == ["mesoslip", "plot"]:
            drawn = words[words.index("-o") + 1] if "-o" in words else f"{words[2][:-3]}.png"
            if drawn.endswith(".png"):
                calls.append(
                    f'from IPython.display import Image, display; display(Image("{drawn}"))'
                )
    return calls


def _code(source: str) -> dict[str, Any]:
    return {
        "cell_type": "code",
        "execution_count": None,
        "metadata": {},
        "outputs": [],
        "source": source,
    }


def _text(markdown: str) -> dict[str, Any]:
    """Text without what only the page has: comments, pictures, and links to other pages."""
    text = COMMENT.sub("", markdown)
    text = re.sub(r"!\[[^\]]*\]\([^)]*\)\n?", "", text)
    text = re.sub(r"\[([^\]]*)\]\((?!https?:)[^)]*\)", r"\1", text)
    return {"cell_type": "markdown", "metadata": {}, "source": text.strip()}


def write_notebooks(folder: Path) -> None:
    """Write all notebooks."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, page in PAGES.items():
        text = json.dumps(notebook(DOCS / page), ensure_ascii=False, indent=1)
        (folder / f"{name}.ipynb").write_text(text + "\n", encoding="utf-8")


def _with_link(_app: Any, name: str, source: list[str]) -> None:
    """Put the link below the title of a page that has a notebook."""
    for notebook_name, page in PAGES.items():
        if page == f"{name}.md":
            title, _, rest = source[0].partition("\n")
            path = f"/{FOLDER}/{notebook_name}.ipynb"
            source[0] = f"{title}\n\n{{download}}`This page as a notebook <{path}>`\n{rest}"


def _on_start(app: Any) -> None:
    write_notebooks(Path(app.srcdir) / FOLDER)


def setup(app: Any) -> dict[str, bool]:
    """Write the notebooks before any page is read."""
    app.connect("builder-inited", _on_start)
    app.connect("source-read", _with_link)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
