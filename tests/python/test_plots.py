"""Pictures: what they show, what they read, and how they are had without files."""

import re
import threading

import matplotlib as mpl
import mesoslip
import numpy as np
import pytest
import xarray as xr
from commands import FILES, RUNS, SOURCE
from conftest import ROOT, klein_tables, long
from kinds import configuration
from matplotlib.figure import Figure
from mesoslip.analysis.response.line import Line
from mesoslip.command_line.pictures import summaries
from mesoslip.configuration.config import Config
from mesoslip.output import files
from mesoslip.output.arrays import Stored
from mesoslip.output.kinds import KINDS as OUTPUTS
from mesoslip.output.writing import write, write_results
from mesoslip.plots import extent as extents
from mesoslip.plots.axis import logarithmic
from mesoslip.plots.extent import MAX_PARTS, Extent
from mesoslip.plots.key_names import changes_in_a_line
from mesoslip.plots.printing import JOURNALS
from mesoslip.plots.style import curve_style, styled
from mesoslip.plots.sweep_panels import CHOICE_COLORS
from mesoslip.plots.views import VIEWS, names_of_views
from mesoslip.plots.views.layers import layer_motion
from mesoslip.plots.views.response import _slope
from mesoslip.simulation.run_realizations import run_realizations
from pictures import MOVIES, PICTURES

pytestmark = pytest.mark.usefixtures("few_replicas")


@pytest.fixture(scope="module")
def old():
    """An output with a lattice, avalanches and snapshots."""
    return mesoslip.open_output(ROOT / "tests" / "reference" / "old.nc")


@pytest.mark.parametrize("view", [None, "run", "avalanches", "lattice"])
def test_a_picture_needs_no_file(old, view):
    drawn = mesoslip.plot(old, view=view)
    assert isinstance(drawn, Figure)
    assert drawn.axes
    assert isinstance(mesoslip.plot(ROOT / "tests" / "reference" / "old.nc", view=view), Figure)


@pytest.mark.parametrize("view", [None, "avalanches", "lattice"])
def test_a_picture_is_drawn_into_what_is_given(old, view):
    whole = Figure(figsize=(8, 4))
    left, right = whole.subfigures(1, 2)
    assert mesoslip.plot(old, view=view, figure=left) is left
    axes = right.subplots()
    before = len(right.axes)
    mesoslip.plot(old, view=view, ax=axes)
    assert axes.has_data()
    # A colour bar is all that may come beside it.
    assert len(right.axes) - before == (view == "lattice")


