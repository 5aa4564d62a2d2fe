"""The source's claims C1 to C16, each judged from outputs of runs.

Adding one is a function and a line in the module of its topic, and its runs in ``runs/claims``.
"""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import ExitStack
from pathlib import Path

from mesoslip.campaign.claims import curves, limit, motion, numbers, slips
from mesoslip.campaign.claims.base import Claim, Judgement, Verdict
from mesoslip.errors import ConfigError, FileError, Problem
from mesoslip.output import files

__all__ = ["CLAIMS", "Claim", "Judgement", "Verdict", "judge"]

_MODULES = (numbers, curves, slips, motion, limit)
CLAIMS = {
    claim.name: claim
    for claim in sorted(
        (claim for module in _MODULES for claim in module.CLAIMS), key=lambda one: int(one.name[1:])
    )
}


def judge(names: Iterable[str], outputs: Path) -> list[Judgement]:
    """Judge claims from the outputs of their runs."""
    names = tuple(names) or tuple(CLAIMS)
    unknown = [name for name in names if name not in CLAIMS]
    if unknown:
        known = ", ".join(CLAIMS)
        raise ConfigError(
            [Problem("", name, f"no such claim; choose of {known}") for name in unknown]
        )
    wanted = [CLAIMS[name] for name in names]
    missing = sorted(
        {
            path
            for claim in wanted
            for path in (outputs / f"{run}.nc" for run in claim.runs)
            if not path.exists()
        }
    )
    if missing:
        targets = " ".join(str(path) for path in missing)
        raise FileError(f"outputs are missing; make them first: make {targets}")
    judgements = []
    for claim in wanted:
        with ExitStack() as stack:
            trees = [stack.enter_context(files.opened(outputs / f"{run}.nc")) for run in claim.runs]
            judgements.append(Judgement(claim, claim.judge(trees)))
    return judgements
