"""A measured record: what a file had, and what was made of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class RecordedColumn:
    """A column of the file as it is: its header, its unit as written, its numbers.

    ``use`` is the quantity that it was taken for, empty if none; ``reference`` its name or number.
    """

    header: str
    unit: str
    values: Array
    use: str = ""
    reference: str = ""


@dataclass(frozen=True)
class Record:
    """Samples in SI, at any increasing times.

    Attributes
    ----------
    time
        Times of the samples [s], shape (samples,), increasing.
    force
        Force of the spring [N] or friction coefficient, shape (samples,).
    is_friction
        Whether it is a friction coefficient.
    mean_normal_force
        Mean normal force [N], recorded or given; None if unknown.
    load_point, displacement
        Displacements of the drive and of the slider [m]; None if not recorded. Single samples may
        be NaN, as in the next two.
    normal_force, normal_stress
        Normal force [N] and stress [Pa]; None if not recorded.
    columns
        All columns of numbers of the file, rows that are not used included.
    report
        Lines about what was understood.
    """

    time: Array
    force: Array
    is_friction: bool
    mean_normal_force: float | None = None
    load_point: Array | None = None
    displacement: Array | None = None
    normal_force: Array | None = None
    normal_stress: Array | None = None
    columns: Sequence[RecordedColumn] = ()
    report: Sequence[str] = field(default=())

    @property
    def force_name(self) -> str:
        """Name of the force in outputs."""
        return "friction_coefficient" if self.is_friction else "spring_force"
