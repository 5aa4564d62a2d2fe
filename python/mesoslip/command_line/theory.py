"""``mesoslip info``, ``curve`` and ``onset``: theory, without a simulation."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mesoslip.command_line.options import (
    ConfigArgument,
    JsonOption,
    SetOption,
    load,
    print_json,
    show,
)

if TYPE_CHECKING:
    from mesoslip.configuration.config import Config

# Maximum work for the stability of steady sliding, some seconds.
MAX_WORK = 400_000


def info(config: ConfigArgument, changes: SetOption = None, as_json: JsonOption = False) -> None:
    """Show derived quantities."""
    from mesoslip.theory.derived import derived, verdict

    checked = load(config, changes)
    quantities = derived(checked)
    if as_json:
        print_json({name: one.value for name, one in quantities.items()})
        return
    for name, one in quantities.items():
        show(name, one.value, one.unit, one.meaning)
    for message in (verdict(checked), checked.unreached_drive):
        if message is not None:
            typer.echo(message)


def curve(
    config: ConfigArgument,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="Write the curve to a file", metavar="OUT.nc"),
    ] = None,
    changes: SetOption = None,
    as_json: JsonOption = False,
) -> None:
    """Force curve of the master equation, and its elastic instability."""
    from mesoslip.output import targets, writing
    from mesoslip.theory.force_curve import SUMMARY, ForceCurve
    from mesoslip.theory.steady_sliding import steady_sliding, stiffness_summary

    checked = load(config, changes)
    if output is not None:
        targets.check_output(output, [config])
    _warn_of_interaction(checked)
    force_curve = ForceCurve(checked)
    if output is not None:
        writing.write(force_curve.to_tree(), output)
    summary = force_curve.summary()
    if as_json:
        print_json(summary)
    else:
        for name, value in summary.items():
            show(name, value, *SUMMARY[name])
        typer.echo(force_curve.verdict)
        sliding = steady_sliding(checked, MAX_WORK)
        for message in (
            None if sliding is None else sliding.summary,
            stiffness_summary(checked, MAX_WORK),
        ):
            if message is not None:
                typer.echo(message)
    if force_curve.error > checked.curve.tolerance:
        typer.echo(
            f"the force has {force_curve.digits} digits: its threshold law is not smooth, or too "
            "narrow for this length (curve.length), and curve.tolerance would take too much work",
            err=True,
        )


def onset(
    config: ConfigArgument,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="Write the solutions to a file", metavar="OUT.nc"),
    ] = None,
    changes: SetOption = None,
    as_json: JsonOption = False,
) -> None:
    """Onset of slip, contacts breaking one after another (S46) or a film melting at once (S47)."""
    from mesoslip.output import targets, writing
    from mesoslip.theory import slip_onset

    checked = load(config, changes)
    if output is not None:
        targets.check_output(output, [config])
    _warn_of_interaction(checked)
    tree = slip_onset.onset(checked)
    if output is not None:
        writing.write(tree, output)
    summary = {name: tree.attrs[name] for name in slip_onset.SUMMARY if name in tree.attrs}
    summary["stable"] = tree.attrs["stable"] == "true"
    if as_json:
        print_json(summary)
        return
    for name, value in summary.items():
        show(name, value, *slip_onset.SUMMARY[name])
    typer.echo(tree.attrs["comment"])


def _warn_of_interaction(config: Config) -> None:
    """Warn that the master equation ignores interaction."""
    if config.interaction is not None and config.interaction.strength > 0:
        typer.echo(
            "computed without [interaction]: the master equation has no neighbours", err=True
        )
