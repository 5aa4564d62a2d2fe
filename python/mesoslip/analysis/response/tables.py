"""Printed tables of a response: one unit a column, values with the digits of their errors."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from mesoslip.analysis.response.dataset import ratio_name, rows_of, scalars_of
from mesoslip.output.arrays import Tree
from mesoslip.output.table_files import PrintedTable
from mesoslip.quantities import column, probability, with_error, with_unit

Row = Mapping[str, Any]


@dataclass(frozen=True)
class ResponseTable(PrintedTable):
    """A table of a response, with a note on each row, and the slope of its line in words."""

    notes: tuple[str, ...]
    line: str = ""


@dataclass(frozen=True)
class _Column:
    """A column: header, name of the variable, and SI unit, without which values are texts.

    Values have the digits of the errors, and share unit and decimals with the variables ``beside``
    it. An optional column without values is left out. Numbers of stages are -1 for all of them.
    """

    header: str
    name: str
    unit: str = ""
    error: str = ""
    beside: tuple[str, ...] = ()
    digits: int = 4
    is_optional: bool = False
    is_stage: bool = False

    def is_empty(self, rows: Sequence[Row]) -> bool:
        """Whether the column is left out: it may be, and says nothing."""
        if self.is_stage:
            return all(row[self.name] < 0 for row in rows)
        return self.is_optional and all(math.isnan(row[self.name]) for row in rows)

    def cells(self, rows: Sequence[Row]) -> tuple[str, ...]:
        values = [row[self.name] for row in rows]
        if self.is_stage:
            return (self.header, *("all" if one < 0 else str(one) for one in values))
        if not self.unit:
            return (self.header, *map(str, values))
        alike = [row[name] for name in self.beside for row in rows]
        shown = column([*values, *alike], self.unit, self.digits)
        errors = [row.get(self.error, math.nan) for row in rows]
        return (shown.head(self.header), *map(shown.text, values, errors))


@dataclass(frozen=True)
class _Probability(_Column):
    """A column of probabilities, of which small ones are bounds."""

    def cells(self, rows: Sequence[Row]) -> tuple[str, ...]:
        return (self.header, *(probability(row[self.name]) for row in rows))


@dataclass(frozen=True)
class _Difference(_Column):
    """A column of differences from the minimum of the rows of the same output and stage."""

    def cells(self, rows: Sequence[Row]) -> tuple[str, ...]:
        least: dict[tuple[int, int], float] = {}
        keys = [(row["output_index"], row["stage_number"]) for row in rows]
        for key, row in zip(keys, rows, strict=True):
            least[key] = float(np.fmin(least.get(key, math.nan), row[self.name]))
        differences = [
            {**row, self.name: row[self.name] - least[key]}
            for key, row in zip(keys, rows, strict=True)
        ]
        return super().cells(differences)


@dataclass(frozen=True)
class _Stiffness(_Column):
    """A column of stiffnesses, left out if all are infinite."""

    def is_empty(self, rows: Sequence[Row]) -> bool:
        return all(math.isinf(row[self.name]) for row in rows)


def force_scale(tree: Tree) -> str:
    """A sentence on the scale of the forces in the tables."""
    if "force_unit" in tree.attrs:
        return "Forces are friction coefficients."
    if "normal_force" in tree.attrs:
        return f"Forces are divided by the normal force, {_size(tree.attrs['normal_force'])}."
    if "static_force" in tree.attrs:
        return f"Forces are divided by the static force, {_size(tree.attrs['static_force'])}."
    return "Forces are not divided by a static force, which is unknown or differs between outputs."


def _size(force: float) -> str:
    return with_unit(force, "N", 6)


def tables(tree: Tree) -> list[ResponseTable]:
    """Tables of the result of `mesoslip.response`, without the empty ones."""
    suffix = (
        "coefficient"
        if tree.attrs.keys() & {"normal_force", "force_unit"}
        else "ratio"
        if "static_force" in tree.attrs
        else ""
    )
    lines = {
        "steady": ("rate_dependence", "rate dependence a - b (slope over ln V)"),
        "holds": ("healing_per_decade", "healing per decade of hold time"),
        "creep": ("creep_rate_dependence", "rate dependence a - b (slope of the force over ln V)"),
        "ramps": (
            "friction_rate_dependence",
            "rate dependence of static friction (slope over ln of the force rate)",
        ),
    }
    result = []
    several = len(tree.attrs["outputs"]) > 1
    stiffness = "1/m" if "force_unit" in tree.attrs else "N/m"
    for name, (title, columns) in _columns(suffix, several, stiffness).items():
        rows = rows_of(tree, name)
        if not rows:
            continue
        used = [one for one in columns if not one.is_empty(rows)]
        head, *cells = zip(*(one.cells(rows) for one in used), strict=True)
        line = _line(scalars_of(tree, name), *lines[name], suffix) if name in lines else ""
        notes = tuple(str(row["note"]) for row in rows)
        result.append(ResponseTable(title, head, tuple(cells), notes, line))
    return result


def _columns(
    suffix: str, several: bool, stiffness: str
) -> dict[str, tuple[str, tuple[_Column, ...]]]:
    """Title and columns of the table of each group; the last is the unit of stiffnesses."""
    outputs = (_Column("output", "output_index"),) if several else ()
    stages = (*outputs, _Column("stage", "stage_number"))

    def force(header: str, name: str, digits: int = 4, *, is_optional: bool = False) -> _Column:
        error = f"{name}_error"
        if not suffix:
            return _Column(header, name, "N", error, digits=digits, is_optional=is_optional)
        name, error = (ratio_name(one, suffix) for one in (name, error))
        return _Column(header, name, "1", error, digits=digits, is_optional=is_optional)

    def length(header: str, name: str, beside: str = "") -> _Column:
        return _Column(header, name, "m", f"{name}_error", (beside,) if beside else ())

    return {
        "steady": (
            "Steady sliding",
            (
                *stages,
                _Column("velocity", "velocity", "m/s"),
                force("steady force", "steady_force"),
                force("95 % half-width", "steady_force_half_width", 3),
                _Column("independent samples", "effective_sample_count", "1"),
                _Column("transient", "transient_time", "s"),
                _Column("slip share", "slip_share", "1", digits=2),
            ),
        ),
        "steps": (
            "Velocity steps",
            (
                *stages,
                _Column("from", "velocity_before", "m/s", beside=("velocity_after",)),
                _Column("to", "velocity_after", "m/s", beside=("velocity_before",)),
                force("net change", "net_change"),
                force("direct change", "direct_change"),
                force("evolution change", "evolution_change"),
                length("relaxation", "relaxation_displacement", "integral_displacement"),
                length("integral", "integral_displacement", "relaxation_displacement"),
                force("overshoot", "overshoot"),
            ),
        ),
        "load_steps": (
            "Steps of the normal load",
            (
                *stages,
                _Column("from", "normal_force_before", "N", beside=("normal_force_after",)),
                _Column("to", "normal_force_after", "N", beside=("normal_force_before",)),
                force("direct change", "direct_change"),
                force("transient change", "transient_change"),
                _Column("alpha", "alpha", "1", "alpha_error"),
                _Column("rise", "rise_displacement", "m"),
                length("relaxation", "relaxation_displacement"),
            ),
        ),
        "holds": (
            "Holds",
            (
                *stages,
                _Column("hold time", "hold_time", "s"),
                force("force before", "force_before"),
                force("drop", "drop"),
                force("peak", "peak_force"),
                force("healing", "healing"),
                length("slip to peak", "slip_to_peak"),
            ),
        ),
        "creep": (
            "Creep under a constant force",
            (
                *stages,
                force("force", "force"),
                _Column("velocity", "velocity", "m/s", "velocity_error"),
                _Column("displacement", "displacement", "m"),
                _Column("transient", "transient_time", "s"),
            ),
        ),
        "restarts": (
            "Restarts under a constant force",
            (
                *stages,
                force("force", "force"),
                _Column("hold time", "hold_time", "s"),
                force("hold force", "hold_force"),
                _Column("time to restart", "restart_time", "s", "restart_time_error"),
            ),
        ),
        "ramps": (
            "Static friction under a growing force",
            (
                *stages,
                _Column("force rate", "force_rate", "N/s", digits=3),
                _Column("hold time", "hold_time", "s", is_optional=True),
                force("static friction", "static_friction"),
                _Column("time to slide", "slide_time", "s", digits=3),
                _Column("displacement", "displacement", "m", digits=3),
            ),
        ),
        "rate_and_state": (
            "Rate and state",
            (
                *outputs,
                _Column("stage", "stage_number", is_stage=True),
                _Column("law", "law"),
                force("a", "a"),
                force("b", "b"),
                length("D_c", "slip_distance", "slip_distance2"),
                force("b2", "b2", is_optional=True),
                _Column(
                    "D_c2",
                    "slip_distance2",
                    "m",
                    "slip_distance2_error",
                    ("slip_distance",),
                    is_optional=True,
                ),
                force("a - b", "a_minus_b"),
                _Stiffness("stiffness", "stiffness", stiffness, "stiffness_error"),
                _Column("misfit", "relative_misfit", "1", digits=2),
                _Probability("p", "fit_p_value"),
                _Probability("runs p", "runs_p_value"),
                _Difference("ΔAIC", "information_criterion", "1", digits=3),
                _Column("verdict", "verdict"),
            ),
        ),
    }


def _line(scalars: Mapping[str, Any], name: str, meaning: str, suffix: str) -> str:
    """The slope of a line as a sentence; empty without one."""
    names = (ratio_name(one, suffix) if suffix else one for one in (name, f"{name}_error"))
    slope, error = (scalars[one] for one in names)
    if math.isnan(slope):
        return ""
    freedom, square = scalars[f"{name}_freedom"], scalars[f"{name}_chi_square"]
    text = f"{meaning}: {with_error(slope, error, '1' if suffix else 'N')}"
    if not math.isnan(square) and freedom:
        ending = "s" if freedom > 1 else ""
        text += f" (chi square {square:.3g} with {freedom} degree{ending} of freedom)"
    return text