@pytest.mark.parametrize("width", [None, "8.6 cm"])
def test_a_lattice_has_no_empty_space_beside_it(old, width):
    figure = mesoslip.plot(old, view="lattice", width=width)
    figure.draw_without_rendering()
    for axes in figure.axes[: len(figure.axes) // 2]:
        room, drawn = axes.get_position(original=True), axes.get_position()
        assert drawn.width * drawn.height > 0.8 * room.width * room.height


@pytest.fixture(scope="module")
def short():
    """A short run of few contacts."""
    return mesoslip.run(klein_tables(contacts__count=10, run__duration=0.1))


def test_outputs_whose_clocks_do_not_overlap_are_compared_from_their_starts(short):
    late = short.copy()
    late["time"] = short["time"] + 60.0
    force = mesoslip.plot([short, late]).axes[0]
    early, moved = (one.get_xdata() for one in force.lines)
    assert np.allclose(early, moved, atol=1e-9)
    assert force.get_xlim()[1] == pytest.approx(early[-1])
    late["time"] = short["time"] + 0.05
    early, moved = (one.get_xdata() for one in mesoslip.plot([short, late]).axes[0].lines)
    assert np.allclose(moved - early, moved[0] - early[0])
    assert moved[0] > early[0]


@pytest.mark.parametrize("rows", [400, 40_000])
def test_a_line_has_the_gaps_of_a_record(tmp_path, rows):
    """Not where the sampling rate changes."""
    time = np.concatenate([np.arange(rows), 3 * rows + 20.0 * np.arange(rows)])
    force = 2 + 0.1 * np.random.default_rng(1).standard_normal(time.size)
    table = np.transpose([time, force])
    np.savetxt(tmp_path / "a.csv", table, header="time [s],force [N]", delimiter=",", comments="")
    figure = mesoslip.plot(mesoslip.read_trace(tmp_path / "a.csv"))
    assert figure.axes[0].get_ylabel() == "force (N)"
    line = max(figure.axes[0].lines, key=lambda one: len(one.get_xdata()))
    assert np.count_nonzero(np.isnan(line.get_ydata())) == 1


def test_contacts_that_never_wait_have_no_panel(short):
    assert len(mesoslip.plot(short).axes) == 3
    at_once = klein_tables(contacts__count=10, contacts__delay=0.0, run__duration=0.1)
    names = [one.get_ylabel() for one in mesoslip.plot(mesoslip.run(at_once)).axes]
    assert [name.split(" (")[0] for name in names] == ["spring force", "velocity"]


def test_a_slope_without_noise_has_no_error():
    shown = [_slope(Line(-0.095226765, error, 1.2, 0.0, 0), 1.0) for error in (4.8e-8, 2e-4)]
    assert shown == ["-0.09523", "-0.09523 ± 0.00020"]


@pytest.fixture(scope="module")
def theory():
    """The force curve and the onset of slip of Klein's case."""
    config = mesoslip.Config.from_dict(klein_tables())
    return {"curve": mesoslip.curve(config), "onset": mesoslip.onset(config)}


def test_pictures_of_the_theory(theory):
    for tree in theory.values():
        axes = Figure().subplots()
        mesoslip.plot(tree, ax=axes)
        assert axes.lines
        assert isinstance(mesoslip.plot(tree), Figure)


@pytest.mark.usefixtures("quick_pictures")
def test_a_title_that_no_font_has_is_drawn_without_warnings(old, command, tmp_path):
    tree = old.copy()
    tree.attrs["title"] = "\u65e5\u672c \U0001f600"
    write(tree, tmp_path / "old.nc")
    path = tmp_path / "old.png"
    status, _, printed = command("plot", tmp_path / "old.nc", "-o", path)
    assert (status, printed) == (0, f"{path}\n")


def test_an_unknown_view_is_an_error(old):
    with pytest.raises(mesoslip.ConfigError, match=r"foo.*choose from run, avalanches, "):
        mesoslip.plot(old, view="foo")


def test_help_of_views_is_read_from_their_files():
    stated = {(one.name, one.kind, one.summary) for one in VIEWS}
    assert {tuple(one) for one in summaries()} == stated
    assert [one.kind for one in VIEWS if "measure" in one.options] == ["sweep"]


def test_views_are_complete():
    """A view that lacks its kind or half of a comparison, and a kind without a default view."""
    assert set(OUTPUTS) == {view.kind for view in VIEWS}
    for kind in OUTPUTS:
        assert names_of_views(kind)[0] == kind
    options = {"realization", "start, end", "x", "snapshot", "measure", "period"}
    for view in VIEWS:
        assert view.options <= options, view.name
        assert view.compare_all is None or view.compare_panel is not None, view.name
        assert view.summary, view.name


def test_the_gallery_has_every_view():
    """``make gallery`` draws each view, each movie and each figure of the source."""
    drawn = {options[1] for _, options in PICTURES.values() if options[:1] == ("--view",)}
    commands = {RUNS[name][0] for name in RUNS} | {one.split()[0] for one, _ in FILES.values()}
    assert {one.name for one in VIEWS if one.name not in OUTPUTS} <= drawn
    of_kinds = {"branches": "cycle", "steady": "curve", "rates": "response"}
    assert {of_kinds.get(kind, kind) for kind in OUTPUTS} <= commands
    known = RUNS.keys() | FILES.keys()
    assert {one for inputs, _ in PICTURES.values() for one in inputs} <= known
    assert {name for _, name in MOVIES.values()} == {one.name for one in VIEWS if one.movie}
    assert {f"{one}.toml" for one in SOURCE} <= {
        path.name for path in (ROOT / "runs/source").glob("*.toml")
    }


CONFIGURATIONS = ("configuration", "base_configuration")
PART = {"x": "drive", "end": 0.09}
NAMES_OF_RUNS = ["several", "layered", "quasistatic", "no slip", "me", "two samples"]


@pytest.mark.parametrize(
    ("name", "options"),
    [
        (name, {}) if even else long(name, {})
        for even, name in zip([1, 0] * 3, NAMES_OF_RUNS, strict=True)
    ]
    + [
        long(name, PART) if even else (name, PART)
        for even, name in zip([1, 0] * 3, NAMES_OF_RUNS, strict=True)
    ],
)
def test_the_picture_of_a_file_is_that_of_its_tree(runs, name, options, tmp_path, monkeypatch):
    """A file is read without xarray where the view needs no more."""
    write(runs[name], tmp_path / "run.nc")
    wanted = mesoslip.plot(runs[name], **options)
    monkeypatch.setattr(files, "_tree", None)
    drawn = mesoslip.plot(tmp_path / "run.nc", **options)
    for axes, twin in zip(drawn.axes, wanted.axes, strict=True):
        assert axes.get_title(loc="left") == twin.get_title(loc="left")
        assert axes.get_xlabel() == twin.get_xlabel()
        for line, other in zip(axes.lines, twin.lines, strict=True):
            np.testing.assert_array_equal(line.get_xydata(), other.get_xydata())
            assert line.get_label() == other.get_label()


def test_views_of_one_name_are_for_different_outputs(runs):
    """Every output has exactly one view of a name."""
    for name, tree in runs.items():
        assert sum(view.name == "run" and view.applies(tree) for view in VIEWS) == 1, name


def many_samples(count, realizations=1):
    """An output with many samples, as far as it is drawn: a wave with one spike."""
    times = np.linspace(0, 10, count)
    force = np.sin(3 * times) * np.ones((realizations, 1))
    force[0, count // 3] = 7.0
    return xr.DataTree(
        xr.Dataset(
            {
                "spring_force": (("realization", "time"), force),
                "displacement": (("realization", "time"), np.sqrt(times) * np.ones_like(force)),
            },
            coords={"time": times, "realization": np.arange(realizations)},
        )
    )


@pytest.mark.parametrize("block", [2**20, 997])
@pytest.mark.parametrize("against", [long("time"), "displacement"])
def test_a_line_shows_the_extremes_of_many_samples(monkeypatch, block, against):
    """Far fewer points than samples, all of them samples, none of the spikes lost."""
    monkeypatch.setattr(extents, "BLOCK", block)
    tree = many_samples(200_000)
    extent = Extent(against=against)
    x, y = extents.line(tree, (extent.horizontal[0], "spring_force"), extent, (0.0, 10.0))
    assert len(x) <= 5 * MAX_PARTS + 2 * 200_000 / block
    along, force = tree[extent.horizontal[0]].values.ravel(), tree["spring_force"].values[0]
    assert y.max() == force.max()
    assert set(zip(x, y, strict=True)) <= set(zip(along, force, strict=True))
    # Of the samples in each part of the time, which here are as many, the least and the greatest.
    for part in (0, 17, MAX_PARTS // 3, MAX_PARTS - 1):
        inside = slice(part * 50, (part + 1) * 50)
        near = (x >= along[inside].min()) & (x <= along[inside].max())
        assert y[near].min() <= force[inside].min()
        assert y[near].max() >= force[inside].max()
    # A window with few samples shows each.
    _, values = extents.line(tree, ("time", "spring_force"), extent, (1.0, 1.1))
    times = tree["time"].values
    np.testing.assert_array_equal(values, force[(times >= 1.0) & (times <= 1.1)])


def test_what_is_not_drawn_is_not_read():
    """A variable that no picture needs is not touched, and a window only where it lies."""
    tree = many_samples(100_000)
    read = []

    class Watched(xr.backends.BackendArray):
        shape, dtype = (1, 100_000), np.dtype(float)

        def __getitem__(self, key):
            read.append(key)
            return np.zeros(self.shape)[key.tuple]

    data = tree.to_dataset()
    lazy = xr.core.indexing.LazilyIndexedArray(Watched())
    data["spring_force"] = xr.Variable(("realization", "time"), lazy)
    data["velocity"] = xr.Variable(("realization", "time"), lazy)
    extents.line(xr.DataTree(data), ("time", "spring_force"), Extent(), (2.0, 2.1))
    assert len(read) == 1
    places = np.arange(100_000)[read[0].tuple[-1]]
    assert len(places) < 1100


def test_pictures_on_threads_leave_the_style_of_the_session(old):
    before = dict(mpl.rcParams)
    errors = []

    def draw():
        try:
            for _ in range(2):
                mesoslip.plot(old)
        except Exception as error:
            errors.append(error)

    threads = [threading.Thread(target=draw) for _ in range(3)]
    for one in threads:
        one.start()
    for one in threads:
        one.join()
    assert not errors
    assert dict(mpl.rcParams) == before


@pytest.fixture(scope="module")
def runs():
    """Short runs with slips, by what is special about them."""
    klein = ROOT / "runs" / "klein.toml"
    changes = {
        "plain": [],
        "slow": ["contacts.delay=2 ms"],
        "several": ["run.realizations=3"],
        "layered": ["slider.kind=layered", "slider.layers=4", "output.layers=true"],
        "sliding": ["slider.kind=prescribed"],
        "quasistatic": ["slider.kind=quasistatic"],
        "no avalanche": ["slider.kind=quasistatic", "run.duration=0.1 s"],
        "no slip": ["run.duration=0.1 s"],
        "few": ["contacts.count=20", "contacts.threshold.relative_width=0.3"],
        "me": ["run.engine=me"],
        "two samples": ["run.duration=0.1 s", "output.interval=0.1 s"],
    }
    common = ["run.duration=2.2 s", "contacts.count=200", "output.interval=2 ms"]
    trees = {}
    for name, own in changes.items():
        config = mesoslip.Config.load(klein, ["title=Costs $5 or $6", *common])
        trees[name] = mesoslip.run(config.replace(*own) if own else config)
    trees["macroscopic"] = mesoslip.run(
        {
            "run": {"duration": "1 h"},
            "drive": {"velocity": "-1 mm/s"},
            "slider": {"mass": "2 t", "stiffness": "20 kN/m", "damping_ratio": 0.5},
            "contacts": {
                **{"count": 100, "static_force": "50 kN", "stiffness": "9 MN/m"},
                **{"delay": "1 s", "threshold": {"law": "weibull", "relative_width": 0.5}},
            },
            "output": {"interval": "1 s"},
        }
    )
    return trees


NAMES = [
    *("plain", "slow", "several", "layered", "sliding", "quasistatic", "no avalanche"),
    *("no slip", "few", "me", "two samples", "macroscopic"),
]


# Runs that are drawn against something else than by default; make fuzz draws all of them so.
# Those whose panels others have as well.
LIKE_OTHERS = {"slow", "sliding", "no avalanche", "few", "no slip", "two samples", "me", "several"}
SEEN = {("plain", "displacement"), ("layered", "drive")}


def overlapping(figure):
    """Pairs of axes of a figure, with their labels, titles and legends, that cover each other."""
    figure.draw_without_rendering()
    boxes = [axes.get_tightbbox() for axes in figure.axes]
    width, height = figure.bbox.width, figure.bbox.height
    outside = [
        box
        for box in boxes
        if box.x0 < -2 or box.y0 < -2 or box.x1 > width + 2 or box.y1 > height + 2
    ]
    pairs = [
        (one, other)
        for number, one in enumerate(boxes)
        for other in boxes[number + 1 :]
        if min(one.x1, other.x1) - max(one.x0, other.x0) > 2
        and min(one.y1, other.y1) - max(one.y0, other.y0) > 2
    ]
    return outside + pairs


@pytest.mark.parametrize(
    ("name", "x"),
    [long(name, None) if name in LIKE_OTHERS else (name, None) for name in NAMES]
    + [
        (name, x) if (name, x) in SEEN else long(name, x)
        for name in NAMES
        for x in ("displacement", "drive", "time")
    ],
)
def test_nothing_covers_anything_else(runs, name, x):
    """Whatever the run, no panel, label or legend reaches into another one or out of the figure."""
    assert overlapping(mesoslip.plot(runs[name], x=x)) == []


@pytest.mark.parametrize("limits", [(102.5, 109.9), (1.02, 1.09), (1.3, 9.0), (0.5, 30.0)])
def test_logarithmic_axes_have_labels_over_any_range(limits):
    """Over a few per cent too, where no multiple of a power of ten lies."""
    axes = Figure().subplots()
    logarithmic(axes, "x")
    axes.set_xlim(*limits)
    places = np.asarray(axes.get_xticks())
    assert np.count_nonzero((places >= limits[0]) & (places <= limits[1])) >= 3


def test_a_title_is_no_formula(runs):
    figure = mesoslip.plot(runs["plain"])
    assert figure.axes[0].get_title("left").startswith(r"Costs \$5 or \$6")
    figure.draw_without_rendering()


def test_units_suit_the_data(runs):
    labels = [axes.get_ylabel() for axes in mesoslip.plot(runs["macroscopic"]).axes]
    assert "spring force (kN)" in labels
    for name, unit in (("plain", "µN"), ("no slip", "nN")):
        axes = mesoslip.plot(runs[name]).axes[0]
        assert axes.get_ylabel() == f"spring force ({unit})"
    drawn = mesoslip.plot(runs["no slip"]).axes[0].lines[0].get_ydata()
    np.testing.assert_allclose(drawn, runs["no slip"]["spring_force"].values[0] * 1e9)
    assert mesoslip.plot(runs["macroscopic"]).axes[0].lines[0].get_xdata().max() == pytest.approx(
        60
    )


def test_a_title_has_the_changes_if_they_fit_into_a_line(runs):
    """In symbols and words; of a list, and of a run's length and record, there are none."""
    title = mesoslip.plot(runs["slow"]).axes[0].get_title("left").splitlines()
    assert title == [r"Costs \$5 or \$6", r"delay $\tau_d$ = 2 ms (was 500 µs)"]
    # Of another kind what is set, neither its defaults nor what is gone.
    elastic = mesoslip.plot(runs["layered"]).axes[0].get_title("left").splitlines()[1]
    assert elastic == "layered slider (was rigid), $N_l$ = 4"
    config, base = (Config.from_toml(runs["me"].attrs[one]) for one in CONFIGURATIONS)
    assert changes_in_a_line(config, base, 80) == r"$N\to\infty$ (was 200 contacts)"
    stages = config.replace("drive.stage=[{duration=1, velocity=1e-7}, {duration=1, velocity=0}]")
    assert "stage" not in changes_in_a_line(stages, base, 500)
    # Where they do not fit, a title of its own is enough; without one, the first stand for all.
    few = config.replace("slider.mass=1 g", "slider.damping_ratio=0.5")
    assert changes_in_a_line(few, base, 50) == r"$N\to\infty$ (was 200 contacts), 2 more changes"
    assert changes_in_a_line(few.replace("title=Own"), base, 50) == ""


def test_engines_are_told_apart_in_words(runs):
    figure = mesoslip.plot([runs["plain"], runs["me"]])
    texts = [text.get_text() for text in figure.legends[0].get_texts()]
    assert texts == ["200 contacts", r"$N\to\infty$"]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"start": "0.5 m"}, "start = '0.5 m': .*expected a quantity such as '1.9 s'"),
        ({"end": 10**400}, "end = .*: must be a quantity such as '2 s', or a number in s"),
        ({"start": 1.0, "end": 0.5}, "1 s is not before 0.5 s"),
        ({"realization": 0.5}, "realization = 0.5: must be a whole number"),
        ({"snapshot": "1"}, "snapshot = '1': must be a whole number"),
        ({"x": ["time"]}, r"x = \['time'\]: must be a text"),
        ({"figure": 3.5}, "figure = 3.5: must be a figure of matplotlib"),
        ({"ax": "left"}, "ax = 'left': must be axes of matplotlib"),
    ],
)
def test_options_of_wrong_types_are_refused(runs, options, message):
    with pytest.raises(mesoslip.ConfigError, match=message):
        mesoslip.plot(runs["several"], **options)


