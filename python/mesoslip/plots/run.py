"""Pictures of outputs."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from mesoslip.analysis.avalanches import NO_AVALANCHES
from mesoslip.analysis.slips import slips
from mesoslip.configuration.config import Config
from mesoslip.errors import FileError

Array = NDArray[np.float64]

STYLE: Any = {
    "font.size": 8,
    "axes.titlesize": 8,
    "axes.labelsize": 8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "legend.frameon": False,
    "legend.fontsize": 7,
    "lines.linewidth": 0.9,
    "figure.dpi": 200,
    "savefig.dpi": 200,
    "figure.constrained_layout.use": True,
}

# As in the source: the spring force in red and dashed, the contact force in black.
SPRING: dict[str, Any] = {"color": "tab:red", "linestyle": "--", "label": "spring force $F_d$"}
CONTACT: dict[str, Any] = {"color": "black", "label": "contact force $F$"}

# Scale and unit in which a variable is drawn.
SCALES = {
    "spring_force": (1e6, "µN"),
    "contact_force": (1e6, "µN"),
    "elastic_force": (1e6, "µN"),
    "velocity": (1e6, "µm/s"),
    "detached_contacts": (1.0, ""),
}


def series(tree: xr.DataTree, name: str, realization: int = 0) -> tuple[Array, Array]:
    """Times [s] and values of a variable of a realization, with the finer samples of its slips."""
    root = tree.to_dataset().isel(realization=realization)
    times, values = root["time"].values, root[name].values.astype(float)
    if "slip_traces" in tree.children:
        fine = tree.children["slip_traces"].to_dataset(inherit=False)
        mine = fine["realization"].values == root["realization"].item()
        times = np.concatenate([times, fine["time"].values[mine]])
        values = np.concatenate([values, fine[name].values[mine].astype(float)])
        order = np.argsort(times, kind="stable")
        times, values = times[order], values[order]
    return times, values


def draw_series(
    axes: Axes,
    tree: xr.DataTree,
    name: str,
    *,
    window: tuple[float, float] | None = None,
    time_unit: float = 1.0,
    **style: Any,
) -> None:
    """Draw a variable against time, or against the time since a window's start.

    Parameters
    ----------
    axes, tree, name
        Where, of which output, and which variable.
    window
        Start and end [s]; everything by default.
    time_unit
        Unit of the time axis [s].
    style
        Of the line.
    """
    times, values = series(tree, name)
    start = 0.0
    if window is not None:
        start, end = window
        inside = (times >= start) & (times <= end)
        times, values = times[inside], values[inside]
    axes.plot((times - start) / time_unit, values * SCALES[name][0], **style)


def largest_slip(tree: xr.DataTree) -> xr.Dataset | None:
    """The slip with the greatest drop of the spring force; None if there is no slip."""
    all_slips = slips(tree)
    mine = np.flatnonzero(
        all_slips["realization"].values == tree.to_dataset()["realization"].values[0]
    )
    if mine.size == 0:
        return None
    drops = all_slips["force_drop"].values[mine]
    return all_slips.isel(slip=mine[np.argmax(drops)])


def slip_window(slip: xr.Dataset, before: float = 0.3, after: float = 2.0) -> tuple[float, float]:
    """Start and end [s] of a window around a slip, in parts of its duration."""
    start, length = slip["start_time"].item(), slip["slip_time"].item()
    return start - before * length, start + (1 + after) * length


def overview(tree: xr.DataTree) -> Figure:
    """Spring force with a slip in an inset, velocity, and detached contacts against time."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(6.5, 5.2))
        force, velocity, detached = figure.subplots(
            3, 1, sharex=True, gridspec_kw={"height_ratios": [2.4, 1, 1]}
        )
        draw_series(force, tree, "spring_force", color="black")
        force.set_ylabel("spring force (µN)")
        draw_series(velocity, tree, "velocity", color="black")
        velocity.set_ylabel("velocity (µm/s)")
        draw_series(detached, tree, "detached_contacts", color="black")
        detached.set_ylabel("detached contacts")
        detached.set_xlabel("time (s)")
        detached.set_xlim(0, tree["time"].max().item())

        slip = largest_slip(tree)
        if slip is not None:
            low, high = force.get_ylim()
            force.set_ylim(low, high + 0.75 * (high - low))
            inset = force.inset_axes((0.3, 0.60, 0.45, 0.38))
            window = slip_window(slip)
            draw_series(inset, tree, "contact_force", window=window, time_unit=1e-3, **CONTACT)
            draw_series(inset, tree, "spring_force", window=window, time_unit=1e-3, **SPRING)
            inset.set_xlabel(f"time after {window[0]:.3f} s (ms)", fontsize=7)
            inset.set_ylabel("force (µN)", fontsize=7)
            inset.tick_params(labelsize=7)
            inset.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
        title = tree.attrs.get("title", "")
        if tree.attrs.get("complete") == "false":
            title = f"{title} ({tree.attrs['comment']})"
        force.set_title(title, loc="left")
    return figure


