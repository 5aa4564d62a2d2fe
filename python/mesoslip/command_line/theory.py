"""``mesoslip info``, ``curve`` and ``onset``: theory, without a simulation."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mesoslip.array_packages import import_xarray
from mesoslip.command_line.options import (
    ConfigArgument,
    JsonOption,
    SetOption,
    load,
    output_option,
    print_caveat,
    print_json,
    show,
)

if TYPE_CHECKING:
    from mesoslip.configuration.config import Config
    from mesoslip.theory.force_curve import ForceCurve

# Significant digits of quantities derived from keys, which have two to four themselves; of computed
# quantities whose errors allow them; and of errors. `--json` has all digits.
DERIVED_DIGITS = 4
COMPUTED_DIGITS = 5
ERROR_DIGITS = 2
# Quantities of the slope of a force curve, which has fewer digits than the force.
OF_SLOPE = frozenset({"K_star", "D2", "D3"})

LIMITS_HEADER = "spring stiffer than"
# Maximum work for the stability of steady sliding, some seconds.
MAX_WORK = 400_000


def info(
    config: ConfigArgument,
    changes: SetOption = None,
    is_complete: Annotated[
        bool, typer.Option("--all", help="Print all derived quantities")
    ] = False,
    as_json: JsonOption = False,
) -> None:
    """Print the predicted motion, and derived quantities.

    Without --all only the first few quantities are printed; JSON has all that are derived.
    """
    from mesoslip.simulation.memory import memory_problems
    from mesoslip.theory.derived import derived, overview, verdict

    checked = load(config, changes)
    quantities = derived(checked)
    if as_json:
        print_json({name: one.value for name, one in quantities.items()})
        return
    first = overview(checked, quantities)
    shown = first | quantities if is_complete else first
    for name, one in shown.items():
        show(name, one.value, one.unit, one.meaning, digits=DERIVED_DIGITS)
    remaining = len(quantities.keys() - shown.keys())
    if remaining:
        typer.echo(f"{remaining} more quantities: --all")
    for message in (
        verdict(checked),
        checked.unreached_drive,
        checked.continued_drive,
        *checked.notes,
        checked.unreachable_stop,
        checked.contacts.weak_track,
        checked.contacts.cut_thresholds,
        *map(str, memory_problems(checked)),
    ):
        if message is not None:
            typer.echo(message)


def curve(
    config: ConfigArgument,
    output: Annotated[Path | None, output_option("Write the curve to a file")] = None,
    changes: SetOption = None,
    as_json: JsonOption = False,
) -> None:
    """Compute the force curve F(X), its instability, and K*.

    This is the master equation (N to infinity) under a slider that moves slowly. For contacts that
    age or break by thermal activation it is steady sliding over velocity instead: F(v), dF/d ln v,
    and the stiffness above which sliding is linearly stable.
    """
    from mesoslip.output import targets
    from mesoslip.quantities import percent, with_unit
    from mesoslip.theory.contacts import contact_theory
    from mesoslip.theory.curve import SUMMARY, curve_tree
    from mesoslip.theory.force_curve import ForceCurve
    from mesoslip.theory.steady_sliding import steady_sliding

    checked = load(config, changes)
    targets.check_output(output, [config])
    print_caveat(checked)
    is_over_velocity = contact_theory(checked).depends_on_velocity
    if output is not None or is_over_velocity:
        import_xarray()
    if is_over_velocity:
        _steady_curve(checked, output, as_json=as_json)
        return
    force_curve = ForceCurve(checked)
    if output is not None:
        from mesoslip.output import writing

        writing.write(curve_tree(force_curve), output)
    summary = force_curve.summary()
    if as_json:
        print_json(summary)
    else:
        for name, value in summary.items():
            show(name, value, *SUMMARY[name], digits=_digits(name, force_curve))
        typer.echo(force_curve.verdict)
        sliding = steady_sliding(checked, MAX_WORK)
        if sliding is not None:
            typer.echo(sliding.summary)
        _print_limits(checked, force_curve.K_star[0])
    if force_curve.is_sampled:
        typer.echo(
            f"thresholds are samples: the force has an error of {percent(force_curve.error)} of "
            "the static force, and K* one of "
            f"{with_unit(force_curve.K_star_error, 'N/m', ERROR_DIGITS)}",
            err=True,
        )
    elif force_curve.error > checked.curve.tolerance:
        typer.echo(
            f"the force has {force_curve.digits} digits: its threshold law is not smooth, or too "
            "narrow for this length (curve.length), and curve.tolerance would take too much work",
            err=True,
        )


def onset(
    config: ConfigArgument,
    output: Annotated[Path | None, output_option("Write the solutions to a file")] = None,
    changes: SetOption = None,
    as_json: JsonOption = False,
) -> None:
    """Compute the start of a slip by equations S46 and S47.

    S46: contacts break one after another. S47: the whole film melts at once.
    """
    from mesoslip.output import targets, writing
    from mesoslip.theory import slip_onset

    checked = load(config, changes)
    targets.check_output(output, [config])
    print_caveat(checked)
    tree = slip_onset.onset(checked)
    if output is not None:
        writing.write(tree, output)
    summary = {name: tree.attrs[name] for name in slip_onset.SUMMARY if name in tree.attrs}
    summary["stable"] = tree.attrs["stable"] == "true"
    if as_json:
        print_json(summary)
        return
    for name, value in summary.items():
        show(name, value, *slip_onset.SUMMARY[name], digits=DERIVED_DIGITS)
    typer.echo(tree.attrs["comment"])


def _steady_curve(config: Config, output: Path | None, *, as_json: bool) -> None:
    """Print steady sliding over velocity, and its stability."""
    from mesoslip.output import writing
    from mesoslip.quantities import with_unit
    from mesoslip.theory.steady_curve import SteadyCurve
    from mesoslip.theory.steady_sliding import steady_sliding

    found = SteadyCurve(config)
    if output is not None:
        writing.write(found.to_tree(), output)
    columns = {
        "velocity": found.velocity,
        "steady_force": found.force,
        "steady_slope": found.slope,
        "critical_stiffness": found.critical_stiffness,
    }
    if as_json:
        print_json(
            {name: values.tolist() for name, values in columns.items()}
            | {"boundaries": list(found.boundaries)}
        )
        return
    typer.echo("".join(f"{one:>14}" for one in ("velocity", "F(v)", "dF/d ln v", "stable above")))
    for velocity, force, slope, stiffness in zip(*columns.values(), strict=True):
        typer.echo(
            f"{with_unit(velocity, 'm/s', 3):>14}"
            f"{with_unit(force, 'N', DERIVED_DIGITS):>14}"
            f"{with_unit(slope, 'N', DERIVED_DIGITS):>14}"
            f"{_limit(stiffness):>14}"
        )
    typer.echo(found.verdict)
    sliding = steady_sliding(config, MAX_WORK)
    if sliding is not None:
        for sentence in (sliding.summary, sliding.limit):
            if sentence is not None:
                typer.echo(sentence)


def _limit(stiffness: float) -> str:
    """A critical stiffness in a table."""
    from mesoslip.quantities import with_unit

    if math.isnan(stiffness):
        return "-"
    return with_unit(stiffness, "N/m", 3) if stiffness > 0 else "any spring"


def _digits(name: str, curve: ForceCurve) -> int:
    """Significant digits that a quantity of the force curve deserves."""
    if name.endswith("error"):
        return ERROR_DIGITS
    reliable = curve.digits
    if name in OF_SLOPE:
        error = curve.K_star_error
        steepest = abs(curve.K_star[0])
        reliable = int(math.log10(steepest / error)) + 1 if 0 < error < steepest else ERROR_DIGITS
    return max(ERROR_DIGITS, min(COMPUTED_DIGITS, reliable))


def _print_limits(config: Config, K_star: float) -> None:  # noqa: N803
    """Print the stiffnesses above which sliding is stable: K*, and limits of linear theory."""
    from mesoslip.quantities import percent, with_unit
    from mesoslip.theory.linear_stability import DEPHASED_WIDTH, shown_by
    from mesoslip.theory.steady_sliding import stiffness_limits

    limits = stiffness_limits(config, MAX_WORK)
    if limits is None:
        return
    speed = with_unit(limits.velocity, "m/s", 3)
    rows = [
        (K_star, "slow sliding from this start without delay has no instability (K*)"),
        (limits.in_phase, f"steady sliding at {speed} is linearly stable, with delay"),
        (
            limits.dephased,
            f"the same for dephased contacts (thresholds of {percent(DEPHASED_WIDTH)})",
        ),
    ]
    width = len(LIMITS_HEADER)
    typer.echo(f"{LIMITS_HEADER}  consequence")
    for stiffness, meaning in rows:
        if stiffness is not None:
            typer.echo(f"{with_unit(stiffness, 'N/m', 3):>{width}}  {meaning}")
    typer.echo(
        "linear limits: a large oscillation may be possible above them too, and no more than a "
        f"small one below them: {shown_by(config)}"
    )
