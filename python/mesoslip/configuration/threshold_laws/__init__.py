"""Threshold laws: a file each, with its `ThresholdLawKind` in the variable ``LAW``.

Adding one is adding a file to this folder and its name to the build, and the same in the kernels
(`fortran/contacts/threshold_laws`).
"""

from __future__ import annotations

import pkgutil
from importlib import import_module

from mesoslip.configuration.threshold_laws.base import ThresholdLawKind

_KINDS: list[ThresholdLawKind] = [
    import_module(f"{__name__}.{file.name}").LAW
    for file in pkgutil.iter_modules(__path__)
    if file.name != "base"
]
LAWS = {kind.name: kind for kind in _KINDS}
