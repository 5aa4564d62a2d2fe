"""The reference of outputs, made from the meanings of their variables."""

from __future__ import annotations

import numpy as np
from mesoslip.output import variables
from mesoslip.output.variables import Group

INTRODUCTION = """\
# Output

Outputs are netCDF-4 files, with CF and ACDD attributes; [xarray](../../how-to/read-an-output.md)
opens them, as does anything else that reads netCDF. Every variable has units. This page is made
from the table that `mesoslip` writes outputs by; an output has those that its slider, contacts
and keys bring about.

Catalogues (slips, stages, avalanches, snapshots, finer traces) are CF's *indexed ragged arrays*:
rows of all realizations one after another, each with its `realization_index`. What has not been
recorded, as after the end of a realization that was over before the others, is NaN.

Attributes of the root tell the whole configuration (`configuration`, TOML with plain SI numbers)
and what it was laid over (`base_configuration`), `seed`, versions of program, compiler and
libraries, counts of events, `energy_residual`, `ending`, and the wall time. `mesoslip run OUT.nc`
repeats the run of an output.
"""

# Groups in the order in which they are told: name, dimensions, what it is.
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
        "Dimension `slip`. A slip is a time in which contacts break and the block travels by more "
        "than it rings.",
    ),
    ("Group stages", variables.STAGES, "Dimension `stage`: what each stage of the drive came to."),
    (
        "Group slip_traces",
        variables.SLIP_TRACES,
        "Dimension `sample`: the trace at `output.slip_interval` during slips.",
    ),
    ("Group energy", variables.ENERGY, "Dimension `realization`: the terms of the energy balance."),
    ("Group avalanches", variables.AVALANCHES, "Dimension `avalanche`."),
    (
        "Group snapshots",
        variables.SNAPSHOTS,
        "Dimensions `snapshot`, `row`, `column`: the contacts on their lattice.",
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
    ("mesoslip curve: group stretches", variables.STRETCHES, "What `curve.density_at` asks for."),
    (
        "mesoslip onset: groups sequential and melting",
        variables.ONSET,
        "The onset of slip by Eqs. S46 and S47 of the source, without dimensions.",
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
