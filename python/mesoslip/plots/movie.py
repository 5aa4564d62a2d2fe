"""Movies: their frames, and the files of them."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.collections import Collection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.text import Text
from numpy.typing import NDArray
from PIL import Image

from mesoslip.array_types import Array
from mesoslip.errors import FileError
from mesoslip.output.targets import written_whole
from mesoslip.plots.style import RED

ENDINGS = (".gif", ".mp4")
MAX_FRAMES = 100
# Time for which a frame is shown [s], and dots of a frame per inch.
FRAME_SECONDS = 0.08
DPI = 120
# Share of the frames at equal intervals of time; the others follow the motion.
EVEN_SHARE = 0.3
# Maximum size of a .gif [bytes]; numbers of colours and magnifications that are tried for it.
MAX_GIF_BYTES = 3_000_000
GIF_FORMS = ((256, 1.0), (64, 1.0), (32, 1.0), (32, 0.75), (16, 0.5), (8, 0.35))
# Maximum difference of a colour from the background, in each of red, green and blue, at which it is
# drawn as that.
PALE = 8
# Frames from which the colours of a .gif are taken.
SAMPLED_FRAMES = 8


@dataclass(frozen=True)
class Movie:
    """A movie: a figure, the number of frames, and the function that changes it to show one."""

    figure: Figure
    count: int
    show: Callable[[int], None]

    def frames(
        self, progress: Callable[[float], None] | None = None
    ) -> Iterator[NDArray[np.uint8]]:
        """The frames, shape (height, width, 3)."""
        self.figure.set_dpi(DPI)
        canvas = _FrameCanvas(self.figure)
        for number in range(self.count):
            self.show(number)
            canvas.draw_frame()
            # All frames have the layout of the first.
            self.figure.set_layout_engine("none")
            frame = np.asarray(canvas.buffer_rgba())  # type: ignore[no-untyped-call]
            yield frame[..., :3].copy()
            if progress is not None:
                progress((number + 1) / self.count)


# Artists that are drawn alone; a change of any other one needs the whole figure.
SIMPLE = (Line2D, Patch, Text, Collection)


class _FrameCanvas(FigureCanvasAgg):
    """Draws changed lines, texts and colours over a background, and the whole figure if anything
    else changes."""

    def __init__(self, figure: Figure) -> None:
        super().__init__(figure)
        self._moving: list[Artist] = []
        self._background: Any = None
        self._is_first = True

    def draw_frame(self) -> None:
        """Draw the figure, as far as it has changed."""
        changed = [] if self._is_first else self._changed()
        if self._is_first or not all(isinstance(one, SIMPLE) for one in changed):
            self._is_first, self._moving, self._background = False, [], None
            self.draw()  # type: ignore[no-untyped-call]
            return
        new = [one for one in changed if one not in self._moving]
        if new or self._background is None:
            # The frames of axes lie over what moves in them.
            own = {one.axes for one in new}
            spines = [one for axes in self.figure.axes for one in axes.spines.values()]
            new += [one for one in spines if one.axes in own and one.get_visible()]
            self._moving = sorted(
                dict.fromkeys(self._moving + new), key=lambda one: one.get_zorder()
            )
            self._draw_background()
        self.restore_region(self._background)  # type: ignore[no-untyped-call]
        for one in self._moving:
            one.draw(self.get_renderer())  # type: ignore[no-untyped-call]

    def _changed(self) -> list[Artist]:
        """Visible artists that have changed since they were drawn."""
        parts = [one for axes in self.figure.axes for one in axes.get_children()]
        parts += [*self.figure.texts, *self.figure.legends]
        # New values for colours do not mark an artist as changed.
        return [
            one
            for one in parts
            if one.get_visible()
            and (one.stale or (isinstance(one, ScalarMappable) and one.get_array() is not None))
            and not (isinstance(one, Text) and not one.get_text())
        ]

    def _draw_background(self) -> None:
        """Draw what does not change."""
        for one in self._moving:
            one.set_animated(True)
        self.draw()  # type: ignore[no-untyped-call]
        self._background = self.copy_from_bbox(self.figure.bbox)  # type: ignore[no-untyped-call]
        for one in self._moving:
            one.set_animated(False)


def chosen_frames(times: Array, activity: Array, count: int = MAX_FRAMES) -> NDArray[np.intp]:
    """Indices of samples that become frames, by the motion between samples, shape (T - 1), at times
    of shape (T)."""
    if times.size <= count:
        return np.arange(times.size)
    moved = np.append(0.0, np.cumsum(activity))
    place = (times - times[0]) / (times[-1] - times[0])
    if moved[-1] > 0:
        place = EVEN_SHARE * place + (1 - EVEN_SHARE) * moved / moved[-1]
    wanted = np.linspace(0, place[-1], count)
    return np.unique(np.searchsorted(place, wanted * (1 - 1e-12)).clip(max=times.size - 1))


def time_bar(axes: Axes) -> Any:
    """A vertical line over a time axis, which moves from frame to frame."""
    return axes.axvline(0, color=RED, linewidth=1.0)


def write(movie: Movie, path: Path, progress: Callable[[float], None] | None = None) -> None:
    """Write a movie, a .gif or an .mp4; ``progress`` is called with the drawn share of frames."""
    if path.suffix.lower() == ".mp4":
        program = _ffmpeg(path)
        with written_whole(path) as part:
            _write_mp4(movie.frames(progress), part, program)
    else:
        with written_whole(path) as part:
            _write_gif(list(movie.frames(progress)), part)


def _write_gif(frames: list[NDArray[np.uint8]], path: Path) -> None:
    """Write frames of one palette, with fewer colours and pixels until the file is small enough."""
    chosen = np.unique(np.linspace(0, len(frames) - 1, SAMPLED_FRAMES).astype(int))
    sample = Image.fromarray(np.concatenate([frames[one] for one in chosen]))
    for colors, magnification in GIF_FORMS:
        palette = sample.quantize(colors, method=Image.Quantize.MAXCOVERAGE)
        # A mean of colours near it would tint the background.
        entries = np.array(palette.getpalette(), dtype=int).reshape(-1, 3)
        background = frames[0][0, 0].astype(int)
        entries[np.abs(entries - background).max(axis=1) <= PALE] = background
        palette.putpalette(entries.ravel().tolist())
        images = []
        for frame in frames:
            image = Image.fromarray(frame)
            if magnification < 1:
                size = [round(magnification * one) for one in image.size]
                image = image.resize((size[0], size[1]), Image.Resampling.LANCZOS)
            images.append(image.quantize(palette=palette, dither=Image.Dither.NONE))
        options = {"duration": round(1000 * FRAME_SECONDS), "loop": 0, "optimize": True}
        images[0].save(path, format="GIF", save_all=True, append_images=images[1:], **options)
        if path.stat().st_size <= MAX_GIF_BYTES:
            return


def _ffmpeg(path: Path) -> str:
    """The program ffmpeg, of imageio-ffmpeg or of the system."""
    try:
        import imageio_ffmpeg

        return str(imageio_ffmpeg.get_ffmpeg_exe())
    except (ImportError, RuntimeError):
        found = shutil.which("ffmpeg")
    if found is None:
        raise FileError(
            f"{path}: an .mp4 needs ffmpeg, which pip install 'mesoslip[movie]' brings; a .gif "
            "does not"
        )
    return found


def _write_mp4(frames: Iterable[NDArray[np.uint8]], path: Path, program: str) -> None:
    process = None
    for frame in frames:
        # The codec needs even sizes.
        height, width = (size - size % 2 for size in frame.shape[:2])
        if process is None:
            options = [
                *("-y", "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24"),
                *("-s", f"{width}x{height}", "-r", f"{1 / FRAME_SECONDS:g}", "-i", "-", "-an"),
                *("-c:v", "libx264", "-pix_fmt", "yuv420p", "-crf", "20"),
                *("-movflags", "+faststart", str(path)),
            ]
            process = subprocess.Popen(
                [program, *options], stdin=subprocess.PIPE, stderr=subprocess.PIPE
            )
        assert process.stdin is not None
        try:
            process.stdin.write(frame[:height, :width].tobytes())
        except BrokenPipeError:
            break
    assert process is not None
    _, errors = process.communicate()
    if process.returncode:
        text = errors.decode(errors="replace").strip() or f"ffmpeg: {process.returncode}"
        raise RuntimeError(text)
