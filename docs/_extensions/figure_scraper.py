"""Pictures of the gallery that are no windows: figures that a block of a script comes to."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from matplotlib.figure import Figure
from sphinx_gallery.scrapers import figure_rst


def figure_of_block(_block: Any, variables: dict[str, Any], gallery: dict[str, Any]) -> str:
    """Save what the last expression of a block gave, if that is a figure; the markup of it."""
    # Where sphinx-gallery keeps what the last expression gave, to show it as text otherwise.
    names = variables["example_globals"]
    figure = names.get("___")
    if not isinstance(figure, Figure):
        return ""
    names["___"] = None
    path = Path(next(variables["image_path_iterator"]))
    figure.savefig(path)
    return str(figure_rst([str(path)], gallery["src_dir"]))