def test_a_realization_and_a_window_are_what_is_drawn(runs):
    tree = runs["several"]
    (line,) = mesoslip.plot(tree, realization=2, start=0.5, end=0.6).axes[0].lines
    times = tree["time"].values
    inside = (times >= 0.5) & (times <= 0.6)
    np.testing.assert_allclose(line.get_xdata(), times[inside] * 1e3)
    np.testing.assert_allclose(line.get_ydata(), tree["spring_force"].values[2, inside] * 1e6)
    behind = mesoslip.plot(tree).axes[0].lines
    assert len(behind) == 3
    # Against the displacement.
    (line,) = mesoslip.plot(tree, realization=1, end=0.05, x="displacement").axes[0].lines
    inside = times <= 0.05
    np.testing.assert_allclose(line.get_xdata(), tree["displacement"].values[1, inside] * 1e12)


def test_several_outputs_say_how_they_differ(runs):
    figure = mesoslip.plot([runs["plain"], runs["slow"]])
    texts = [text.get_text() for text in figure.legends[0].get_texts()]
    assert texts == [r"delay $\tau_d$ = 500 µs", r"delay $\tau_d$ = 2 ms"]
    first, second = figure.axes[0].lines
    for line, name in ((first, "plain"), (second, "slow")):
        parts = runs[name]["spring_force"], runs[name]["slip_traces/spring_force"]
        top = max(one.values.max() for one in parts)
        assert line.get_ydata().max() == pytest.approx(top * 1e6)
    assert overlapping(figure) == []
    # Those that do not differ are reported apart by their names.
    figure = mesoslip.plot([runs["plain"], runs["plain"]])
    assert len(figure.legends[0].get_texts()) == 2
    axes = Figure().subplots()
    mesoslip.plot([runs["plain"], runs["slow"]], ax=axes)
    assert len(axes.get_legend().get_texts()) == 2


