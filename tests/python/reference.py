"""Reference outputs: a small one for each engine, slider, coupling, interaction and ageing, and for
curves and onsets; and how an output differs from its reference.
"""

import itertools
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mesoslip
import numpy as np
import xarray as xr
from conftest import ROOT, drive_in_stages, klein_tables
from matplotlib.figure import Figure

FOLDER = ROOT / "tests" / "reference"
# Where pictures of differences go.
PICTURES = ROOT / "out" / "reference"

# Few contacts, loaded so fast that slips and reversals come within some ten milliseconds, and so
# short that motion, which is sensitive to the last digit in the end, is not so yet.
COMMON = {
    "run__duration": None,
    "drive": drive_in_stages((0.03, 1e-5), (0.005, 0.0), (0.015, -1e-5)),
    "contacts__count": 120,
    "contacts__threshold__relative_width": 0.1,
    "output__interval": 5e-4,
    "output__slip_interval": 2e-4,
}
SPRING = {"mass": 1.47e-3, "stiffness": 97.0}
SLIDERS: dict[str, dict[str, Any]] = {
    "rigid": {"slider": SPRING | {"damping_ratio": 0.2}},
    "layered": {"slider": SPRING | {"kind": "layered", "layers": 4}},
    "prescribed": {"slider": {"kind": "prescribed"}},
    "quasistatic": {"slider": {"kind": "quasistatic", "stiffness": 97.0}},
}
LATTICE = {"strength": 0.1, "lattice": "triangular", "columns": 12, "rows": 10}
RELAX = {"law": "relax", "time": 3e-3, "young_force_ratio": 0.8, "young_relative_width": 0.2}
THERMAL = {"rate": 3e3, "force_ratio": 0.05}
CONTACTS: dict[str, dict[str, Any]] = {
    "scaled": {"contacts__coupling": "scaled"},
    "equal": {"contacts__coupling": "equal"},
    "lattice": {"interaction": LATTICE, "output__avalanche_size": 4},
    "ageing": {"contacts__coupling": "equal", "contacts__ageing": RELAX},
    "thermal": {"contacts__coupling": "equal", "contacts__thermal": THERMAL},
}
ENGINES: dict[str, dict[str, Any]] = {"eq": {}, "me": {"run__engine": "me"}}
# Infinitely many contacts have no neighbours; without inertia their force is that of the curve.
REFUSED = {("me", slider, "lattice") for slider in SLIDERS} | {
    ("me", "quasistatic", contacts) for contacts in CONTACTS
}

