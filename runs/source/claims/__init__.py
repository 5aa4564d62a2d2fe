"""The source's claims C1 to C24, each judged from outputs of runs.

Adding one is a function and a line in the module of its topic, and its runs in this folder; sweeps
that a claim needs are in the folder ``sweeps``. A new topic is a module, and a line in `_MODULES`.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from outputs import chosen, opened

from claims import ageing, coexistence, curves, film, layered, limit, motion, numbers, slips
from claims.base import Claim, Judgement, Verdict

__all__ = ["CLAIMS", "Claim", "Judgement", "Verdict", "judge"]

_MODULES = (
    numbers,
    curves,
    slips,
    motion,
    limit,
    layered,
    coexistence,
    film,
    ageing,
)
CLAIMS = {
    claim.name: claim
    for claim in sorted(
        (claim for module in _MODULES for claim in module.CLAIMS), key=lambda one: int(one.name[1:])
    )
}


def judge(names: Iterable[str], outputs: Path) -> list[Judgement]:
    """Judge claims, all by default, from the outputs of their runs.

    Raises
    ------
    ConfigError
        If there is no such claim.
    FileError
        If the output of a run is missing.
    """
    judgements = []
    for claim in chosen(names, CLAIMS, "claim", outputs).values():
        with opened(claim.runs, outputs) as trees:
            judgements.append(Judgement(claim, claim.judge(trees)))
    return judgements