@pytest.mark.parametrize(
    ("given", "options", "printed"),
    [
        (["several"], {"realization": 3}, "no realization 3; the last one is 2"),
        (["plain"], {"start": 3.0}, "from 3 s on: the run goes from 0 s to 2.2 s"),
        (["plain"], {"start": 2.0, "end": 1.0}, "2 s is not before 1 s"),
        (["plain"], {"x": "force"}, "choose from time, displacement, drive"),
        (["plain"], {"view": "layers"}, "output.layers = true"),
        (["plain", "slow"], {"view": "lattice"}, "'lattice' shows one output at a time"),
        (["plain"], {"snapshot": 1}, "snapshot: no option of the view 'run'"),
        (["layered"], {"view": "layers", "x": "drive"}, "x: no option of the view 'layers'"),
        (["plain", "slow"], {"view": "avalanches"}, "has no avalanches"),
        ([], {}, "no output"),
    ],
)
def test_what_cannot_be_drawn_is_reported(runs, given, options, printed):
    with pytest.raises(mesoslip.MesoslipError, match=printed):
        mesoslip.plot([runs[name] for name in given], **options)


def test_outputs_of_different_commands_are_not_drawn_together(runs, theory):
    with pytest.raises(mesoslip.FileError, match=r"is a run.* is a force curve"):
        mesoslip.plot([runs["plain"], theory["curve"]])


