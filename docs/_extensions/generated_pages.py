"""Pages that are made from the program: keys, commands, variables, the Fortran library."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import mesoslip
from command_reference import command_page
from configuration_reference import configuration_page
from fortran_reference import fortran_pages
from output_reference import output_page

# Folder beneath docs, which git ignores.
FOLDER = "reference/generated"
PAGES = {
    "configuration": configuration_page,
    "command-line": command_page,
    "output": output_page,
}


def write_pages(folder: Path) -> None:
    """Write the pages; those that stay as they are are left alone."""
    folder.mkdir(parents=True, exist_ok=True)
    pages = {name: page() for name, page in PAGES.items()} | fortran_pages()
    for name, text in pages.items():
        path = folder / f"{name}.md"
        if not path.exists() or path.read_text() != text:
            path.write_text(text)


# What the scripts of the gallery start from.
STARTS = ("klein", "measured/paper-k1002-v42", "measured/basalt-step")


def _on_start(app: Any) -> None:
    folder = Path(app.srcdir)
    write_pages(folder / FOLDER)
    for name in STARTS:
        start = folder / "gallery" / f"{name.rpartition('/')[2]}.toml"
        start.unlink(missing_ok=True)
        mesoslip.example(name, start)


def setup(app: Any) -> dict[str, bool]:
    """Write the pages before any is read."""
    # The gallery runs at the same event, later.
    app.connect("builder-inited", _on_start, priority=100)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
