"""The response of outputs to their drives, as groups of variables."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from mesoslip.analysis.experiment_stages import Experiment
from mesoslip.analysis.rate_and_state.rows import FIT, fit_rows, fitted_trend
from mesoslip.analysis.response.columns import (
    CREEP,
    CREEP_LINE,
    FRICTION_LINE,
    HEALING_LINE,
    HOLDS,
    LOAD_STEPS,
    RAMPS,
    RESTARTS,
    STEADY,
    STEADY_LINE,
    STEPS,
)
from mesoslip.analysis.response.forces import (
    creep_line,
    creep_rows,
    friction_line,
    ramp_rows,
    restart_rows,
)
from mesoslip.analysis.response.holds import healing_line, hold_rows, steady_line, steady_rows
from mesoslip.analysis.response.line import Line
from mesoslip.analysis.response.steps import load_step_rows, step_rows
from mesoslip.array_types import DataTree
from mesoslip.configuration import arguments
from mesoslip.errors import FileError
from mesoslip.output.arrays import Arrays, Tree, Values, Variable, in_xarray
from mesoslip.output.inputs import OutputLike, distinct, opened_run_arrays, several
from mesoslip.output.table_files import write_table
from mesoslip.output.variables import Group, with_force_unit


class _Rows(NamedTuple):
    """A group of rows: columns, dimension, the rows of an output with a number, and a line through
    them with its scalars."""

    columns: Group
    dimension: str
    rows_of: Callable[[Experiment, int], list[dict[str, Any]]]
    line: Group | None = None
    line_of: Callable[[Arrays], Line | None] | None = None


# Rows of fits are made before those of others, whose trend they remove.
GROUPS = {
    "steady": _Rows(STEADY, "velocity_stage", steady_rows, STEADY_LINE, steady_line),
    "steps": _Rows(STEPS, "step", step_rows),
    "load_steps": _Rows(LOAD_STEPS, "load_step", load_step_rows),
    "holds": _Rows(HOLDS, "hold", hold_rows, HEALING_LINE, healing_line),
    "rate_and_state": _Rows(FIT, "fit", fit_rows),
    "creep": _Rows(CREEP, "force_stage", creep_rows, CREEP_LINE, creep_line),
    "restarts": _Rows(RESTARTS, "restart", restart_rows),
    "ramps": _Rows(RAMPS, "ramp", ramp_rows, FRICTION_LINE, friction_line),
}


@arguments.checked(
    normal_force=arguments.number(0, is_open=True),
    fit=arguments.flag,
    free_stiffness=arguments.flag,
)
def response(
    output: OutputLike | Sequence[OutputLike],
    *,
    normal_force: float | None = None,
    fit: bool = True,
    free_stiffness: bool = False,
) -> DataTree:
    """Steady forces, velocity steps, holds and rate-and-state parameters of one or more outputs.
    See ``docs/response.md``.

    Parameters
    ----------
    output
        Output of a run, or several of them.
    normal_force
        Normal force [N]: forces are also divided by it, as friction coefficients. By default they
        are divided by the static force.
    fit
        Whether rate-and-state parameters are fitted, which takes some seconds.
    free_stiffness
        Whether the stiffness of the spring is fitted too, instead of that of the run; under a
        prescribed slider that of the contacts.

    Returns
    -------
    xarray.DataTree
        Groups ``steady``: the mean force of each stage at constant velocity, with its error;
        ``steps``: direct change, evolution change and relaxation displacement of each velocity
        step; ``load_steps``: direct and transient change of each step of the normal load, and
        its alpha; ``holds``: relaxation, restart peak and healing of each hold; ``rate_and_state``:
        a, b, D_c of each law, and whether the law describes the output; ``creep``, ``restarts`` and
        ``ramps``: of a slider under a force, its velocity in each stage of constant force, the time
        to each restart after a smaller force, and the static friction in each stage in which the
        force grows. Variables have units and long names.

    Raises
    ------
    FileError
        If an output cannot be read, is not of a run, or is of a slider without mass under
        a force.

    Examples
    --------
    >>> import mesoslip
    >>> path, *_ = mesoslip.example("velocity-step")  # writes velocity-step.toml
    >>> config = mesoslip.Config.load(path, ["contacts.count=500", "run.realizations=1"])
    >>> found = mesoslip.response(mesoslip.run(config), fit=False)
    >>> found["steady"]["steady_force"].dims, found["steps"]["net_change"].attrs["units"]
    (('velocity_stage',), 'N')
    """
    return in_xarray(
        response_arrays(
            output, normal_force=normal_force, with_fit=fit, free_stiffness=free_stiffness
        )
    )


def response_arrays(
    output: OutputLike | Sequence[OutputLike],
    *,
    normal_force: float | None = None,
    with_fit: bool = True,
    free_stiffness: bool = False,
) -> Arrays:
    """The same without xarray; see `response`."""
    with ExitStack() as stack:
        experiments = [
            Experiment(
                stack.enter_context(opened_run_arrays(one)),
                os.fspath(one) if isinstance(one, str | os.PathLike) else f"output {number}",
            )
            for number, one in enumerate(distinct(several(output)))
        ]
        return response_of(
            experiments,
            normal_force=normal_force,
            with_fit=with_fit,
            free_stiffness=free_stiffness,
        )


def response_of(
    experiments: Sequence[Experiment],
    *,
    normal_force: float | None = None,
    with_fit: bool = True,
    free_stiffness: bool = False,
) -> Arrays:
    """The `GROUPS` of experiments.

    Forces are also divided by the normal force [N], in variables with the suffix ``_coefficient``;
    by default by the static force, with the suffix ``_ratio``.
    """
    fits: list[dict[str, Any]] = []
    analysed = []
    for number, one in enumerate(experiments):
        has_fit = with_fit and not one.is_forced
        mine = fit_rows(one, number, free_stiffness=free_stiffness) if has_fit else []
        fits += mine
        analysed.append(one.without_trend(fitted_trend(mine)) if one.is_measured else one)
    names = {one.apparatus.force_name for one in experiments}
    if len(names) > 1:
        raise FileError(
            "outputs with forces and with friction coefficients do not go together; read the trace "
            "of coefficients again with --normal-force"
        )
    are_coefficients = names == {"friction_coefficient"}
    parts = {}
    for name, group in GROUPS.items():
        made = (group.rows_of(one, number) for number, one in enumerate(analysed))
        parts[name] = _part(group, fits if name == "rate_and_state" else [*chain(*made)])
    # NaN without a configuration.
    static = {one.static_force for one in experiments}
    attributes: dict[str, Any] = {"outputs": [one.name for one in experiments]}
    scaled: Callable[[Arrays], Arrays] | None = None
    if are_coefficients:
        attributes["force_unit"] = "1"
        scaled = _as_coefficients
    elif normal_force is not None:
        attributes["normal_force"] = normal_force
        scaled = partial(_with_ratios, scale=normal_force, suffix="coefficient", of="normal force")
    elif len(static) == 1 and math.isfinite(force := min(static)):
        attributes["static_force"] = force
        scaled = partial(_with_ratios, scale=force, suffix="ratio", of="static force")
    if scaled is not None:
        parts = {name: scaled(data) for name, data in parts.items()}
    return Arrays({}, {}, attributes, parts)


def _part(group: _Rows, rows: Sequence[Mapping[str, Any]]) -> Arrays:
    """A group of rows, a variable for each column, and the scalars of a line through them."""
    columns: dict[str, Variable] = {
        name: Values(
            (group.dimension,),
            np.array([row[name] for row in rows], dtype=meaning.dtype),
            meaning.attributes,
        )
        for name, meaning in group.columns.items()
    }
    data = Arrays(columns, {group.dimension: len(rows)}, {})
    if group.line is None or group.line_of is None:
        return data
    scalars: dict[str, Variable] = {
        name: Values((), np.asarray(value, dtype=meaning.dtype), meaning.attributes)
        for (name, meaning), value in zip(
            group.line.items(), _scalars(group.line_of(data)), strict=True
        )
    }
    return Arrays({**columns, **scalars}, data.sizes, {})


def _scalars(line: Line | None) -> tuple[float, float, float, int]:
    """The scalars of a line, NaN without a line."""
    if line is None:
        return math.nan, math.nan, math.nan, 0
    return line.slope, line.slope_error, line.chi_square, line.degrees_of_freedom


def ratio_name(name: str, suffix: str) -> str:
    """Name of a force divided by another: the suffix stands before ``_error``."""
    stem = name.removesuffix("_error")
    return f"{stem}_{suffix}{name[len(stem) :]}"


def _with_ratios(data: Arrays, scale: float, suffix: str, of: str) -> Arrays:
    """A group with its forces divided by a force as well."""
    ratios = {
        ratio_name(name, suffix): Values(
            one.dims,
            one.values / scale,
            {"units": "1", "long_name": f"{one.attrs['long_name']}, over the {of}"},
        )
        for name, one in data.items()
        if one.attrs["units"] == "N"
    }
    return Arrays({**data, **ratios}, data.sizes, data.attrs)


def _as_coefficients(data: Arrays) -> Arrays:
    """A group of a trace of friction coefficients: forces have the suffix ``_coefficient``, and
    stiffnesses are inverse lengths."""
    variables = {
        ratio_name(name, "coefficient") if one.attrs["units"] == "N" else name: Values(
            one.dims,
            one.values,
            {**one.attrs, "units": with_force_unit(one.attrs["units"], "1")},
        )
        for name, one in data.items()
    }
    return Arrays(variables, data.sizes, data.attrs)


def rows_of(tree: Tree, name: str) -> list[dict[str, Any]]:
    """The rows of a group of a response, a dictionary for each, without its scalars."""
    data = tree.children[name].to_dataset()
    columns = {one: data[one].values.tolist() for one in map(str, data) if data[one].dims}
    return [
        dict(zip(columns, values, strict=True)) for values in zip(*columns.values(), strict=True)
    ]


def scalars_of(tree: Tree, name: str) -> dict[str, Any]:
    """The scalars of a group of a response."""
    data = tree.children[name].to_dataset()
    return {one: data[one].values.item() for one in map(str, data) if not data[one].dims}


def write_csv(tree: Tree, path: Path) -> None:
    """Write a response as one table with a row for each stage, and for each step of the load in it.

    A stage at constant velocity has the columns of ``steady``, and those of ``steps`` if it starts
    with a step; a hold has those of ``holds``, a constant force those of ``creep`` and, after a
    smaller one, of ``restarts``, a growing one those of ``ramps``. The notes on steps and restarts
    have columns of their own. Steps of the normal load have rows of their own after that of their
    stage, with the columns of ``load_steps``.
    """
    own_notes = {"restarts": "restart_note", "steps": "step_note"}
    units: dict[str, str] = {}
    table: dict[tuple[int, int, int], dict[str, Any]] = {}
    for name in ("steady", "holds", "creep", "restarts", "ramps", "steps", "load_steps"):
        data = tree.children[name].to_dataset()
        for number, row in enumerate(rows_of(tree, name), 1):
            own = number if name == "load_steps" else 0
            here = table.setdefault((row["output_index"], row["stage_number"], own), {})
            for column, value in row.items():
                key = own_notes.get(name, column) if column == "note" else column
                here[key] = None if value != value else value
                units[key] = data[column].attrs["units"]
    write_table([table[key] for key in sorted(table)], units, path)