# Further ways to attach and to pull, in both engines.
FORCE = {
    "slider": {"kind": "force", "mass": 1.47e-3, "damping": 50.0},
    "drive": {
        "stage": [
            {"duration": 0.03, "start_force": 0.0, "end_force": 2.2e-5},
            {"duration": 0.02, "force": 1.0e-5},
        ]
    },
}
LOAD = {
    "load": {
        "normal_force": 1.0,
        "stage": [
            {"duration": 0.02, "normal_force": 1.0},
            {"duration": 0.02, "start_normal_force": 1.5, "end_normal_force": 0.5},
        ],
    }
}
FURTHER: dict[str, dict[str, Any]] = {
    "rigid-delays": SLIDERS["rigid"] | {"contacts__delay_law": "exponential"},
    "rigid-newborn": SLIDERS["rigid"] | {"contacts__newborn_width": 0.05},
    "rigid-table": SLIDERS["rigid"]
    | {"contacts__threshold": {"law": "table", "samples": [2.0, 3.0, 3.5, 4.0, 3.0, 5.0]}},
    "rigid-stiffnesses": SLIDERS["rigid"]
    | {
        "contacts__coupling": "table",
        "contacts__threshold": {
            "law": "table",
            "samples": [2.0, 3.0, 3.5, 4.0, 3.0, 5.0],
            "stiffnesses": [3.0, 2.0, 4.0, 2.5, 5.0, 1.5],
        },
    },
    "rigid-thermal-ageing": SLIDERS["rigid"] | CONTACTS["thermal"] | {"contacts__ageing": RELAX},
    "prescribed-thermal-ageing-log": SLIDERS["prescribed"]
    | CONTACTS["thermal"]
    | {"contacts__ageing": {"law": "log", "time": 1e-4, "growth": 0.03}},
    "rigid-thermal-newborn": SLIDERS["rigid"]
    | CONTACTS["thermal"]
    | {
        "contacts__delay_law": "exponential",
        "contacts__newborn_width": 0.05,
        "contacts__threshold__relative_width": 0.2,
    },
    "force": FORCE,
    "rigid-load": SLIDERS["rigid"] | LOAD,
    "prescribed-vibrating-load": SLIDERS["prescribed"]
    | {"load": {"normal_force": 1.0, "cycle": {"amplitude": 0.4, "frequency": 200.0}}},
    "rigid-track": SLIDERS["rigid"] | {"contacts__track": {"spread": 0.2, "length": 5e-9}},
    "prescribed-ageing-track": SLIDERS["prescribed"]
    | CONTACTS["ageing"]
    | {"contacts__track": {"spread": 0.2, "length": 5e-9}},
}
# Blocks that are pushed at the edge, until the row has been through whole events.
ROW = {
    **{"kind": "interface", "blocks": 3, "mass": 1.47e-3, "length": 1e-2, "bar_stiffness": 2000.0},
    **{"neighbour_damping": 500.0, "stiffness": 97.0, "damping_ratio": 0.2},
}
# Of one engine alone: contacts one by one, and populations of narrow thresholds, in long steps.
SINGLE: dict[str, dict[str, Any]] = {
    "eq-interface": {"slider": ROW},
    "eq-rigid-keep": SLIDERS["rigid"] | {"contacts__renewal": "keep"},
    "me-rigid-narrow": ENGINES["me"]
    | SLIDERS["rigid"]
    | {"contacts__threshold__relative_width": 0.01},
}

Case = Callable[[], xr.DataTree]


def _run(**changes: Any) -> Case:
    return lambda: mesoslip.run(klein_tables(**changes))


def _without(tables: dict[str, Any], changes: dict[str, Any]) -> dict[str, Any]:
    """Tables without keys of those that are given whole."""
    return {key: one for key, one in tables.items() if key.rpartition("__")[0] not in changes}


def _theory(function: Callable[..., xr.DataTree], **changes: Any) -> Case:
    return lambda: function(
        klein_tables(contacts__threshold__relative_width=0.1, **changes)
        | {"curve": {"length": 3e-8, "tolerance": 1e-6}}
    )


CASES: dict[str, Case] = (
    {
        f"{engine}-{slider}-{contacts}": _run(
            **COMMON, **ENGINES[engine], **SLIDERS[slider], **CONTACTS[contacts]
        )
        for engine, slider, contacts in itertools.product(ENGINES, SLIDERS, CONTACTS)
        if (engine, slider, contacts) not in REFUSED
    }
    | {
        f"{engine}-{name}": _run(**(_without(COMMON, changes) | ENGINES[engine] | changes))
        for engine, (name, changes) in itertools.product(ENGINES, FURTHER.items())
    }
    | {name: _run(**(_without(COMMON, changes) | changes)) for name, changes in SINGLE.items()}
    | {
        f"{function.__name__}-{coupling}": _theory(function, contacts__coupling=coupling)
        for function in (mesoslip.curve, mesoslip.onset)
        for coupling in ("scaled", "equal")
    }
)

# How much of the greatest value in the reference each variable may differ by: another compiler may
# change the last digits, not more.
TOLERANCE = 1e-6
TOLERANCES = {
    # Populations that hardly hold a contact any more are forgotten earlier or later.
    "detached_contacts": 1e-5,
    # What an estimate of an error is, is itself no more exact.
    "force_error": 1e-2,
    "slip_time_error": 1e-2,
    "step_work": 1e-2,
}
# What differs from run to run, and the balance of rounding errors.
NOT_COMPARED = {"kernel_seconds", "energy_residual", "residual"}