def test_what_is_of_no_known_command_is_reported(runs):
    other = xr.DataTree(xr.Dataset(attrs={"configuration": runs["plain"].attrs["configuration"]}))
    with pytest.raises(mesoslip.FileError, match="neither a run"):
        mesoslip.plot(other)


def test_waves_are_the_velocities_of_the_layers(runs):
    tree = runs["layered"]
    times, velocity = layer_motion(tree, Extent(), (1.9, 2.0))
    data = tree["layer_displacement"].isel(realization=0).sel(time=slice(1.9, 2.0))
    moved = np.sum(velocity * np.diff(times)[:, None], axis=0)
    np.testing.assert_allclose(moved, (data[-1] - data[0]).values, rtol=1e-10)
    figure = mesoslip.plot(tree, view="layers")
    assert overlapping(figure) == []
    assert figure.axes[0].get_ylabel() == "layer, 1 at the contacts"


def test_curves_have_dimensions_and_their_instability(theory):
    tree = theory["curve"]
    figure = mesoslip.plot(tree)
    axes = figure.axes[0]
    assert axes.get_ylabel() == "force $F$ (µN)"
    assert figure.axes[1].get_xlabel() == "displacement $X$ (nm)"
    marks = [line for line in axes.lines if line.get_marker() == "o"]
    assert marks[0].get_xdata()[0] == pytest.approx(tree.attrs["X_c"] * 1e9)
    texts = [text.get_text() for text in axes.get_legend().get_texts()]
    assert f"instability at $X_c$ = {tree.attrs['X_c'] * 1e9:.4g} nm" in texts
    assert overlapping(figure) == []