def force_curve(tree: xr.DataTree) -> Figure:
    """Force and slope of the master equation over displacement, with the points of instability."""
    config = Config.from_toml(tree.attrs["configuration"])
    contacts = config.contacts
    unit = contacts.static_force / contacts.stiffness
    data = tree.to_dataset()
    x: Array = data["displacement"].values / unit
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(6.5, 4.2))
        force, slope = figure.subplots(2, 1, sharex=True, height_ratios=[1.6, 1])
        force.plot(x, data["contact_force"].values / contacts.static_force, color="black")
        steady = tree.attrs["F_steady"] / contacts.static_force
        force.axhline(steady, color="tab:blue", linestyle=":", label="stationary sliding")
        force.set_ylabel("$F/F_s$")
        slope.plot(x, data["slope"].values / contacts.stiffness, color="black")
        slope.set_ylabel("$F'/Nk$")
        slope.set_xlabel("displacement $X k/f_s$")
        slope.set_xlim(0, x[-1])
        if np.isfinite(config.spring_stiffness):
            spring = -config.spring_stiffness / contacts.stiffness
            slope.axhline(spring, color="tab:red", linestyle="--", label="$-K/Nk$")
            slope.legend(loc="lower right")
        if "X_c" in tree.attrs:
            force.plot(
                tree.attrs["X_c"] / unit,
                tree.attrs["F_c"] / contacts.static_force,
                "o",
                color="tab:red",
                markersize=4,
                label="instability $X_c$",
            )
        force.legend()
        force.set_title(
            f"{tree.attrs['title']}; $K^*$ = {tree.attrs['K_star']:.4g} N/m", loc="left"
        )
    return figure


# Colours of the equations for the onset of slip, as in the source.
ONSETS: dict[str, dict[str, Any]] = {
    "sequential": {"color": "black", "label": "one after another (S46)"},
    "melting": {"color": "tab:blue", "label": "instant melting (S47)"},
}


def draw_onset(axes: Axes, tree: xr.DataTree, **style: Any) -> None:
    """Draw the change of the spring force by S46 and S47 against the time since the onset."""
    for name, colour in ONSETS.items():
        if name in tree.children:
            data = tree.children[name].to_dataset()
            axes.plot(
                data["onset_time"].values, data["relative_force_drop"].values, **(colour | style)
            )


def slip_onset(tree: xr.DataTree) -> Figure:
    """Drop of the spring force after the onset of slip, with double logarithmic axes beside it."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(6.5, 3))
        plain, logarithmic = figure.subplots(1, 2)
        draw_onset(plain, tree)
        for name, style in ONSETS.items():
            if name not in tree.children:
                continue
            data = tree.children[name].to_dataset()
            time, drop = data["onset_time"].values[1:], -data["relative_force_drop"].values[1:]
            logarithmic.loglog(time[drop > 0], drop[drop > 0], color=style["color"])
            logarithmic.loglog(
                time, -data["asymptote"].values[1:], color=style["color"], linestyle=":"
            )
        plain.set_xlabel(r"$\tau = \Omega_S (t - t_c)$")
        plain.set_ylabel(r"$\Delta F_d/F_s$")
        logarithmic.set_xlabel(r"$\tau$")
        logarithmic.set_ylabel(r"$-\Delta F_d/F_s$; dotted: at short times")
        if tree.children:
            plain.legend()
        else:
            plain.set_title(tree.attrs["comment"], loc="left")
    return figure


def draw(tree: xr.DataTree, view: str | None = None, snapshot: int | None = None) -> Figure:
    """A picture of an output of any command.

    Parameters
    ----------
    tree
        The output.
    view
        Of a run: "run", "avalanches" or "lattice"; by default what tells most.
    snapshot
        Number of the snapshot of a lattice; that after the largest avalanche by default.

    Raises
    ------
    FileError
        If the output does not have what is to be drawn.
    """
    from mesoslip.plots import avalanches as avalanche_plots

    if "spring_force" not in tree.data_vars:
        if view is not None:
            raise FileError(f"the output is not one of mesoslip run: it has no view {view!r}")
        return force_curve(tree) if "slope" in tree.data_vars else slip_onset(tree)
    if view == "lattice":
        return avalanche_plots.lattice(tree, snapshot)
    if view == "avalanches":
        if "avalanches" not in tree.children:
            raise FileError(NO_AVALANCHES)
        return avalanche_plots.distribution(tree)
    if Config.from_toml(tree.attrs["configuration"]).slider.jumps:
        return avalanche_plots.overview(tree)
    return overview(tree)


@contextmanager
def written_whole(path: Path) -> Iterator[Path]:
    """A file to write in the place of another, whose name appears only when it is whole.

    Raises
    ------
    FileError
        If it cannot be written, or its ending names no kind of picture.
    """
    part = path.with_name(f".part.{path.name}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        yield part
        part.replace(path)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise FileError(f"{path}: cannot be written: {reason}") from error
    finally:
        part.unlink(missing_ok=True)


def save(figure: Figure, path: Path) -> None:
    """Save a figure.

    Raises
    ------
    FileError
        If it cannot be written, or its ending names no kind of picture.
    """
    with written_whole(path) as part:
        figure.savefig(part)
