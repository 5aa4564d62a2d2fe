"""Claims of layered sliders and of a base: C9, C20, C23."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from mesoslip.configuration.sliders.layered import LayeredSlider
from numpy.typing import NDArray
from outputs import configuration

from claims.base import Finding, claim, measured, variable, verdict
from claims.slips import of_each

if TYPE_CHECKING:
    import xarray as xr
    from mesoslip.configuration.config import Config

Array = NDArray[np.float64]

# Time between a slip and the measurement of ringing [s], and points of its spectrum.
QUIET = 5e-3
SPECTRUM = 2**18


@claim(
    "C9",
    "the duration of a slip hardly depends on the number of layers, 16 or 64 (S24)",
    "within 10 %",
    ("claims/layers-16", "claims/layers-64"),
)
def layers(trees: Sequence[xr.DataTree]) -> Finding:
    times = [of_each(tree, lambda one: one["duration"].values[0]) for tree in trees]
    counts = [configuration(tree).slider.layer_count for tree in trees]
    few, many = (one.mean() for one in times)
    return Finding(
        tuple(
            measured(f"duration of the first slip, {count} layers", one, "s", "the same")
            for count, one in zip(counts, times, strict=True)
        ),
        verdict(abs(many / few - 1) < 0.1),
        "",
    )


def _slider(config: Config) -> LayeredSlider:
    assert isinstance(config.slider, LayeredSlider)
    return config.slider


@claim(
    "C20",
    "with a base, substrates that are pinned together ring near (K_B/(M_B + M + Nm))^(1/2)",
    "after the first slip, within 10 % in every realization on four bases, and within 1 % of "
    "the lowest mode of the linear chain",
    tuple(f"claims/base-{one}" for one in (165, 250, 330, 500)),
)
def base(trees: Sequence[xr.DataTree]) -> Finding:
    ratios, modes, names = [], [], []
    for tree in trees:
        config = configuration(tree)
        slider = _slider(config)
        assert slider.base is not None
        film = config.contacts.count * config.contacts.contact_mass
        claimed = np.sqrt(slider.base.stiffness / (slider.base.mass + slider.mass + film))
        ratios.append(_ringing_of_base(tree) / claimed)
        modes.append(_lowest_mode(config) / claimed)
        names.append(f"M_B/M = {slider.base.mass / slider.mass:g}, K_B = {slider.base.stiffness:g}")
    exact = [abs(found.mean() / mode - 1) < 0.01 for found, mode in zip(ratios, modes, strict=True)]
    return Finding(
        (
            *(
                measured(f"ringing over the claim, {name} N/m", one, "1", "about 1")
                for name, one in zip(names, ratios, strict=True)
            ),
            *(
                measured(f"mode of the pinned chain over the claim, {name} N/m", one, "1", "")
                for name, one in zip(names, modes, strict=True)
            ),
        ),
        verdict(all(np.all(np.abs(one - 1) < 0.1) for one in ratios) and all(exact)),
        "the difference is that of the mode of the linear chain: the drive's spring adds to K_B, "
        "and the layers and the contacts yield",
    )


def _ringing_of_base(tree: xr.DataTree) -> Array:
    """Angular frequency of the base after the first slip, one for each realization [1/s]."""
    times = variable(tree, "time")
    ends = of_each(tree, lambda one: one["end_time"].values[0])
    frequencies = 2 * np.pi * np.fft.rfftfreq(SPECTRUM, times[1] - times[0])
    found = []
    for displacement, end in zip(variable(tree, "base_displacement"), ends, strict=True):
        after = times > end + QUIET
        ringing = displacement[after]
        # Without the slow loading by the drive.
        ringing = ringing - np.polyval(np.polyfit(times[after], ringing, 2), times[after])
        spectrum = np.abs(np.fft.rfft(ringing * np.hanning(ringing.size), SPECTRUM))
        found.append(frequencies[np.argmax(spectrum)])
    return np.array(found)


def _lowest_mode(config: Config) -> float:
    """Lowest angular frequency of base, contacts, layers and the spring to the drive [1/s]."""
    slider = _slider(config)
    assert slider.base is not None
    count = slider.layers
    masses = np.array([slider.base.mass, *[slider.mass / count] * count])
    springs = [
        slider.base.stiffness,
        config.contacts.stiffness,
        *[slider.stiffness * count] * count,
    ]
    stiffness = np.diag(np.array(springs[:-1]) + springs[1:])
    stiffness -= np.diag(springs[1:-1], 1) + np.diag(springs[1:-1], -1)
    return float(np.sqrt(np.linalg.eigvals(stiffness / masses[:, None]).real.min()))


class Stop(NamedTuple):
    """How the lower half of the layers stops, one number for each realization."""

    is_first: NDArray[np.bool_]
    """Whether layer 1 is the first of all layers."""
    in_order: Array
    """Share of pairs of neighbours of which the lower one rests first."""
    delay: Array
    """Delay of the layer at half the height after layer 1, over that of a wave."""


@claim(
    "C23",
    "when a layered slider stops, the layer at the interface stops first and a stopping wave "
    "runs up",
    "where sliding slows down to rest: layer 1 rests first in every realization, nine of ten "
    "pairs of neighbours up to half the height in order, that height after half to one and a "
    "half times 1/(2 Omega_S); with a qualification if the order is the reverse at the end of "
    "a slip",
    ("claims/stopping-16", "claims/stopping-32", "claims/stopping-slip"),
)
def stopping(trees: Sequence[xr.DataTree]) -> Finding:
    *slowed, slip = trees
    starts = [variable(tree, "time")[0] for tree in slowed]
    for place, tree in enumerate(slowed):
        stages = tree.children["stages"].to_dataset()
        starts[place] = stages["stage_start_time"].values[1]
    peaks = of_each(slip, lambda one: one["start_time"].values[0])
    found = [
        *(_stop(tree, [start] * tree.sizes["realization"]) for tree, start in
          zip(slowed, starts, strict=True)),
        _stop(slip, peaks),
    ]  # fmt: skip
    counts = [_slider(configuration(tree)).layers for tree in trees]
    names = [
        *(f"slowed down, {count} layers" for count in counts[:-1]),
        f"slip, {counts[-1]} layers",
    ]
    upward = all(
        np.all(one.is_first) and np.all(one.in_order > 0.9) and np.all(np.abs(one.delay - 1) < 0.5)
        for one in found[:-1]
    )
    downward = bool(np.all(found[-1].in_order < 0.1))
    return Finding(
        (
            *(
                measured(f"layer 1 rests first, {name}", one.is_first, "1", "1")
                for name, one in zip(names, found, strict=True)
            ),
            *(
                measured(f"pairs of layers in order, {name}", one.in_order, "1", "1")
                for name, one in zip(names, found, strict=True)
            ),
            *(
                measured(f"delay at half the height over a wave's, {name}", one.delay, "1", "1")
                for name, one in zip(names, found, strict=True)
            ),
        ),
        verdict(upward, downward),
        "so it is where sliding slows down to rest. At the end of a slip in stick-slip the "
        "opposite is found: the upper layers rest first, and the wave runs down to the contacts",
    )


def _stop(tree: xr.DataTree, starts: Sequence[float] | Array) -> Stop:
    """How the layers stop after a time, one for each realization."""
    times = variable(tree, "time")
    slider = _slider(configuration(tree))
    half = slider.layers // 2
    first, order, delays = [], [], []
    for layers_, start in zip(variable(tree, "layer_displacement"), starts, strict=True):
        velocity = np.diff(layers_, axis=0) / np.diff(times)[:, None]
        rests = np.empty(slider.layers)
        for layer in range(slider.layers):
            after = np.flatnonzero(times[1:] > start)
            moving = after[np.argmax(velocity[after, layer])]
            rests[layer] = times[1:][moving + np.argmax(velocity[moving:, layer] <= 0)]
        first.append(rests[0] == rests.min())
        order.append(np.mean(np.diff(rests[: half + 1]) > 0))
        # A wave passes a layer in 1/(Omega_S N_l).
        delays.append((rests[half] - rests[0]) * slider.omega_s * slider.layers / half)
    return Stop(np.array(first), np.array(order), np.array(delays))