def test_onsets_have_dimensions_or_the_reason_why_there_is_none(klein, theory):
    tree = theory["onset"]
    axes = mesoslip.plot(tree).axes[0]
    melting = tree["melting"].to_dataset()
    line = next(one for one in axes.lines if "S47" in str(one.get_label()))
    static = klein().contacts.static_force
    least = melting["relative_force_drop"].values.min() * static * 1e6
    assert line.get_ydata().min() == pytest.approx(least)
    assert axes.get_xlabel().endswith("(ms)")
    # Sequential breaking ends early, and is enlarged.
    (inset,) = axes.child_axes
    assert 0.5 < inset.lines[0].get_xdata()[-1] / inset.get_xlim()[1] < 1
    assert 0.5 < inset.lines[0].get_ydata()[-1] / inset.get_ylim()[0] < 1
    # Of a damaged file: nothing to enlarge.
    still = tree.copy()
    for name in still.children:
        still[name] = tree[name].to_dataset().map(np.zeros_like, keep_attrs=True)
    mesoslip.plot(still)
    for name in list(still.children):
        still[f"{name}_unknown"] = still[name].copy()
        del still[name]
    mesoslip.plot(still)
    none = mesoslip.plot(mesoslip.onset(klein(slider__stiffness=1e6)))
    assert "there is no onset" in none.axes[0].texts[0].get_text()
    # A curve and an onset have neither realizations nor times.
    with pytest.raises(mesoslip.ConfigError, match=r"realization: no option .* onset of slip"):
        mesoslip.plot(tree, realization=1)
    with pytest.raises(mesoslip.FileError, match="is an onset of slip: it has no view 'lattice'"):
        mesoslip.plot(tree, view="lattice")


@pytest.mark.parametrize("kind", [long("rigid, lattice"), "quasistatic, lattice"])
def test_avalanches_of_several_outputs(kind):
    trees = [mesoslip.run(configuration(kind, run__seed=seed)) for seed in (1, 2)]
    figure = mesoslip.plot(trees, view="avalanches")
    assert len(figure.legends[0].get_texts()) == 2
    assert overlapping(figure) == []


def test_the_command_takes_windows_with_units(tmp_path, command):
    output = tmp_path / "run.nc"
    printed = command(
        *("run", ROOT / "runs" / "klein.toml", "-o", output, "--quiet"),
        *("--set", "run.duration=0.1 s", "--set", "contacts.count=100"),
    )
    assert printed[0] == 0
    picture = tmp_path / "picture.svg"
    window = ("--from", "10 ms", "--to", "0.05 s", "--x", "drive", "--realization", "0")
    assert command("plot", output, output, "-o", picture, *window)[0] == 0
    assert "displacement of the drive (nm)" in picture.read_text()
    errors = command.refusal("plot", output, "-o", picture, "--from", "1 m")
    assert "--from" in errors
    errors = command.refusal("plot", output, "-o", picture, "--from", "1 s", "--to", "2 s")
    assert "the run goes from 0 s to 0.1 s" in errors


