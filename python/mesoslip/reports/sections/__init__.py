"""The sections in the report of each kind of output, in their order.

A new section is a file in this folder and a line in `SECTIONS`; a new kind of output is a line in
`mesoslip.output.kinds.KINDS` and one here.
"""

from __future__ import annotations

from mesoslip.output.arrays import Arrays
from mesoslip.output.kinds import kind_of
from mesoslip.plots.views import takes_arrays as view_takes_arrays
from mesoslip.reports.content import Writer
from mesoslip.reports.sections.avalanches import avalanches
from mesoslip.reports.sections.changes import changes
from mesoslip.reports.sections.configuration import configuration
from mesoslip.reports.sections.energy import energy
from mesoslip.reports.sections.lyapunov import lyapunov
from mesoslip.reports.sections.methods import methods
from mesoslip.reports.sections.parameters import parameters
from mesoslip.reports.sections.pictures import pictures
from mesoslip.reports.sections.provenance import provenance
from mesoslip.reports.sections.regime import regime
from mesoslip.reports.sections.response import response
from mesoslip.reports.sections.slips import slips
from mesoslip.reports.sections.sweep import maps, sweep
from mesoslip.reports.sections.theory import curve, cycle, onset

SECTIONS: dict[str, tuple[Writer, ...]] = {
    "run": (
        changes,
        regime,
        pictures,
        slips,
        avalanches,
        response,
        energy,
        methods,
        configuration,
        provenance,
    ),
    "sweep": (sweep, maps, methods, provenance),
    "cycle": (changes, pictures, cycle, methods, configuration, provenance),
    "branches": (changes, pictures, methods, configuration, provenance),
    "curve": (changes, pictures, curve, methods, configuration, provenance),
    "steady": (changes, pictures, methods, configuration, provenance),
    "onset": (changes, pictures, onset, methods, configuration, provenance),
    "lyapunov": (changes, pictures, lyapunov, methods, configuration, provenance),
    "fit": (parameters, methods, configuration, provenance),
}


def takes_arrays(tree: Arrays) -> bool:
    """Whether the sections about an output need no xarray: those of a run without avalanches, and
    without pictures of layers or snapshots."""
    return (
        kind_of(tree) == "run"
        and view_takes_arrays(tree, None)
        and not {"avalanches", "snapshots"} & tree.children.keys()
        and "layer_displacement" not in tree
    )
