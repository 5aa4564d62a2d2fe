"""Variables of a trace in pictures: names, units, and which of them an output has."""

from __future__ import annotations

import math

import numpy as np

from mesoslip.analysis.apparatus import apparatus_of
from mesoslip.configuration.units import from_cf_units
from mesoslip.output.access import config_of, is_measured
from mesoslip.output.arrays import Tree
from mesoslip.output.variables import LOADED, TRACE, force_among

NAMES = {
    "spring_force": "spring force",
    "friction_coefficient": "friction coefficient",
    "elastic_force": "mean elastic force",
    "contact_force": "contact force",
    "velocity": "velocity",
    "detached_contacts": "detached contacts",
    "normal_force": "normal force",
}
# Units of the trace as configurations write them.
UNITS = {name: from_cf_units(one.units) for name, one in (TRACE | LOADED).items()}
UNITS["time"] = "s"


def label_of(tree: Tree, name: str) -> str:
    """Label of a variable; a force of an apparatus without a known spring is not that of one."""
    if name != "spring_force" or 0 < apparatus_of(tree).stiffness < math.inf:
        return NAMES[name]
    return "force" if is_measured(tree) else "driving force"


def is_known(tree: Tree, name: str) -> bool:
    """Whether an output has values of a variable of the trace; a measured trace may lack some."""
    if not is_measured(tree):
        return name != "detached_contacts" or _waits(tree)
    # Files of earlier versions have variables without values.
    return name in tree.data_vars and bool(np.isfinite(tree.to_dataset()[name][0].values).any())


def _waits(tree: Tree) -> bool:
    """Whether contacts of a run stay detached for a time."""
    contacts = config_of(tree).contacts
    return contacts.delay > 0 or not contacts.reattach


def force_of(tree: Tree) -> str:
    """The force that shows the motion: for an elastic slider the mean elastic force."""
    names = tree.data_vars
    return "elastic_force" if "elastic_force" in names else force_among(names)
