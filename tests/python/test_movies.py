"""Movies: their frames, what they show, their files, and what a run without them is told."""

import dataclasses
import sys

import mesoslip
import numpy as np
import pytest
import xarray as xr
from conftest import ROOT, long
from mesoslip.plots import movie as movies
from mesoslip.plots.draw import movie_of
from mesoslip.plots.style import styled
from mesoslip.plots.views.contacts import breaking, thresholds
from PIL import Image

KLEIN = ROOT / "runs" / "klein.toml"
COMMON = ("run.duration=1.95 s", "contacts.count=120", "contacts.threshold.relative_width=0.1")


def with_few_snapshots(tree):
    """Every sixth snapshot of an output, as a frame takes long to draw."""
    few = tree["snapshots"].to_dataset().isel(snapshot=slice(None, None, 6))
    return xr.DataTree.from_dict({"/": tree.to_dataset(), "snapshots": few})


@pytest.fixture(scope="module")
def ensemble():
    """Contacts without interaction, with sites and snapshots through the first slip."""
    times = [1.0, 1.1, *np.arange(1.4, 1.9, 0.01).tolist()]
    return mesoslip.run(
        mesoslip.Config.load(
            KLEIN,
            [
                *COMMON,
                "interaction={strength = 0, lattice = 'square', columns = 12, rows = 10}",
                f"output.snapshots={times}",
            ],
        )
    )


@pytest.fixture(scope="module")
def free(ensemble):
    """The same without sites."""
    config = mesoslip.Config.from_toml(ensemble.attrs["configuration"])
    return mesoslip.run(config.replace({"interaction": None}))


@pytest.fixture(scope="module")
def few_snapshots(ensemble):
    """The same run with fewer of them."""
    return with_few_snapshots(ensemble)


@pytest.fixture(scope="module")
def layered():
    changes = ["slider.kind=layered", "slider.layers=4", "output.layers=true"]
    return mesoslip.run(mesoslip.Config.load(KLEIN, [*COMMON, *changes]))


def test_frames_are_where_the_motion_is():
    times = np.linspace(0, 10, 10001)
    activity = np.where((times[1:] > 4) & (times[1:] < 4.1), 1.0, 1e-6)
    chosen = movies.chosen_frames(times, activity, 100)
    assert chosen.size <= 100
    assert chosen[0] == 0
    assert chosen[-1] == 10000
    in_slip = (times[chosen] > 4) & (times[chosen] < 4.1)
    # 70 % follow the motion; equal intervals would give one frame.
    assert 60 <= np.count_nonzero(in_slip) <= 75
    np.testing.assert_array_equal(movies.chosen_frames(times[:50], activity[:49]), np.arange(50))


def test_what_breaks_is_what_the_run_counted(ensemble):
    """Contacts that do not stretch with the slider, as the run counts breaks; all by thresholds."""
    data = ensemble["snapshots"].to_dataset()
    widths = ensemble["snapshots/stretch"].sizes
    assert (widths["row"], widths["column"]) == (10, 12)
    first, second = data.isel(snapshot=0), data.isel(snapshot=1)
    pinned = np.isfinite(second["stretch"].values.ravel())
    assert pinned.all()
    assert not breaking(first, second).any()
    limits = thresholds(ensemble, first)
    # Scaled coupling: x_s is proportional to the root of the threshold.
    mean = 18e-6 / 2000
    assert np.mean(limits) == pytest.approx(mean, rel=0.01)
    assert np.std(limits) / mean == pytest.approx(0.05, rel=0.3)
    # While few have broken each breaks once: those that reach their thresholds.
    stretch = data["stretch"].values.reshape(data.sizes["snapshot"], -1)
    moved = np.diff(data["displacement"].values)
    index = next(n for n in range(1, len(stretch)) if breaking(*map_pair(data, n)).any())
    broke = breaking(*map_pair(data, index))
    reaches = stretch[index] + moved[index] >= thresholds(ensemble, data.isel(snapshot=index))
    assert reaches.any()
    assert broke[reaches].all()


def map_pair(data, index):
    return data.isel(snapshot=index), data.isel(snapshot=index + 1)


@pytest.mark.parametrize("view", ["contacts", "lattice"])
def test_a_movie_of_snapshots(few_snapshots, tmp_path, view):
    path = tmp_path / f"{view}.gif"
    mesoslip.plot(few_snapshots, path, view=view)
    with Image.open(path) as film:
        assert film.n_frames == few_snapshots["snapshots"].sizes["snapshot"] > 5
    assert path.stat().st_size < movies.MAX_GIF_BYTES


def test_snapshots_need_no_sites(ensemble, free, tmp_path):
    """The same contacts by their numbers, and the same movie."""
    assert free["snapshots/stretch"].dims == ("snapshot", "contact")
    assert free["spring_force"].identical(ensemble["spring_force"])
    for name in ("stretch", "load", "pinned"):
        sites = ensemble[f"snapshots/{name}"].stack(contact=("row", "column")).values
        np.testing.assert_allclose(free[f"snapshots/{name}"].values, sites, rtol=1e-12)
    path = tmp_path / "free.gif"
    few = with_few_snapshots(free)
    mesoslip.plot(few, path)
    with Image.open(path) as film:
        assert film.n_frames == few["snapshots"].sizes["snapshot"]