@dataclass(frozen=True)
class Difference:
    """A variable that is not that of the reference."""

    group: str
    name: str
    message: str

    def __str__(self) -> str:
        return f"{self.group}{self.name}: {self.message}"


def differences(expected: xr.DataTree, actual: xr.DataTree) -> list[Difference]:
    """All variables of an output that are not those of its reference."""
    return list(_differences(expected, actual))


def _differences(expected: xr.DataTree, actual: xr.DataTree) -> Iterator[Difference]:
    groups = {node.path: node.to_dataset(inherit=False) for node in expected.subtree}
    found = {node.path: node.to_dataset(inherit=False) for node in actual.subtree}
    for group in sorted(groups.keys() ^ found.keys()):
        yield Difference(group, "", f"only in {'reference' if group in groups else 'output'}")
    for group in sorted(groups.keys() & found.keys()):
        old, new = groups[group], found[group]
        prefix = group.rstrip("/") + "/"
        for name in sorted(map(str, old.variables.keys() ^ new.variables.keys())):
            where = "reference" if name in old.variables else "output"
            yield Difference(prefix, name, f"only in the {where}")
        for name in sorted(map(str, old.variables.keys() & new.variables.keys() - NOT_COMPARED)):
            message = _difference(old[name], new[name])
            if message:
                yield Difference(prefix, name, message)


def _difference(expected: xr.DataArray, actual: xr.DataArray) -> str | None:
    """How a variable differs from that of the reference; None if it does not."""
    if expected.shape != actual.shape:
        return f"shape {actual.shape} instead of {expected.shape}"
    if not expected.size:
        return None
    old, new = (one.values.astype(float) for one in (expected, actual))
    known = np.isfinite(old)
    if not np.array_equal(known, np.isfinite(new)):
        return f"{np.count_nonzero(known != np.isfinite(new))} values are missing, or not any more"
    scale = np.max(np.abs(old[known]), initial=0.0)
    part = TOLERANCES.get(str(expected.name), TOLERANCE)
    distance = np.where(known, np.abs(np.where(known, new - old, 0)), 0)
    beyond = distance > part * scale
    if not beyond.any():
        return None
    place = np.unravel_index(np.argmax(distance), distance.shape)
    where = ", ".join(f"{name} {number}" for name, number in zip(expected.dims, place, strict=True))
    unit = expected.attrs.get("units", "1")
    return (
        f"{np.count_nonzero(beyond)} of {beyond.size} values differ by more than {part:g} of "
        f"{scale:.4g} {unit}; most by {distance[place] / (scale or 1):.2g} of it, at {where}: "
        f"{new[place]:.9g} instead of {old[place]:.9g}"
    )


def draw(expected: xr.DataTree, actual: xr.DataTree, path: Path) -> None:
    """Draw the variables of the root that differ, beside those of the reference."""
    names = [
        one.name
        for one in differences(expected, actual)
        if one.group == "/" and one.name in actual.data_vars and one.name in expected.data_vars
    ]
    figure = Figure(figsize=(7, 1 + 2 * max(1, len(names))), layout="constrained")
    for axes, name in zip(
        figure.subplots(max(1, len(names)), squeeze=False)[:, 0], names, strict=False
    ):
        for tree, style in ((expected, "k-"), (actual, "r--")):
            axes.plot(np.ravel(tree[name].values), style, linewidth=0.8)
        axes.set_ylabel(name)
    figure.suptitle("black: reference; red: output")
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path)


def report(name: str, expected: xr.DataTree, actual: xr.DataTree) -> str:
    """What differs, one variable a line, with a picture; empty if nothing does."""
    found = differences(expected, actual)
    if not found:
        return ""
    path = PICTURES / f"{name}.png"
    draw(expected, actual, path)
    return "\n".join([f"{name} (see {path}):", *(f"  {one}" for one in found)])