def luminance(color):
    """CIE lightness of a colour, 0 to 100."""
    linear = [
        one / 12.92 if one <= 0.04045 else ((one + 0.055) / 1.055) ** 2.4
        for one in mpl.colors.to_rgb(color)
    ]
    return 116 * np.cbrt(np.dot([0.2126, 0.7152, 0.0722], linear)) - 16


def test_curves_survive_print_in_grey():
    """Four colours that differ in lightness, then the same with dashes."""
    with styled():
        styles = [curve_style(number) for number in range(8)]
    for four in (styles[:4], styles[4:]):
        grey = np.sort([max(luminance(one["color"]), 0) for one in four])
        assert np.diff(grey).min() > 19
    assert len({(one["color"], one["linestyle"]) for one in styles}) == 8
    regimes = np.sort([luminance(one) for one in CHOICE_COLORS[:4]])
    assert np.diff(regimes).min() > 11


@pytest.mark.parametrize(
    "name",
    ["several", *map(long, ["macroscopic", "layered", "plain", "quasistatic"])],
)
def test_nothing_collides_in_a_column_of_a_journal(runs, name):
    figure = mesoslip.plot(runs[name], width=0.086, font_size=8, letters=True)
    assert figure.get_figwidth() * 25.4 == pytest.approx(86)
    assert figure.get_figheight() <= 1.5 * figure.get_figwidth() + 1e-9
    assert overlapping(figure) == []


@pytest.mark.parametrize(("journal", "width", "size"), [("aps-1", 86, 8), long("nature-2", 183, 7)])
def test_a_journal_has_its_width_and_font(runs, journal, width, size):
    figure = mesoslip.plot(runs["no slip"], width=journal)
    assert figure.get_figwidth() * 25.4 == pytest.approx(width)
    assert figure.axes[0].xaxis.label.get_fontsize() == size
    assert mesoslip.plot(runs["no slip"], width=journal, font_size=6).axes[0].title.get_size() == 6
    with pytest.raises(mesoslip.ConfigError, match=r"width = 'prl': .* journal: aps-1, "):
        mesoslip.plot(runs["no slip"], width="prl")


def test_the_help_has_all_journals(command):
    _, printed, _ = command("plot", "--help")
    words = re.findall(r"[a-z]+-[0-9.]+[0-9]|[a-z]+-[0-9]", printed)
    assert set(JOURNALS) <= set(words)


def test_the_colours_of_a_lattice_are_those_of_its_loads(old):
    """In tenths of the threshold: none of them is for loads that no contact has."""
    drawn = mesoslip.plot(old, view="lattice").axes[0].collections[0]
    loads = drawn.get_array().compressed()
    assert drawn.norm.vmin == pytest.approx(loads.min(), abs=0.1)
    assert drawn.norm.vmax == pytest.approx(loads.max(), abs=0.1)
    assert drawn.norm.vmin <= loads.min() < loads.max() <= drawn.norm.vmax


def test_a_legend_leaves_the_width_to_the_curves(runs):
    figure = mesoslip.plot(runs["layered"], view="layers", width=0.086, font_size=8)
    figure.draw_without_rendering()
    assert all(axes.get_position().width > 0.5 for axes in figure.axes[:2])


@pytest.mark.usefixtures("quick_pictures")
def test_fonts_are_embedded_as_truetype(runs, tmp_path):
    for ending, wanted, refused in (
        ("pdf", b"/FontFile2", b"/Type3"),
        ("eps", b"/FontType 42", b"/FontType 3 "),
    ):
        path = tmp_path / f"run.{ending}"
        # Not even a style may ask for fonts of Type 3.
        style = tmp_path / "own.mplstyle"
        style.write_text("pdf.fonttype: 3\nps.fonttype: 3\npdf.compression: 0\n")
        mesoslip.plot(runs["two samples"], path, style=style)
        assert wanted in path.read_bytes()
        assert refused not in path.read_bytes()


def test_titles_letters_and_styles(runs, tmp_path):
    figure = mesoslip.plot(runs["several"], title="Mine for $5", letters=True)
    assert figure.get_suptitle() == r"Mine for \$5"
    assert figure.axes[0].get_title(loc="left").startswith("black: realization 0")
    letters = [axes.texts[-1].get_text() for axes in figure.axes]
    assert letters == [f"({one})" for one in "abcdef"]
    assert overlapping(figure) == []
    assert not mesoslip.plot(runs["plain"], title="").axes[0].get_title(loc="left")
    path = tmp_path / "own.mplstyle"
    path.write_text("font.size: 11\naxes.prop_cycle: cycler('color', ['123456', '654321'])\n")
    figure = mesoslip.plot([runs["plain"], runs["slow"]], style=path)
    assert [one.get_color() for one in figure.axes[0].lines] == ["#123456", "#654321"]
    assert figure.axes[0].xaxis.label.get_fontsize() == 11
    figure = mesoslip.plot(runs["plain"], style=path, font_size=6)
    assert figure.axes[0].yaxis.label.get_fontsize() == 6
    for text, message in (
        ("font.height: 8\n", "no style of matplotlib: Bad key font.height"),
        ("font.size: large-ish\n", "no style of matplotlib: .*large-ish"),
        ("font.size 8\n", "no style of matplotlib: Missing colon"),
    ):
        path.write_text(text)
        with pytest.raises(mesoslip.FileError, match=message):
            mesoslip.plot(runs["plain"], style=path)
    with pytest.raises(mesoslip.FileError, match=r"none.mplstyle: cannot be read"):
        mesoslip.plot(runs["plain"], style=tmp_path / "none.mplstyle")
    for options in ({"width": 8.6}, {"font_size": 0}, {"width": 0.08, "figure": Figure()}):
        with pytest.raises(mesoslip.ConfigError, match=next(iter(options))):
            mesoslip.plot(runs["plain"], **options)


