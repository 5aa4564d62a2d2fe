"""The reference of outputs, made from the meanings of their variables."""

from __future__ import annotations

import numpy as np
from mesoslip.output import variables
from mesoslip.output.variables import Group

INTRODUCTION = """\
# Output

Outputs are netCDF-4 files, with CF and ACDD attributes; [xarray](../../how-to/read-an-output.md)
opens them, as does any other netCDF reader. Every variable has units. This page is generated
from the definitions in the program; which variables an output has depends on its slider, contacts
and keys.

Catalogues (slips, stages, avalanches, snapshots, finer traces) are CF's *indexed ragged arrays*:
rows of all realizations one after another, each with its `realization_index`. Missing samples,
such as those after the end of a shorter realization, are NaN.

Attributes of the root are the whole configuration (`configuration`, TOML with plain SI numbers)
and its base (`base_configuration`), `seed`, versions of program, compiler and
libraries, counts of events, `energy_residual`, `ending`, and the wall time. `mesoslip run OUT.nc`
repeats the run of an output.
"""

# Groups in the order of the page: name, variables, dimensions and meaning.
GROUPS: tuple[tuple[str, Group, str], ...] = (
    ("Root: traces", variables.TRACE, "Dimensions `realization`, `time`."),
    (
        "Root: all else",
        Group({k: v for k, v in variables.ROOT.items() if k not in variables.TRACE}),
        "Coordinates, numbers of each realization, and traces of layers (`realization`, `time`, "
        "`layer`).",
    ),
    (
        "Group slips",
        variables.SLIPS,
        "Dimension `slip`. A slip is an interval in which contacts break and the slider moves "
        "farther than it rings.",
    ),
    ("Group stages", variables.STAGES, "Dimension `stage`: forces of each stage of the drive."),
    (
        "Group stages of a measured trace",
        variables.MEASURED_STAGES,
        "Dimension `stage`: stages that were found in the recorded load point.",
    ),
    (
        "Group slips of a measured trace",
        Group({k: v for k, v in variables.MEASURED_SLIPS.items() if k not in variables.SLIPS}),
        "Further columns. Forces of friction coefficients have the unit 1.",
    ),
    (
        "Group slip_counts",
        variables.SLIP_COUNTS,
        "Dimension `threshold`: how the number of slips of a measured trace depends on the minimum "
        "fall. Attributes: the one that is used, and the plateau.",
    ),
    (
        "Group noise",
        variables.NOISE,
        "Noise of a measured trace ([estimates](../../traces.md#noise-of-a-trace)): numbers, and "
        "the dimensions `impulse` and `line`.",
    ),
    (
        "Group slip_traces",
        variables.SLIP_TRACES,
        "Dimension `sample`: the trace at `output.slip_interval` during slips.",
    ),
    (
        "Group blocks",
        variables.BLOCKS,
        "Dimensions `realization`, `time`, `block`: the blocks of an "
        "[interface with a length](../../interface.md) at the samples of the trace.",
    ),
    (
        "Group ruptures",
        variables.RUPTURES,
        "Dimension `rupture`: slips of blocks in which half of the pinned contacts broke.",
    ),
    (
        "Group fronts",
        variables.FRONTS,
        "Dimension `front`: fronts that detached an interface, from where they began on.",
    ),
    ("Group energy", variables.ENERGY, "Dimension `realization`: the terms of the energy balance."),
    ("Group avalanches", variables.AVALANCHES, "Dimension `avalanche`."),
    (
        "Group snapshots",
        variables.SNAPSHOTS,
        "Dimensions `snapshot`, `contact`, on a lattice `snapshot`, `row`, `column`.",
    ),
    (
        "mesoslip curve: root",
        variables.CURVE,
        "Dimension `displacement`. Attributes: `K_star`, `X_c`, `F_peak`, `F_steady`, `D0` to "
        "`D3`, `stable`.",
    ),
    (
        "mesoslip curve: group critical",
        variables.CRITICAL,
        "Dimension `point`: where F′ = −K, lowest displacement first.",
    ),
    (
        "mesoslip curve: group stretch_density",
        variables.STRETCHES,
        "The densities at the displacements of `curve.density_at`.",
    ),
    (
        "mesoslip curve: group track",
        variables.TRACK_RESPONSE,
        "With `contacts.track`: the linear response of slow sliding, over `wavenumber`. Attribute: "
        "`force_deviation` [N], the standard deviation of the force along the track.",
    ),
    (
        "mesoslip curve of contacts that age or creep: root",
        variables.STEADY,
        "Dimension `velocity`: [steady sliding](../../steady-sliding.md) over velocity; the "
        "attribute `boundaries` has the velocities at which it gains or loses stability.",
    ),
    (
        "mesoslip onset: groups sequential and melting",
        variables.ONSET,
        "The onset of slip by Eqs. S46 and S47 of the source, without dimensions.",
    ),
    (
        "mesoslip cycle: root",
        variables.CYCLE,
        "Dimensions `passage` and `multiplier`: the settled [cycle](../../cycles.md). Group "
        "`state` has the state at the section, from which another `cycle` can start.",
    ),
    (
        "mesoslip cycle: group trace",
        variables.CYCLE_TRACE,
        "Dimension `time`: the samples of one cycle.",
    ),
    (
        "mesoslip cycle --continue: root",
        variables.BRANCHES,
        "Dimensions `direction` (up, down) and the continued key; `steady_force` and `growth_rate` "
        "have the key alone.",
    ),
    (
        "mesoslip lyapunov",
        variables.LYAPUNOV,
        "Growth of the distance between a run and its twins "
        "([Lyapunov exponents](../../ageing.md)), and peaks of slips.",
    ),
)


def output_page() -> str:
    """All groups with their variables."""
    parts = [INTRODUCTION]
    for title, group, what in GROUPS:
        parts += [
            f"## {title}",
            "",
            what,
            "",
            "| variable | units | type | meaning |",
            "|---|---|---|---|",
        ]
        for name, meaning in group.items():
            kind = str(np.dtype(meaning.dtype))
            if meaning.is_fractional:
                kind += ", float64 with engine `me`"
            units = meaning.units.replace("-1", "⁻¹").replace("-2", "⁻²").replace("-3", "⁻³")
            parts.append(f"| `{name}` | {units} | {kind} | {meaning.long_name} |")
        parts.append("")
    return "\n".join(parts)
