"""Figures of the source, and the captions below them."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from mesoslip.configuration.config import Config
from outputs import configuration

Draw = Callable[[Sequence[xr.DataTree]], Figure]


@dataclass(frozen=True)
class SourceFigure:
    """A figure of the source: its runs, the function that draws them, and its caption."""

    runs: tuple[str, ...]
    draw: Draw
    shows: str


FIGURES: dict[str, SourceFigure] = {}


def source_figure(name: str, shows: str, runs: tuple[str, ...]) -> Callable[[Draw], Draw]:
    """Make a function of the outputs of runs a figure."""

    def add(draw: Draw) -> Draw:
        FIGURES[name] = SourceFigure(runs, draw, shows)
        return draw

    return add


def power_of_ten(value: float) -> str:
    """A number with one digit, as people write it."""
    digit, _, power = f"{value:.0e}".partition("e")
    return rf"${digit} \times 10^{{{int(power)}}}$" if value else "0"


# Parameters in a caption, if all its runs share them.
PARAMETERS: tuple[Callable[[Config], str | None], ...] = (
    lambda config: f"$N$ = {config.contacts.count}" if config.contact_kind.is_discrete else None,
    lambda config: f"$F_s$ = {config.contacts.static_force * 1e6:g} µN",
    lambda config: f"$Nk$ = {config.contacts.stiffness:g} N/m",
    lambda config: rf"$\Delta{{f_s}}/f_s$ = {config.contacts.threshold.relative_width:.3g}",
    lambda config: f"$f_b$ = {config.contacts.back_force_ratio:g} $f_s$",
    lambda config: rf"$\tau_d$ = {config.contacts.delay * 1e3:g} ms",
    lambda config: rf"$\eta$ = {power_of_ten(config.contacts.drag_rate)} 1/s",
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
    """The caption of a figure, with the parameters that all its runs share."""
    configs = [configuration(tree) for tree in trees]
    all_texts = [{parameter(config) for config in configs} for parameter in PARAMETERS]
    common = [text for texts in all_texts if len(texts) == 1 for text in texts if text is not None]
    return f"{name}: {shows}. {', '.join(common)}."


def add_caption(figure: Figure, text: str) -> None:
    """Write a caption under a figure, which is not broken within formulas."""
    # A formula takes less room than its source.
    width = int(CAPTION_CHARACTERS * figure.get_figwidth() * 1.15)
    kept_together = text.replace(" = ", "\u00a0=\u00a0")
    figure.supxlabel(textwrap.fill(kept_together, width), fontsize=7, x=0.01, ha="left")
