"""The figures of Braun's "Stick-slip kinetics", from the outputs of the runs of the same names."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Iterable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from numpy.typing import NDArray

from mesoslip.analysis import avalanche_statistics
from mesoslip.analysis import avalanches as avalanche_catalogue
from mesoslip.configuration.config import Config
from mesoslip.errors import ConfigError, FileError, Problem
from mesoslip.output import files
from mesoslip.output.layout import group_of
from mesoslip.plots import avalanches as avalanche_plots
from mesoslip.plots import run as plots
from mesoslip.plots.style import CONTACT, SPRING, save, styled
from mesoslip.plots.theory import draw_onset


def configuration(tree: xr.DataTree) -> Config:
    """The configuration of an output."""
    return Config.from_toml(tree.attrs["configuration"])


def force_over_displacement(trees: Sequence[xr.DataTree]) -> Figure:
    """S18: the force of the master equation against displacement, with f_s = 1 and Nk = 1."""
    (tree,) = trees
    data, contacts = tree.to_dataset(), configuration(tree).contacts
    figure = Figure(figsize=(4.5, 3))
    axes = figure.subplots()
    axes.plot(
        data["displacement"].values * contacts.stiffness / contacts.static_force,
        data["contact_force"].values / contacts.static_force,
        color="black",
    )
    axes.axhline(tree.attrs["F_steady"] / contacts.static_force, color="0.8", zorder=0)
    axes.set_xlabel("displacement $X$")
    axes.set_ylabel("force $F(X)$")
    axes.set_xlim(0, 6)
    axes.set_ylim(0, 1)
    return figure


# What the source gives for D0, D2 and D3 at each dispersion of S19; it lost an exponent.
SOURCE_COEFFICIENTS = {0.01: "0.94, 2.2e5, 1.91e?", 0.1: "0.794, 3.61e3, 4.03e2"}


def onset_of_slip(trees: Sequence[xr.DataTree]) -> Figure:
    """S19: drop of the spring force by S46 and S47, with the slips of both engines beside it."""
    figure = Figure(figsize=(6.5, 5.4))
    rows = figure.subplots(2, 2)
    for columns, group in zip(rows.T, (trees[:3], trees[3:]), strict=True):
        onset, contacts, infinite = group
        width = configuration(onset).contacts.threshold.relative_width
        static = configuration(onset).contacts.static_force
        for axes in columns:
            for tree, style in (
                (contacts, {"color": "tab:orange", "label": "N contacts"}),
                (infinite, {"color": "tab:red", "label": r"$N \to \infty$"}),
            ):
                times, force = plots.series(tree, "spring_force")
                _, displacement = plots.series(tree, "displacement")
                start = int(np.argmax(displacement >= onset.attrs["X_c"]))
                tau = onset.attrs["omega_s"] * (times - times[start])
                axes.plot(tau, (force - force[start]) / static, **style)
            draw_onset(axes, onset, linestyle="--")
            axes.set_xlabel(r"$\tau = \Omega_S (t - t_c)$")
            axes.set_ylabel(r"$\Delta F_d/F_s$")
        whole, start_of_slip = columns
        whole.set_xlim(0, 5)
        whole.set_ylim(-2.1, 0.1)
        end = 3 * onset.attrs["expansion_end_time"]
        start_of_slip.set_xlim(0, end)
        start_of_slip.set_ylim(-0.02 * end**2, 0.002 * end**2)
        whole.set_title(
            rf"$\Delta f_s/f_s$ = {width:g}"
            "\n"
            rf"$D_0, D_2, D_3$: {onset.attrs['D0']:.3g}, {onset.attrs['D2']:.3g}, "
            rf"{onset.attrs['D3']:.3g}"
            f"\nin the source: {SOURCE_COEFFICIENTS.get(width, 'none')}",
            loc="left",
        )
    rows[0, 0].legend()
    return figure


def limit_of_many_contacts(trees: Sequence[xr.DataTree]) -> Figure:
    """Force of N contacts and of infinitely many under a block that goes forth and back, and the
    difference over N."""
    exact, *finite = trees
    figure = Figure(figsize=(6.5, 3))
    force, difference = figure.subplots(1, 2, width_ratios=[1.6, 1])
    infinite = exact.to_dataset()["contact_force"].values[0]
    counts, errors = [], []
    for tree in finite:
        config = configuration(tree)
        counts.append(config.contacts.count)
        deviation = (
            tree.to_dataset()["contact_force"].values - infinite
        ) / config.contacts.static_force
        errors.append(np.sqrt(np.mean(deviation**2)))
    times = exact.to_dataset()["time"].values
    force.plot(
        times,
        finite[0].to_dataset()["contact_force"].values[0] * 1e6,
        color="0.7",
        label=f"$N$ = {counts[0]}",
    )
    force.plot(times, infinite * 1e6, color="black", label=r"$N \to \infty$")
    force.set_xlabel("time (s)")
    force.set_ylabel("contact force (µN)")
    force.legend()
    difference.loglog(counts, errors, "o", color="black", markersize=4)
    slope = errors[-1] * np.sqrt(counts[-1] / np.array(counts))
    difference.loglog(counts, slope, color="tab:red", linestyle="--", label="$N^{-1/2}$")
    difference.set_xlabel("$N$")
    difference.set_ylabel("rms difference over $F_s$")
    difference.legend()
    return figure


def stick_slip(trees: Sequence[xr.DataTree]) -> Figure:
    """S20: the spring force in the stick-slip regime; an inset shows one slip."""
    (tree,) = trees
    figure = Figure(figsize=(6.5, 3.6))
    axes = figure.subplots()
    plots.draw_series(axes, tree, "spring_force", color="black")
    axes.set_xlabel("time (s)")
    axes.set_ylabel("spring force $F_d$ (µN)")
    axes.set_xlim(0, tree["time"].max().item())
    slip = plots.largest_slip(tree)
    if slip is not None:
        low, high = axes.get_ylim()
        axes.set_ylim(low, high + 0.6 * (high - low))
        inset = axes.inset_axes((0.4, 0.62, 0.57, 0.36))
        window = plots.slip_window(slip, before=0.5, after=9)
        plots.draw_series(inset, tree, "spring_force", window=window, time_unit=1e-3, color="black")
        inset.set_xlabel(f"time after {window[0]:.3f} s (ms)", fontsize=7)
        inset.tick_params(labelsize=7)
    return figure


def slip_details(trees: Sequence[xr.DataTree]) -> Figure:
    """S21: velocity (a), spring and contact force (b), detached contacts (c) during a slip."""
    (tree,) = trees
    figure = Figure(figsize=(4.5, 6))
    velocity, force, detached = figure.subplots(3, 1, sharex=True)
    slip = plots.largest_slip(tree)
    if slip is not None:
        window = plots.slip_window(slip, before=0.1, after=0.8)
        for axes, name in ((velocity, "velocity"), (detached, "detached_contacts")):
            plots.draw_series(axes, tree, name, window=window, time_unit=1e-3, color="black")
        plots.draw_series(force, tree, "contact_force", window=window, time_unit=1e-3, **CONTACT)
        plots.draw_series(force, tree, "spring_force", window=window, time_unit=1e-3, **SPRING)
        detached.set_xlabel(f"time after {window[0]:.4f} s (ms)")
        force.legend()
    velocity.set_ylabel("slider velocity (µm/s)")
    force.set_ylabel("force (µN)")
    detached.set_ylabel("detached contacts $N_d$")
    for letter, axes in zip("abc", (velocity, force, detached), strict=True):
        axes.set_title(f"({letter})", loc="left")
    return figure


def _panels(figure: Figure, rows: int, columns: int) -> NDArray[Any]:
    return np.asarray(figure.subplots(rows, columns, squeeze=False, sharex="col", sharey="row"))


def delays(trees: Sequence[xr.DataTree]) -> Figure:
    """S22: the spring force for different values of the delay time, at first and in the end."""
    figure = Figure(figsize=(6.5, 1.5 * len(trees) + 0.5))
    panels = _panels(figure, len(trees), 2)
    span = 12.0
    for letter, row, tree in zip("abcdefgh", panels, trees, strict=False):
        end = tree["time"].max().item()
        for axes, window in zip(row, ((0, span), (end - span, end)), strict=True):
            plots.draw_series(axes, tree, "spring_force", window=window, color="black")
            axes.axhline(0, color="0.8", linewidth=0.6, zorder=0)
            axes.set_xlim(0, span)
        delay = configuration(tree).contacts.delay
        row[0].set_title(rf"({letter}) $\tau_d$ = {delay * 1e3:g} ms", loc="left")
        row[0].set_ylabel("$F_d$ (µN)")
        row[1].set_title(f"after {end - span:g} s", loc="left")
    for axes in panels[-1]:
        axes.set_xlabel("time (s)")
    return figure


def dispersions(trees: Sequence[xr.DataTree]) -> Figure:
    """S23: the spring force for different dispersions of the thresholds."""

    def width(tree: xr.DataTree) -> str:
        return rf"$\Delta f_s/f_s$ = {configuration(tree).contacts.threshold.relative_width:g}"

    return _stacked(trees, width)


def _stacked(trees: Sequence[xr.DataTree], title: Callable[[xr.DataTree], str]) -> Figure:
    """The spring forces of runs, one below the other."""
    figure = Figure(figsize=(6.5, 1.5 * len(trees) + 0.5))
    panels = _panels(figure, len(trees), 1)[:, 0]
    for letter, axes, tree in zip("abcdefgh", panels, trees, strict=False):
        plots.draw_series(axes, tree, "spring_force", color="black")
        axes.set_title(f"({letter}) {title(tree)}", loc="left")
        axes.set_ylabel("$F_d$ (µN)")
        axes.set_xlim(0, tree["time"].max().item())
    panels[-1].set_xlabel("time (s)")
    return figure


def layers(trees: Sequence[xr.DataTree]) -> Figure:
    """S24: slips of elastic sliders of 16 and 64 layers, in both measures of the force; insets show
    the whole cycle."""
    figure = Figure(figsize=(6.5, 3.4))
    panels = figure.subplots(1, 2)
    names = ("elastic_force", "spring_force")
    titles = ("mean elastic force $K(X_d - X_1)$", "force at the drive")
    for letter, axes, name, title in zip("ab", panels, names, titles, strict=True):
        inset = axes.inset_axes((0.45, 0.62, 0.53, 0.36))
        for tree, style in zip(trees, ("--", "-"), strict=True):
            count = configuration(tree).slider.layer_count
            color = "tab:red" if style == "--" else "black"
            line: dict[str, Any] = {"color": color, "linestyle": style}
            slips = group_of(tree, "slips")
            if slips.sizes["slip"]:
                start = slips["start_time"].values[0] - 3e-3
                plots.draw_series(
                    axes,
                    tree,
                    name,
                    window=(start, start + 0.02),
                    time_unit=1e-3,
                    label=f"$N_l$ = {count}",
                    **line,
                )
            plots.draw_series(inset, tree, name, window=(0, 6), linewidth=0.5, color=color)
        low, high = axes.get_ylim()
        axes.set_ylim(low, high + 0.7 * (high - low))
        inset.tick_params(labelsize=6)
        inset.set_xlabel("time (s)", fontsize=6)
        axes.set_xlabel("time in the first slip (ms)")
        axes.set_ylabel(f"({letter}) {title} (µN)")
        axes.legend(loc="lower left")
    return figure


def viscosities(trees: Sequence[xr.DataTree]) -> Figure:
    """S28: the spring force for different viscosities of the film, and its first drop."""
    figure = Figure(figsize=(6.5, 3))
    whole, detail = figure.subplots(1, 2, width_ratios=[2, 1])
    for tree, style in zip(trees, ("-", "--", ":", "-."), strict=False):
        rate = configuration(tree).contacts.drag_rate
        label = rf"$\eta$ = {rate:.0e} s$^{{-1}}$"
        plots.draw_series(whole, tree, "spring_force", linestyle=style, label=label)
        slip = plots.largest_slip(tree)
        if slip is not None:
            start = slip["start_time"].item() - 5e-3
            plots.draw_series(
                detail,
                tree,
                "spring_force",
                window=(start, start + 0.045),
                time_unit=1e-3,
                linestyle=style,
            )
    whole.set_xlabel("time (s)")
    whole.set_ylabel("spring force $F_d$ (µN)")
    whole.legend()
    detail.set_xlabel("time in the first slip (ms)")
    return figure


def interactions(trees: Sequence[xr.DataTree]) -> Figure:
    """S25: the spring force for different strengths of the interaction."""
    return _stacked(trees, _strength)


def detaching(trees: Sequence[xr.DataTree]) -> Figure:
    """S26: detached contacts in the first slip for different strengths of the interaction."""
    figure = Figure(figsize=(6.5, 4.2))
    for letter, axes, tree in zip("abcd", figure.subplots(2, 2).flat, trees, strict=True):
        plots.draw_series(
            axes, tree, "detached_contacts", window=_first_slip(tree), time_unit=1e-3, color="black"
        )
        sizes = group_of(tree, "avalanches")["size"].values
        axes.set_title(f"({letter}) {_strength(tree)}; largest: {sizes.max()}", loc="left")
        axes.set_ylabel("$N_d$")
        axes.set_xlabel("time in the first slip (ms)")
    return figure


def interacting_slips(trees: Sequence[xr.DataTree]) -> Figure:
    """S27: spring force and contact force in the first slip for each strength of interaction."""
    figure = Figure(figsize=(6.5, 4.2))
    all_axes = figure.subplots(2, 2).flat
    for letter, axes, tree in zip("abcd", all_axes, trees, strict=True):
        window = _first_slip(tree)
        plots.draw_series(axes, tree, "contact_force", window=window, time_unit=1e-3, **CONTACT)
        plots.draw_series(axes, tree, "spring_force", window=window, time_unit=1e-3, **SPRING)
        axes.axhline(0, color="0.8", linewidth=0.6, zorder=0)
        axes.set_title(f"({letter}) {_strength(tree)}", loc="left")
        axes.set_ylabel("force (µN)")
        axes.set_xlabel("time in the first slip (ms)")
    all_axes[0].legend()
    return figure


def _strength(tree: xr.DataTree) -> str:
    interaction = configuration(tree).interaction
    return rf"$\xi$ = {interaction.strength if interaction is not None else 0:g}"


def _first_slip(tree: xr.DataTree) -> tuple[float, float]:
    """Window from 2 ms before to 30 ms after the start of the first slip [s]."""
    start = group_of(tree, "slips")["start_time"].values[0]
    return start - 2e-3, start + 3e-2


def spreading_avalanche(trees: Sequence[xr.DataTree]) -> Figure:
    """An avalanche through the whole system as it spreads over the lattice, a part of it at each
    stage."""
    (tree,) = trees
    snapshot = avalanche_plots.chosen_snapshot(tree)
    generation = snapshot["generation"].values.astype(float)
    stages = np.quantile(generation[generation > 0], (0.02, 0.2, 0.5, 1.0)).astype(int)
    figure = Figure(figsize=(6.5, 6.2))
    panels = figure.subplots(2, 2)
    for axes, stage in zip(panels.flat, stages, strict=True):
        broken = np.where((generation > 0) & (generation <= stage), generation, np.nan)
        drawn = avalanche_plots.draw_contacts(
            axes, snapshot, broken, cmap="inferno_r", norm=Normalize(1, generation.max())
        )
        count = np.count_nonzero(np.isfinite(broken))
        axes.set_title(f"generation {stage}: {count} contacts", loc="left")
    figure.colorbar(drawn, ax=panels, shrink=0.6, label="generation in which a contact breaks")
    return figure


def avalanche_sizes(trees: Sequence[xr.DataTree]) -> Figure:
    """Sizes of avalanches without interaction: a slider without inertia, and a fibre bundle."""
    *sliders, bundle = trees
    figure = Figure(figsize=(6.5, 3.2))
    stationary, failing = figure.subplots(1, 2)
    for tree, color in zip(sliders, ("tab:green", "tab:orange", "tab:red"), strict=True):
        config = configuration(tree)
        sizes = avalanche_catalogue.avalanches(tree)["size"].values
        fit = avalanche_statistics.fit_power_law(sizes, smallest=10)
        label = f"$K/Nk$ = {config.spring_stiffness / config.contacts.stiffness:g}"
        if fit is not None:
            label += rf": $\tau$ = {fit.exponent:.3f}, $s_c$ = {fit.cutoff:.3g}"
            if fit.is_rejected:
                label += f" (rejected, p = {fit.p_value:.2g})"
        avalanche_plots.draw_distribution(stationary, sizes, fit, color=color, label=label)
    for tree, force_above, color, exponent in (
        (bundle, None, "black", 2.5),
        (bundle, 0.999, "tab:blue", 1.5),
    ):
        bursts = avalanche_catalogue.avalanches(tree, min_force_ratio=force_above)
        sizes = bursts["size"].values[~avalanche_catalogue.failures(tree, bursts)]
        label = "all bursts" if force_above is None else f"above {force_above:g} of the strength"
        avalanche_plots.draw_distribution(failing, sizes, color=color, label=label)
        over = np.array([1.0, 300.0])
        failing.loglog(over, over**-exponent, ":", color=color, label=f"$s^{{-{exponent:g}}}$")
    over = np.array([1.0, 1e4])
    stationary.loglog(over, 0.3 * over**-1.5, ":", color="black", label="$s^{-3/2}$")
    stationary.set_title("sliding, stationary", loc="left")
    failing.set_title("fibre bundle", loc="left")
    for axes in (stationary, failing):
        axes.set_xlabel("avalanche size $s$")
        axes.set_ylabel("$P(s)$")
        axes.set_ylim(bottom=1e-10)
        axes.set_xlim(0.7, 3e5 if axes is stationary else 2e4)
        axes.legend(loc="lower left")
    return figure


@dataclass(frozen=True)
class SourceFigure:
    """A figure of the source: the runs it needs, the function that draws it, and what it shows."""

    runs: tuple[str, ...]
    draw: Callable[[Sequence[xr.DataTree]], Figure]
    shows: str


# What a caption tells of the runs, if it is the same in all of them.
PARAMETERS: tuple[Callable[[Config], str | None], ...] = (
    lambda config: f"$N$ = {config.contacts.count}" if config.contact_kind.is_discrete else None,
    lambda config: f"$F_s$ = {config.contacts.static_force * 1e6:g} µN",
    lambda config: f"$Nk$ = {config.contacts.stiffness:g} N/m",
    lambda config: rf"$\Delta{{f_s}}/f_s$ = {config.contacts.threshold.relative_width:.3g}",
    lambda config: f"$f_b$ = {config.contacts.back_force_ratio:g} $f_s$",
    lambda config: rf"$\tau_d$ = {config.contacts.delay * 1e3:g} ms",
    lambda config: rf"$\eta$ = {config.contacts.drag_rate:.0e} 1/s",
    lambda config: (
        f"$K$ = {config.spring_stiffness:g} N/m" if 0 < config.spring_stiffness < np.inf else None
    ),
    lambda config: (
        f"$v_d$ = {config.drive_speed * 1e6:g} µm/s"
        if len(config.drive_parts) == 1 and config.drive_speed > 0
        else None
    ),
    lambda config: f"{config.contacts.threshold.law} thresholds",
    lambda config: f"{config.contacts.coupling} coupling",
)
# Characters of a caption in an inch.
CAPTION_CHARACTERS = 19


def caption(name: str, shows: str, trees: Sequence[xr.DataTree]) -> str:
    """What a figure shows, and the parameters that all its runs have in common."""
    configs = [configuration(tree) for tree in trees]
    told = [{parameter(config) for config in configs} for parameter in PARAMETERS]
    common = [text for texts in told if len(texts) == 1 for text in texts if text is not None]
    return f"{name}: {shows}. {', '.join(common)}."


def add_caption(figure: Figure, text: str) -> None:
    """Write a caption under a figure; formulas in it have no spaces, where it may be broken."""
    # A formula takes less room than its source.
    width = int(CAPTION_CHARACTERS * figure.get_figwidth() * 1.15)
    kept_together = text.replace(" = ", "\u00a0=\u00a0")
    figure.supxlabel(textwrap.fill(kept_together, width), fontsize=7, x=0.01, ha="left")


FIGURES = {
    "S18": SourceFigure(
        ("S18.curve",),
        force_over_displacement,
        "force $F(X)$ of the master equation against displacement, in units of $F_s$ and $f_s/k$",
    ),
    "S19": SourceFigure(
        ("S19a.onset", "S19a", "S19a-me", "S19b.onset", "S19b", "S19b-me"),
        onset_of_slip,
        "drop of the spring force after the instability by Eqs. S46 and S47, and in slips",
    ),
    "S20": SourceFigure(("S20",), stick_slip, "spring force in stick-slip; inset: one slip"),
    "S21": SourceFigure(
        ("S21",),
        slip_details,
        "details of the first slip: (a) velocity, (b) forces, (c) detached contacts",
    ),
    "S22": SourceFigure(
        ("S22a", "S22b", "S22c", "S22d"),
        delays,
        "spring force for different delays, at first (left) and after 388 s (right)",
    ),
    "S23": SourceFigure(
        ("S23a", "S23b", "S23c"),
        dispersions,
        "spring force for different dispersions of the thresholds",
    ),
    "S24": SourceFigure(
        ("S24a", "S24b"),
        layers,
        "slips of elastic sliders of 16 and 64 layers; insets: the whole cycle",
    ),
    "S25": SourceFigure(
        ("S25a", "S25b", "S25c", "S25d"),
        interactions,
        "spring force for different strengths of the interaction",
    ),
    "S26": SourceFigure(
        ("S25a", "S25b", "S25c", "S25d"),
        detaching,
        "detached contacts in the first slip for different strengths of the interaction",
    ),
    "S27": SourceFigure(
        ("S25a", "S25b", "S25c", "S25d"),
        interacting_slips,
        "spring and contact force in the first slip for different strengths of the interaction",
    ),
    "S28": SourceFigure(
        ("S28a", "S28b", "S28c"),
        viscosities,
        "spring force for different viscosities of the film, and its first drop",
    ),
    "limit": SourceFigure(
        ("limit-me", *(f"limit-{power}" for power in range(2, 7))),
        limit_of_many_contacts,
        "force under a block that goes forth and back, and its difference to N to infinity",
    ),
    "avalanche": SourceFigure(
        ("avalanche",), spreading_avalanche, "an avalanche through the whole system at four stages"
    ),
    "sizes": SourceFigure(
        ("sizes-2000", "sizes-200", "sizes-20", "bundle"),
        avalanche_sizes,
        "sizes of avalanches of sliders without inertia, and of a fibre bundle",
    ),
}


def draw(names: Iterable[str], outputs: Path, folder: Path) -> list[Path]:
    """Draw figures of the source from the outputs of their runs."""
    names = tuple(names) or tuple(FIGURES)
    unknown = [name for name in names if name not in FIGURES]
    if unknown:
        known = ", ".join(FIGURES)
        raise ConfigError(
            [Problem("", name, f"no such figure; choose of {known}") for name in unknown]
        )
    missing = [
        path
        for name in names
        for path in (outputs / f"{run}.nc" for run in FIGURES[name].runs)
        if not path.exists()
    ]
    if missing:
        targets = " ".join(str(path) for path in missing)
        raise FileError(f"outputs are missing; make them first: make {targets}")
    paths = []
    for name in names:
        with ExitStack() as stack:
            trees = [
                stack.enter_context(files.opened(outputs / f"{run}.nc"))
                for run in FIGURES[name].runs
            ]
            with styled():
                figure = FIGURES[name].draw(trees)
                add_caption(figure, caption(name, FIGURES[name].shows, trees))
        path = folder / f"{name}.png"
        save(figure, path)
        paths.append(path)
    return paths
