"""Claims C1 to C24 of the source, and C26 and C27 of the normal load, judged from outputs of runs.

Adding one is a function in a module of this folder, and its runs in this folder; sweeps that a
claim needs are in the folder ``sweeps``.
"""

from __future__ import annotations

import pkgutil
from collections.abc import Iterable
from importlib import import_module
from pathlib import Path

from outputs import chosen, opened

from claims import base
from claims.base import Claim, Judgement, Verdict

__all__ = ["CLAIMS", "Claim", "Judgement", "Verdict", "judge"]

for _module in pkgutil.iter_modules(__path__):
    import_module(f"claims.{_module.name}")
CLAIMS = dict(sorted(base.CLAIMS.items(), key=lambda one: int(one[0][1:])))


def judge(names: Iterable[str], outputs: Path) -> list[Judgement]:
    """Judge claims, all by default, from the outputs of their runs."""
    judgements = []
    for claim in chosen(names, CLAIMS, "claim", outputs).values():
        with opened(claim.runs, outputs) as trees:
            judgements.append(Judgement(claim, claim.judge(trees)))
    return judgements
