"""Does a trace prefer a film that melts as a whole, or contacts?

Traces of Klein's slider over each, with noise: both models are fitted to each trace, and compared
by `mesoslip.compare_fits` on that trace, of which no part is held out. Prints the table of
``docs/melting-film.md``; half a minute a trace::

    .venv/bin/python tests/studies/film_or_contacts.py [TRUTH ...]
"""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import Any

import mesoslip
import numpy as np
from fit_cases import noisy
from mesoslip import Config

KLEIN = Path(__file__).parents[2] / "runs" / "klein.toml"
BULK = 2e11
COMMON = {"contacts.coupling": "equal", "contacts.delay": 5e-3, "output.slip_interval": 0.0}
FILM = {"contacts.count": 1, "contacts.threshold.relative_width": 1e-6}
CONTACTS = {"contacts.count": 1000, "contacts.threshold.relative_width": 0.02}
# Truths: changes of Klein's case, and noise of the force [N].
TRUTHS: dict[str, tuple[dict[str, Any], float]] = {
    "film": (FILM, 5e-8),
    "film, more noise": (FILM, 5e-7),
    "viscous film": (FILM | {"contacts.drag_rate": 3e4 * BULK}, 5e-8),
    "contacts": (CONTACTS, 5e-8),
    "contacts, more noise": (CONTACTS, 5e-7),
    "few contacts": (CONTACTS | {"contacts.count": 30}, 5e-8),
    "narrow contacts": (CONTACTS | {"contacts.threshold.relative_width": 0.003}, 5e-8),
}
FREE = {
    "contacts.static_force": {"from": "5 uN", "to": "60 uN", "prior": "logarithmic"},
    "contacts.delay": {"from": "0.5 ms", "to": "50 ms", "prior": "logarithmic"},
    "contacts.drag_rate": {"from": BULK, "to": 1e6 * BULK, "prior": "logarithmic"},
}
MORE_OF_CONTACTS = {
    "contacts.threshold.relative_width": {"from": 0.002, "to": 0.3, "prior": "logarithmic"},
}


def fitted(tree: Any, known: dict[str, Any], free: dict[str, Any]) -> Any:
    tables = Config.load(KLEIN).replace(COMMON | known).to_dict()
    return mesoslip.fit(tree, {**tables, "fit": {"simulations": 400, "free": free}})


def main() -> None:
    for name in sys.argv[1:] or TRUTHS:
        truth, noise = TRUTHS[name]
        start = time.perf_counter()
        config = Config.load(KLEIN).replace(COMMON | truth | {"run.seed": 7, "run.duration": 12.0})
        tree = noisy(mesoslip.run(config), noise)
        posteriors = {
            "film": fitted(tree, FILM, FREE),
            "contacts": fitted(tree, CONTACTS, FREE | MORE_OF_CONTACTS),
        }
        scores = mesoslip.compare_fits(list(posteriors.values()))
        drops = np.abs(mesoslip.slips(tree)["force_drop"].values)
        print(f"{name}: {len(drops)} slips, {time.perf_counter() - start:.0f} s")
        for (model, posterior), score in zip(posteriors.items(), scores, strict=True):
            print(
                f"    {model:9} behind by {score.difference:.3g} +- {score.error:.2g}; "
                f"agreement p = {posterior.attrs['agreement_probability']:.2g}",
                flush=True,
            )


if __name__ == "__main__":
    main()
