"""``mesoslip response``."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from mesoslip.command_line.options import JsonOption, print_json


def response(
    outputs: Annotated[
        list[Path], typer.Argument(help="Outputs of mesoslip run", metavar="OUT.nc...")
    ],
    table: Annotated[
        Path | None,
        typer.Option("--csv", help="Write a table with a row for each stage", metavar="FILE"),
    ] = None,
    as_json: JsonOption = False,
    normal_force: Annotated[
        str | None,
        typer.Option(
            help="Tell friction coefficients, forces over this one, such as '10 mN'",
            metavar="FORCE",
        ),
    ] = None,
    fit: Annotated[bool, typer.Option(help="Fit rate-and-state parameters")] = True,
    free_stiffness: Annotated[
        bool, typer.Option("--free-stiffness", help="Fit the stiffness of the spring as well")
    ] = False,
) -> None:
    """Show steady forces, velocity steps, holds, and rate-and-state parameters."""
    from mesoslip import api
    from mesoslip.analysis.response import rows_of, scalars_of, write_csv
    from mesoslip.output import files

    scale = None if normal_force is None else _force(normal_force)
    if table is not None:
        files.check_writable(table, outputs)
    tree = api.response(outputs, normal_force=scale, fit=fit, free_stiffness=free_stiffness)
    if table is not None:
        write_csv(tree, table)
    groups = {str(name): rows_of(tree, str(name)) for name in tree.children}
    scalars = {name: value for group in groups for name, value in scalars_of(tree, group).items()}
    if as_json:
        names = {one: tree.attrs[one] for one in ("outputs", "normal_force") if one in tree.attrs}
        print_json(names | groups | scalars)
        return
    _show(groups, scalars, tree.attrs, several=len(outputs) > 1)


def _force(text: str) -> float:
    """A force given to an option [N]."""
    from mesoslip.configuration.units import to_si
    from mesoslip.errors import ConfigError, Problem

    try:
        force = to_si(text, "N", "10 mN")
        if force <= 0:
            raise ValueError("must be greater than 0; expected a quantity such as '10 mN'")
    except ValueError as error:
        raise ConfigError([Problem("", "--normal-force", str(error), text)]) from None
    return force


def _show(
    groups: dict[str, list[dict[str, Any]]],
    scalars: dict[str, Any],
    attributes: Mapping[Any, Any],
    several: bool,
) -> None:
    """Tables as those who measure friction have them."""
    if "normal_force" in attributes:
        suffix, unit = "_coefficient", ""
        typer.echo(f"Forces over the normal force, {attributes['normal_force']:.6g} N.")
    elif "static_force" in attributes:
        suffix, unit = "_ratio", ""
        typer.echo(f"Forces over the static force, {attributes['static_force']:.6g} N.")
    else:
        suffix, unit = "", " N"
        typer.echo("Forces in N, as the outputs have different static forces.")

    def value(row: dict[str, Any], name: str) -> str:
        """A force with its error."""
        error = row.get(f"{name}_error{suffix}", math.nan)
        shown = _short(row[f"{name}{suffix}"])
        return shown if math.isnan(error) or shown == "-" else f"{shown} ± {error:.2g}"

    def plain(name: str, scale: float) -> Any:
        def shown(row: dict[str, Any]) -> str:
            text = _short(scale * row[name])
            error = row.get(f"{name}_error", math.nan)
            is_exact = math.isnan(error) or error == 0
            return text if is_exact or text == "-" else f"{text} ± {scale * error:.2g}"

        return shown

    def force(name: str) -> Any:
        return lambda row: value(row, name)

    def word(name: str) -> Any:
        return lambda row: str(row[name])

    first = {"output": word("output_index")} if several else {}
    first |= {"stage": word("stage_number")}
    tables: dict[str, tuple[str, dict[str, Any]]] = {
        "steady": (
            "Steady sliding",
            first
            | {
                "um/s": plain("velocity", 1e6),
                "force": force("steady_force"),
                "95 % half width": force("steady_force_half_width"),
                "independent": plain("effective_sample_count", 1),
                "transient s": plain("transient_time", 1),
                "in slips": plain("slip_share", 1),
            },
        ),
        "steps": (
            "Velocity steps",
            first
            | {
                "from um/s": plain("velocity_before", 1e6),
                "to": plain("velocity_after", 1e6),
                "net": force("net_change"),
                "direct": force("direct_change"),
                "evolving": force("evolving_change"),
                "decay nm": plain("relaxation_displacement", 1e9),
                "area nm": plain("integral_displacement", 1e9),
                "overshoot": force("overshoot"),
            },
        ),
        "holds": (
            "Holds",
            first
            | {
                "hold s": plain("hold_time", 1),
                "before": force("force_before"),
                "drop": force("drop"),
                "peak": force("peak_force"),
                "healing": force("healing"),
                "slip to peak nm": plain("slip_to_peak", 1e9),
            },
        ),
        "rate_and_state": (
            "Rate and state",
            ({"output": word("output_index")} if several else {})
            | {
                "law": word("law"),
                "a": force("a"),
                "b": force("b"),
                "D_c nm": plain("slip_distance", 1e9),
                "K N/m": plain("stiffness", 1),
                "misses": plain("relative_misfit", 1),
                "noise p": plain("fit_p_value", 1),
            },
        ),
    }
    for name, (title, columns) in tables.items():
        if groups[name]:
            typer.echo(f"\n{title}")
            _table(groups[name], columns)
        if name == "steady":
            _line(scalars, "rate_dependence", f"change of the force with ln V{unit}", suffix)
        if name == "holds":
            _line(scalars, "healing_per_decade", f"healing per decade of hold time{unit}", suffix)


def _line(scalars: dict[str, Any], name: str, meaning: str, suffix: str) -> None:
    """The slope of a line, if there is one."""
    slope = scalars[f"{name}{suffix}"]
    if math.isnan(slope):
        return
    error, square = scalars[f"{name}_error{suffix}"], scalars[f"{name}_chi_square"]
    shown = "" if math.isnan(error) else f" ± {error:.2g}"
    if not math.isnan(square) and scalars[f"{name}_freedom"]:
        shown += f" (chi square {square:.3g} of {scalars[f'{name}_freedom']})"
    typer.echo(f"{meaning}: {slope:.4g}{shown}")


def _short(value: float) -> str:
    """A number in a table; a dash for one that is not known."""
    return "-" if math.isnan(value) else f"{value:.4g}"


def _table(rows: list[dict[str, Any]], columns: dict[str, Any]) -> None:
    """Print rows under the names of their columns, with their notes below."""
    cells = [[show(row) for show in columns.values()] for row in rows]
    widths = [
        max(len(name), *(len(row[place]) for row in cells)) for place, name in enumerate(columns)
    ]
    header = "  ".join(name.rjust(width) for name, width in zip(columns, widths, strict=True))
    typer.echo(header)
    for row, line in zip(rows, cells, strict=True):
        typer.echo("  ".join(cell.rjust(width) for cell, width in zip(line, widths, strict=True)))
        if row["note"]:
            typer.echo(f"{'':{len(columns)}}{row['note']}")
