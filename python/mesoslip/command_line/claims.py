"""``mesoslip claims``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from mesoslip.command_line.options import JsonOption, print_json


def claims(
    names: Annotated[
        list[str] | None, typer.Argument(help="Such as C3; all by default", metavar="[NAME]...")
    ] = None,
    outputs: Annotated[
        Path, typer.Option("--from", help="Folder of the outputs of the runs", metavar="DIR")
    ] = Path("out"),
    page: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="Write them as a page", metavar="FILE.md"),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Judge the source's claims from the outputs of their runs (make claims runs them first)."""
    from mesoslip.campaign.claims import judge
    from mesoslip.campaign.claims.page import as_markdown, as_table, summary
    from mesoslip.output import files

    if page is not None:
        files.check_writable(page)
    judgements = judge(names or (), outputs)
    if page is not None:
        with files.written_whole(page) as part:
            part.write_text(as_markdown(judgements), encoding="utf-8")
    if as_json:
        print_json(as_table(judgements))
        return
    for one in judgements:
        typer.echo(f"{one.claim.name}: {one.claim.statement}")
        for what in one.finding.measured:
            source = f"   (source: {what.source})" if what.source else ""
            typer.echo(f"    {what.name:46} {what!s:>24}{source}")
        reason = f": {one.finding.reason}" if one.finding.reason else ""
        typer.echo(f"    {one.finding.verdict.value.upper()}{reason}\n")
    typer.echo(summary(judgements))
