"""The sections in the report of each kind of output, in their order.

Adding one is adding its function to a file of this folder, and to the kinds of output that have it.
"""

from __future__ import annotations

from mesoslip.output.arrays import Arrays
from mesoslip.output.kinds import KINDS, kind_of
from mesoslip.plots.views import takes_arrays as view_takes_arrays
from mesoslip.reports.content import Writer
from mesoslip.reports.sections.catalogues import avalanches, slips, strokes
from mesoslip.reports.sections.motion import energy, regime, response
from mesoslip.reports.sections.origin import changes, configuration, methods, provenance
from mesoslip.reports.sections.parameters import parameters, rates
from mesoslip.reports.sections.pictures import pictures
from mesoslip.reports.sections.sweep import maps, sweep
from mesoslip.reports.sections.theory import curve, cycle, lyapunov, onset


def _with(*own: Writer) -> tuple[Writer, ...]:
    """The sections that most kinds of output have, and others after the pictures."""
    return (changes, pictures, *own, methods, configuration, provenance)


SECTIONS: dict[str, tuple[Writer, ...]] = dict.fromkeys(KINDS, _with()) | {
    "run": (
        changes,
        regime,
        pictures,
        slips,
        strokes,
        avalanches,
        response,
        energy,
        methods,
        configuration,
        provenance,
    ),
    "sweep": (sweep, maps, methods, provenance),
    "cycle": _with(cycle),
    "curve": _with(curve),
    "onset": _with(onset),
    "lyapunov": _with(lyapunov),
    "rates": (rates, methods, provenance),
    "fit": (parameters, methods, configuration, provenance),
}


def takes_arrays(tree: Arrays) -> bool:
    """Whether the sections about an output need no xarray: those of a run without avalanches,
    layers or snapshots."""
    return (
        kind_of(tree) == "run"
        and view_takes_arrays(tree, None)
        and not {"avalanches", "snapshots"} & tree.children.keys()
        and "layer_displacement" not in tree
    )
