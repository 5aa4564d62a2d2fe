"""The moving avalanche of the front page, drawn by the program."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import mesoslip
from PIL import Image, ImageSequence

RUN = Path(__file__).parents[2] / "runs" / "avalanche.toml"
PICTURE = "_static/avalanche.gif"
WIDTH = 520
COLOURS = 32


def draw_avalanche(path: Path) -> None:
    """Simulate the avalanche, and draw it small enough for a page."""
    mesoslip.plot(mesoslip.run(RUN), path)
    with Image.open(path) as picture:
        size = (WIDTH, round(WIDTH * picture.height / picture.width))
        frames = [
            frame.convert("RGB").resize(size).quantize(COLOURS)
            for frame in ImageSequence.Iterator(picture)
        ]
        duration = picture.info.get("duration", 80)
    frames[0].save(path, save_all=True, append_images=frames[1:], duration=duration, loop=0)


def _on_start(app: Any) -> None:
    path = Path(app.srcdir) / PICTURE
    if not path.exists():
        draw_avalanche(path)


def setup(app: Any) -> dict[str, bool]:
    """Draw it before any page is read, unless it is there."""
    app.connect("builder-inited", _on_start)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
