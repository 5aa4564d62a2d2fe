"""Tables of a response, as those who measure friction have them."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import xarray as xr

from mesoslip.analysis.response import rows_of, scalars_of

Row = Mapping[str, Any]
Shown = Callable[[Row], str]

# What is not known.
NOTHING = "-"


@dataclass(frozen=True)
class ResponseTable:
    """A table: its columns, its rows with a note on each, and what a line through it says.

    Attributes
    ----------
    title
        What its rows are.
    head
        Names of columns.
    rows
        Texts, as many in each as there are columns.
    notes
        One for each row; empty if there is nothing to say.
    line
        Slope of the line through the rows, if there is one.
    """

    title: str
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    notes: tuple[str, ...]
    line: str = ""


def unit_of_forces(tree: xr.DataTree) -> str:
    """What the forces of the tables are told over, as a sentence."""
    if "normal_force" in tree.attrs:
        return f"Forces over the normal force, {tree.attrs['normal_force']:.6g} N."
    if "static_force" in tree.attrs:
        return f"Forces over the static force, {tree.attrs['static_force']:.6g} N."
    return "Forces in N, as the outputs have different static forces."


def tables(tree: xr.DataTree) -> list[ResponseTable]:
    """Tables of a response (`mesoslip.analysis.response.response`); those without rows left out."""
    if "normal_force" in tree.attrs:
        suffix, unit = "_coefficient", ""
    elif "static_force" in tree.attrs:
        suffix, unit = "_ratio", ""
    else:
        suffix, unit = "", " N"
    lines = {
        "steady": ("rate_dependence", f"change of the force with ln V{unit}"),
        "holds": ("healing_per_decade", f"healing per decade of hold time{unit}"),
    }
    result = []
    for name, (title, columns) in _columns(suffix, len(tree.attrs["outputs"]) > 1).items():
        rows = rows_of(tree, name)
        if not rows:
            continue
        line = _line(scalars_of(tree, name), *lines[name], suffix) if name in lines else ""
        result.append(
            ResponseTable(
                title,
                tuple(columns),
                tuple(tuple(shown(row) for shown in columns.values()) for row in rows),
                tuple(str(row["note"]) for row in rows),
                line,
            )
        )
    return result


def _columns(suffix: str, several: bool) -> dict[str, tuple[str, dict[str, Shown]]]:
    """Of each group, its title, and what its columns show of a row."""
    output = {"output": _word("output_index")} if several else {}
    stage = output | {"stage": _word("stage_number")}

    def force(name: str) -> Shown:
        return _number(f"{name}{suffix}", f"{name}_error{suffix}")

    return {
        "steady": (
            "Steady sliding",
            stage
            | {
                "um/s": _plain("velocity", 1e6),
                "force": force("steady_force"),
                "95 % half width": force("steady_force_half_width"),
                "independent": _plain("effective_sample_count", 1),
                "transient s": _plain("transient_time", 1),
                "in slips": _plain("slip_share", 1),
            },
        ),
        "steps": (
            "Velocity steps",
            stage
            | {
                "from um/s": _plain("velocity_before", 1e6),
                "to": _plain("velocity_after", 1e6),
                "net": force("net_change"),
                "direct": force("direct_change"),
                "evolving": force("evolving_change"),
                "decay nm": _plain("relaxation_displacement", 1e9),
                "area nm": _plain("integral_displacement", 1e9),
                "overshoot": force("overshoot"),
            },
        ),
        "holds": (
            "Holds",
            stage
            | {
                "hold s": _plain("hold_time", 1),
                "before": force("force_before"),
                "drop": force("drop"),
                "peak": force("peak_force"),
                "healing": force("healing"),
                "slip to peak nm": _plain("slip_to_peak", 1e9),
            },
        ),
        "rate_and_state": (
            "Rate and state",
            output
            | {
                "law": _word("law"),
                "a": force("a"),
                "b": force("b"),
                "D_c nm": _plain("slip_distance", 1e9),
                "K N/m": _plain("stiffness", 1),
                "misses": _plain("relative_misfit", 1),
                "noise p": _plain("fit_p_value", 1),
            },
        ),
    }


def _word(name: str) -> Shown:
    return lambda row: str(row[name])


def _plain(name: str, scale: float) -> Shown:
    return _number(name, f"{name}_error", scale)


def _number(name: str, error_name: str, scale: float = 1.0) -> Shown:
    """A number with its error, if that is known and not zero."""

    def shown(row: Row) -> str:
        text, error = _short(scale * row[name]), scale * row.get(error_name, math.nan)
        is_exact = math.isnan(error) or error == 0
        return text if is_exact or text == NOTHING else f"{text} ± {error:.2g}"

    return shown


def _line(scalars: Mapping[str, Any], name: str, meaning: str, suffix: str) -> str:
    """The slope of a line, if there is one."""
    slope = scalars[f"{name}{suffix}"]
    if math.isnan(slope):
        return ""
    error, square = scalars[f"{name}_error{suffix}"], scalars[f"{name}_chi_square"]
    shown = "" if math.isnan(error) else f" ± {error:.2g}"
    if not math.isnan(square) and scalars[f"{name}_freedom"]:
        shown += f" (chi square {square:.3g} of {scalars[f'{name}_freedom']})"
    return f"{meaning}: {slope:.4g}{shown}"


def _short(value: float) -> str:
    return NOTHING if math.isnan(value) else f"{value:.4g}"
