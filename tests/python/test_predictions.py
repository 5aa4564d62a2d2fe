"""What theory says of the runs of a sweep, as measures."""

import mesoslip
import numpy as np
import pytest
import xarray as xr
from conftest import klein_tables
from matplotlib.contour import ContourSet
from mesoslip.campaign.measures import MEASURES, RunView
from mesoslip.theory.force_curve import ForceCurve

SHORT = {"run__duration": 0.3, "contacts__count": 100}


def measured(name, **changes):
    tree = mesoslip.run(klein_tables(**SHORT | changes))
    return MEASURES[name].function(RunView(tree, 0.0))


@pytest.mark.parametrize("delay", [1e-4, 1e-2])
def test_growth_is_that_of_steady_sliding(delay, klein):
    sliding = mesoslip.SteadySliding(klein(**SHORT, contacts__delay=delay))
    assert measured("growth_rate", contacts__delay=delay) == sliding.growth_rate
    stable = measured("stable_dephased", contacts__delay=delay)
    assert stable == sliding.is_stable_dephased
    # Where Klein's case slides smoothly in the end, and where it slips.
    assert stable == (delay < 1e-3)


def test_critical_stiffness_is_that_of_the_curve(klein):
    critical, _ = ForceCurve(klein(**SHORT)).K_star
    assert measured("critical_stiffness_ratio") == pytest.approx(critical / 97, rel=1e-9)
    assert measured("critical_stiffness_ratio", slider__stiffness=2 * critical) == pytest.approx(
        0.5
    )


def test_waiting_over_damping():
    """Klein's case slips every half second or so, and its ringing is damped at 51 1/s."""
    assert 10 < measured("waiting_over_damping", run__duration=8.0) < 100


def sweep_over_two_keys(third=None):
    """A sweep made by hand: growth passes zero between the second and the third delay."""
    delays, stiffness = np.array([1e-4, 1e-3, 1e-2, 1e-1]), np.array([50.0, 100.0, 200.0])
    shape = (delays.size, stiffness.size, 2)
    growth = np.broadcast_to(np.array([-1.0, -1.0, 1.0, 1.0])[:, None, None], shape)
    dimensions = ("contacts.delay", "slider.stiffness", "realization")
    flags = {"flag_values": np.arange(4, dtype=np.int8), "flag_meanings": "smooth a b c"}
    data = xr.Dataset(
        {
            "status": (dimensions, np.zeros(shape, dtype=np.int8)),
            "regime": (dimensions, (growth > 0).astype(np.int8), flags),
            "growth_rate": (dimensions, growth, {"units": "s-1"}),
        },
        {"contacts.delay": delays, "slider.stiffness": stiffness, "realization": [0, 1]},
        {"configuration": "", "sweep": ""},
    )
    if third is not None:
        data = xr.concat([data] * len(third), xr.IndexVariable("drive.velocity", third))
    return xr.DataTree(data)


def test_a_map_of_the_regime_has_the_lines_of_theory():
    """Where growth is zero, between two delays, and no panel of its own for what is a line."""
    figure = mesoslip.plot(sweep_over_two_keys())
    panels = [axes for axes in figure.axes if axes.get_label() != "<colorbar>"]
    assert [one.get_ylabel() for one in figure.axes if one not in panels] == ["regime"]
    (line,) = [one for one in panels[0].collections if isinstance(one, ContourSet)]
    (path,) = [one for one in line.get_paths() if len(one.vertices)]
    assert np.all((path.vertices[:, 0] > 1e-3) & (path.vertices[:, 0] < 1e-2))
    (text,) = figure.legends[0].get_texts()
    assert "steady sliding" in text.get_text()


@pytest.mark.parametrize("unknown", [0, 7])
def test_lines_pass_where_neighbours_differ_and_nowhere_else(unknown):
    """Growth rates from -0.1 to 2600: splines through them would cross zero between neighbours of
    one sign."""
    rng = np.random.default_rng(3)
    x, y = np.geomspace(1e-4, 1e-2, 12), np.linspace(1.0, 3.0, 9)
    # Unstable beyond a bent line, and around one point far away from it.
    unstable = x[:, None] > 1e-3 * y**0.7
    unstable[2, 6] = True
    size = 10 ** rng.uniform(-3, 3.4, unstable.shape)
    growth = np.where(unstable, size, -np.minimum(size, 0.1))
    growth.ravel()[rng.choice(growth.size, unknown, replace=False)] = np.nan
    names = ("contacts.delay", "slider.stiffness", "realization")
    flags = {"flag_values": np.arange(2, dtype=np.int8), "flag_meanings": "smooth stick_slip"}
    variables = {
        "status": (names, np.zeros((*growth.shape, 1), dtype=np.int8)),
        "regime": (names, unstable[..., None].astype(np.int8), flags),
        "growth_rate": (names, growth[..., None], {"units": "s-1"}),
    }
    # In another order than along the axes.
    data = xr.Dataset(variables, {names[0]: x, names[1]: y}).isel({names[1]: slice(None, None, -1)})
    figure = mesoslip.plot(xr.DataTree(data.assign_attrs(configuration="", sweep="")))
    (line,) = (one for one in figure.axes[0].collections if isinstance(one, ContourSet))
    # Vertices may lie on the edges of cells.
    vertices = np.concatenate([(one[1:] + one[:-1]) / 2 for one in line.allsegs[0]])
    column, row = np.searchsorted(x, vertices[:, 0]), np.searchsorted(y, vertices[:, 1])
    column, row = column.clip(1, x.size - 1), row.clip(1, y.size - 1)
    corners = np.stack([growth[column - i, row - j] for i in (0, 1) for j in (0, 1)])
    assert np.isfinite(corners).all()
    assert ((corners.min(axis=0) < 0) & (corners.max(axis=0) > 0)).all()
    # Each pair of neighbours with both signs, in cells without unknown values, has a crossing.
    crossed = set(zip(column.tolist(), row.tolist(), strict=True))
    for i in range(1, x.size):
        for j in range(1, y.size):
            cell = growth[i - 1 : i + 1, j - 1 : j + 1]
            differs = np.isfinite(cell).all() and cell.min() < 0 < cell.max()
            assert ((i, j) in crossed) == differs


def test_a_third_key_has_a_map_for_each_value():
    figure = mesoslip.plot(sweep_over_two_keys(third=[1e-7, 1e-6]), view="regime")
    titles = [axes.get_title(loc="left") for axes in figure.axes if axes.get_title(loc="left")]
    assert titles == ["$v_d$ = 1e-7", "$v_d$ = 1e-6"]
    with pytest.raises(mesoslip.FileError, match="no measure 'foo'; it has regime, growth_rate"):
        mesoslip.plot(sweep_over_two_keys(), view="foo")


def test_along_one_key_the_lines_of_theory_are_where_they_pass():
    tree = sweep_over_two_keys()
    data = tree.to_dataset().isel({"slider.stiffness": 0})
    figure = mesoslip.plot(xr.DataTree(data))
    (axes,) = (one for one in figure.axes if one.get_ylabel() == "regime")
    vertical = [line for line in axes.lines if len(set(line.get_xdata())) == 1]
    # Growth goes from -1 to 1 between 1 ms and 10 ms, on a logarithmic axis.
    places = {line.get_xdata()[0] for line in vertical if len(line.get_xdata()) == 2}
    assert any(place == pytest.approx(10**-2.5) for place in places)
    (text,) = figure.legends[0].get_texts()
    assert "steady sliding" in text.get_text()
