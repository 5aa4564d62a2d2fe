"""Claims of the normal load: C26, C27."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import mesoslip
import numpy as np
from outputs import configuration

from claims.base import Finding, claim, measured, variable, verdict

if TYPE_CHECKING:
    import xarray as xr

# Displacement that is left out, in mean breaking stretches.
TRANSIENT = 3.0


def slow_friction(tree: xr.DataTree) -> float:
    """Force of slow sliding at the reference load [N]."""
    config = configuration(tree).replace({"load": None})
    return float(mesoslip.derived(config)["F_steady"].value)


def vibrating_force(tree: xr.DataTree) -> float:
    """Mean force under a fast vibration [N], (1 - A) F_ss + A N k v T (pi^2 - 4)/(2 pi^2)."""
    config = configuration(tree)
    assert config.normal_load is not None
    assert config.normal_load.cycle is not None
    part = config.normal_load.cycle.amplitude / config.normal_load.normal_force
    moved = config.drive_speed / config.normal_load.cycle.frequency
    touching = config.contacts.stiffness * moved * (math.pi**2 - 4) / (2 * math.pi**2)
    return (1 - part) * slow_friction(tree) + part * touching


@claim(
    "C26",
    "a vibrating normal load lowers friction, down to that of the minimum load and a little more",
    "with v T a fifth of the breaking stretch and amplitudes of 20 and 40 % the mean force is "
    "within 3 standard errors and 2 % of the closed form; below F_ss by a tenth at least",
    ("claims/vibrating-0.2", "claims/vibrating-0.4"),
)
def vibrating_load(trees: Sequence[xr.DataTree]) -> Finding:
    found, holds = [], True
    for tree, part in zip(trees, (0.2, 0.4), strict=True):
        start = TRANSIENT * configuration(tree).contacts.break_stretch
        settled = variable(tree, "displacement")[0] >= start
        means = variable(tree, "spring_force")[:, settled].mean(axis=1)
        expected, plain = vibrating_force(tree), slow_friction(tree)
        error = means.std(ddof=1) / math.sqrt(means.size)
        difference = abs(means.mean() - expected)
        holds = holds and difference < min(3 * error, 0.02 * expected)
        holds = holds and means.mean() < 0.9 * plain
        found.append(
            measured(
                f"mean force over F_ss, amplitude {part:g}",
                means / plain,
                "1",
                f"{expected / plain:.4f}",
            )
        )
    return Finding(
        tuple(found),
        verdict(holds),
        "the sites that touch in each cycle separate before they bear much; those that never "
        "separate bear what they do under the minimum load",
    )


@claim(
    "C27",
    "a step up of the normal load is felt after a sliding distance, a step down at once "
    "(Linker and Dieterich 1992)",
    "in steady sliding: the direct change is below a twentieth of the net change after the step "
    "up, the transient change after the step down; the force has risen to that of steady "
    "sliding within a breaking stretch",
    ("claims/load-steps",),
)
def load_steps(trees: Sequence[xr.DataTree]) -> Finding:
    (tree,) = trees
    up, down = (
        mesoslip.response(tree, fit=False)["load_steps"].to_dataset().isel(load_step=one)
        for one in (0, 1)
    )
    config = configuration(tree)
    stretch = config.contacts.break_stretch
    loads = float(up["normal_force_before"]), float(up["normal_force_after"])
    mean = slow_friction(tree) / loads[0]
    expected = mean * (1 - loads[0] / loads[1]) / math.log(loads[1] / loads[0])
    net = {
        name: float(one["force_after"] - one["force_before"])
        for name, one in (("up", up), ("down", down))
    }
    direct = float(up["direct_change"]) / net["up"]
    transient = float(down["transient_change"]) / net["down"]
    rise = float(up["rise_displacement"]) / stretch
    alphas = np.array([float(up["alpha"]), float(down["alpha"])])
    return Finding(
        (
            measured("direct over net change, step up", direct, "1", "0"),
            measured("transient over net change, step down", transient, "1", "0"),
            measured("sliding distance of the rise over the breaking stretch", rise, "1", "< 1"),
            measured(
                "alpha over the friction coefficient, step up",
                alphas[0] / mean,
                "1",
                f"{expected / mean:.4f}",
            ),
            measured("alpha over the friction coefficient, step down", alphas[1] / mean, "1", "0"),
        ),
        verdict(abs(direct) < 0.05 and abs(transient) < 0.05 and rise < 1),
        "new contacts touch without a force; those that separate take theirs away",
    )