def test_the_load_of_ageing_contacts_is_that_of_the_moment():
    """All contacts attached at the start; thresholds grow as the logarithm of the time since."""
    times = [0.2, 0.4, 0.8, 1.6]
    changes = [
        *COMMON,
        "slider.kind=prescribed",
        "drive.velocity=1 nm/s",
        "contacts.coupling=equal",
        "contacts.ageing={law = 'log', time = '0.1 s', growth = 0.2, initial_age = '0 s'}",
        f"output.snapshots={times}",
    ]
    tree = mesoslip.run(mesoslip.Config.load(KLEIN, changes))
    data = tree["snapshots"].to_dataset()
    limits = (data["stretch"] / data["load"]).values
    grown = 1 + 0.2 * np.log1p(np.array(times) / 0.1)
    np.testing.assert_allclose(limits / limits[0], np.outer(grown / grown[0], np.ones(120)))


@pytest.mark.parametrize("view", ["lattice", *map(long, ["contacts", "layers"])])
def test_what_changes_in_a_frame_is_drawn_as_in_the_whole_figure(
    few_snapshots, layered, view, monkeypatch
):
    """To the pixel, with the frames of axes over it."""
    tree = layered if view == "layers" else few_snapshots

    def frames():
        with styled():
            return list(dataclasses.replace(movie_of(tree, view), count=6).frames())

    parts = frames()
    monkeypatch.setattr(movies._FrameCanvas, "draw_frame", lambda canvas: canvas.draw())
    whole = frames()
    assert len(parts) == len(whole) > 2
    assert any((one != parts[0]).any() for one in parts)
    np.testing.assert_array_equal(parts, whole)


def test_axes_of_a_movie_stay(layered):
    with styled():
        film = movie_of(layered, "layers")
        limits, bars = [], []
        for number in (0, film.count // 2, film.count - 1):
            film.show(number)
            film.figure.draw_without_rendering()
            limits.append([(one.get_xlim(), one.get_ylim()) for one in film.figure.axes])
            bars.append(film.figure.axes[-1].lines[-1].get_xdata()[0])
    assert limits[0] == limits[1] == limits[2]
    assert bars[0] < bars[1] < bars[2]
    assert film.count <= movies.MAX_FRAMES


def test_the_background_of_a_gif_is_that_of_the_picture(few_snapshots, tmp_path):
    """Not a mean with the pale edges of lines."""
    mesoslip.plot(few_snapshots, tmp_path / "a.gif", view="contacts")
    with Image.open(tmp_path / "a.gif") as image:
        for number in range(image.n_frames):
            image.seek(number)
            assert image.convert("RGB").getpixel((1, 1)) == (255, 255, 255)


def test_a_large_gif_has_fewer_colours(tmp_path, monkeypatch):
    frames = [np.random.default_rng(n).integers(0, 255, (60, 60, 3)).astype("u1") for n in range(3)]
    path = tmp_path / "noise.gif"
    movies._write_gif(frames, path)
    monkeypatch.setattr(movies, "MAX_GIF_BYTES", path.stat().st_size // 4)
    movies._write_gif(frames, path)
    assert path.stat().st_size <= movies.MAX_GIF_BYTES


def test_an_mp4_is_written_by_ffmpeg(few_snapshots, tmp_path):
    pytest.importorskip("imageio_ffmpeg")
    path = tmp_path / "contacts.mp4"
    mesoslip.plot(few_snapshots, path, view="contacts")
    assert path.read_bytes()[4:8] == b"ftyp"


def test_without_ffmpeg_the_extra_is_named(ensemble, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    monkeypatch.setattr(movies.shutil, "which", lambda _: None)
    with pytest.raises(mesoslip.FileError, match=r"pip install 'mesoslip\[movie\]'"):
        mesoslip.plot(ensemble, tmp_path / "a.mp4", view="contacts")


def test_what_a_movie_needs_is_said(layered, free, tmp_path):
    path = tmp_path / "a.gif"
    plain = mesoslip.run(mesoslip.Config.load(KLEIN, ["run.duration=0.1 s", "contacts.count=50"]))
    with pytest.raises(mesoslip.FileError, match=r"output.snapshots(.|\n)*output.layers = true"):
        mesoslip.plot(plain, path)
    with pytest.raises(mesoslip.FileError, match=r"output.snapshots"):
        mesoslip.plot(plain, path, view="contacts")
    with pytest.raises(mesoslip.FileError, match=r"have no sites, which \[interaction\].*contacts"):
        mesoslip.plot(free, path, view="lattice")
    with pytest.raises(mesoslip.FileError, match=r"'run' has no movie; .*layers"):
        mesoslip.plot(layered, path, view="run")
    with pytest.raises(mesoslip.FileError, match="a movie is of one output"):
        mesoslip.plot([layered, layered], path)
    assert not path.exists()