@pytest.mark.usefixtures("quick_pictures")
def test_the_command_prints(runs, tmp_path, command):
    output = tmp_path / "run.v1.nc"
    write(runs["plain"], output)
    status, _, printed = command("plot", output, "--width", "8.6 cm", "--format", "pdf")
    assert (status, printed) == (0, f"{tmp_path / 'run.v1.pdf'}\n")
    size = re.search(rb"/MediaBox \[ 0 0 ([0-9.]+) ", (tmp_path / "run.v1.pdf").read_bytes())
    assert float(size[1]) == pytest.approx(8.6 / 2.54 * 72)
    assert command("plot", output, "-o", tmp_path / "a", "--format", "svg")[0] == 0
    assert (tmp_path / "a.svg").exists()
    errors = command.refusal("plot", output, "-o", tmp_path / "a.png", "--format", "pdf")
    assert "--format" in errors
    for width in ("elsevier-1", "0.086"):
        assert command("plot", output, "--width", width, "-o", tmp_path / "b.svg")[0] == 0
    errors = command.refusal("plot", output, "--width", "3 N")
    assert "aps-1, aps-2" in errors


def test_a_slip_without_finer_samples_is_drawn_as_recorded(runs):
    """Lines where samples resolve the motion; else dots, the ends of the slip, and the key."""
    for interval, resolves_motion in (("0.5 ms", True), ("4 ms", False)):
        config = ROOT / "runs" / "klein.toml"
        tree = mesoslip.run(
            mesoslip.Config.load(
                config,
                [
                    *("run.duration=2.2 s", "contacts.count=200"),
                    *(f"output.interval={interval}", "output.slip_interval=0"),
                ],
            )
        )
        force, velocity, detached = mesoslip.plot(tree).axes[1::2]
        contact, spring, *recorded = force.lines
        assert contact.get_linestyle() == detached.lines[0].get_linestyle() == "None"
        assert (spring.get_linestyle() == "--") == resolves_motion
        assert (velocity.lines[0].get_linestyle() == "-") == resolves_motion
        assert "output.slip_interval" in force.get_legend().get_title().get_text()
        assert bool(recorded) != resolves_motion
        if recorded:
            slip = mesoslip.slips(tree).isel(slip=0)
            ends = [slip[one].item() * 1e6 for one in ("force_before", "force_after")]
            np.testing.assert_allclose(recorded[0].get_ydata(), ends)
            peak = velocity.lines[1].get_ydata()
            np.testing.assert_allclose(peak, slip["peak_velocity"].item() * 1e6)
    fine = mesoslip.plot(runs["plain"]).axes[1]
    assert fine.get_legend().get_title().get_text() == "largest slip (shaded at left)"
    assert fine.lines[0].get_linestyle() == "-"


def test_a_picture_reads_the_realizations_that_it_draws(klein, tmp_path, monkeypatch):
    """Of 60 with finer traces: no variable of all of them, and not the finer times of all."""
    config = klein(run__realizations=60, contacts__count=20, run__duration=2.5)
    path = tmp_path / "many.nc"
    write_results(run_realizations(config.replace("output.slip_interval=0.1 ms")), path)
    read = []

    def values(one):
        index = tuple(one.part.get(name, slice(None)) for name in one.stored.dimensions)
        found = np.asarray(one.stored[index or ...])
        read.append((one.stored.name, found.size))
        return found

    monkeypatch.setattr(Stored, "values", property(values))
    monkeypatch.setattr("mesoslip.output.validity.MAX_ROWS", 1000)
    figure = mesoslip.plot(path)
    assert figure.axes[0].get_title(loc="left").endswith("grey: 20 of the other 59 realizations")
    samples = config.expected_duration / config.output_interval + 1
    assert max(size for _, size in read) <= samples
    names = {name for name, _ in read}
    assert {"spring_force", "sample_time", "realization_index"} <= names
