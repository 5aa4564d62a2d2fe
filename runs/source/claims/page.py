"""Judgements as two pages of the documentation, and as plain tables."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from claims.base import Judgement, Verdict


def as_table(judgements: Sequence[Judgement]) -> list[dict[str, Any]]:
    """Judgements as plain dictionaries."""
    return [
        {
            "name": one.claim.name,
            "statement": one.claim.statement,
            "criterion": one.claim.criterion,
            "runs": list(one.claim.runs),
            "verdict": one.finding.verdict.value,
            "reason": one.finding.reason,
            "measured": [
                {
                    "name": quantity.name,
                    "mean": quantity.mean,
                    "standard_deviation": quantity.spread,
                    "values": list(quantity.values),
                    "unit": quantity.unit,
                    "source": quantity.source,
                }
                for quantity in one.finding.measured
            ],
        }
        for one in judgements
    ]


def summary(judgements: Sequence[Judgement]) -> str:
    """Numbers of claims by verdict."""
    counts = dict.fromkeys(Verdict, 0)
    for one in judgements:
        counts[one.finding.verdict] += 1
    return ", ".join(f"{count} {verdict.value}" for verdict, count in counts.items() if count)


def as_text(judgements: Sequence[Judgement]) -> str:
    """Judgements as lines of a terminal."""
    lines = []
    for one in judgements:
        lines.append(f"{one.claim.name}: {one.claim.statement}")
        for quantity in one.finding.measured:
            source = f"   (source: {quantity.source})" if quantity.source else ""
            lines.append(f"    {quantity.name:46} {quantity!s:>24}{source}")
        reason = f": {one.finding.reason}" if one.finding.reason else ""
        lines += [f"    {one.finding.verdict.value.upper()}{reason}", ""]
    return "\n".join([*lines, summary(judgements)])


def measured_path(page: Path) -> Path:
    """The page with what was measured, beside that with the verdicts."""
    return page.with_stem(f"{page.stem}-measured")


def verdict_page(judgements: Sequence[Judgement], page: Path) -> str:
    """All claims with their verdicts, as a page."""
    measured = measured_path(page).name
    lines = [
        "# The source's claims, assessed",
        "",
        f"Written by `make claims`. Each claim of the source (`{judgements[0].claim.name}` to "
        f"`{judgements[-1].claim.name}`) is assessed from runs in `runs/source`.",
        f"[Criteria and measured values]({measured}) are on a page of their own.",
        "",
        f"Summary: {summary(judgements)}.",
        "",
        "| claim | statement | verdict |",
        "|---|---|---|",
        *(
            f"| [{one.claim.name}]({measured}#{one.claim.name.lower()}) | {one.claim.statement} "
            f"| {one.finding.verdict.value} |"
            for one in judgements
        ),
    ]
    return "\n".join(lines) + "\n"


def measured_page(judgements: Sequence[Judgement]) -> str:
    """The criterion of each claim, and what was measured, as a page."""
    lines = [
        "# Claims: criteria and measured values",
        "",
        "Values are means and standard deviations over realizations. `make claims`",
        "compares what it finds with this page: a verdict that differs, or a number that differs",
        "by more than it scatters, is an error.",
    ]
    for one in judgements:
        lines += [
            "",
            f"## {one.claim.name}",
            "",
            f"*{one.claim.statement}.* Criterion: {one.claim.criterion}. "
            f"Runs: {', '.join(f'`{run}`' for run in one.claim.runs)}.",
            "",
            "| quantity | measured | source |",
            "|---|---|---|",
            *(
                f"| {quantity.name} | {quantity} | {quantity.source} |"
                for quantity in one.finding.measured
            ),
            "",
            _ending(one),
        ]
    return "\n".join(lines) + "\n"


def _ending(judgement: Judgement) -> str:
    """Verdict and reason, as sentences."""
    finding = judgement.finding
    verdict = f"**{finding.verdict.value.capitalize()}.**"
    return (
        f"{verdict} {finding.reason[0].upper()}{finding.reason[1:]}." if finding.reason else verdict
    )
