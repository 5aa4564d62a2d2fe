"""Does a trace prefer a film that melts as a whole, or contacts?

Traces of Klein's slider over each, with noise: both models are fitted to a trace, and both fits
predict two more traces of the same interface. They are compared by `mesoslip.compare_fits` on the
fitted trace and on those that were held out. Prints the table of ``docs/melting-film.md``; a minute
a trace::

    .venv/bin/python tests/studies/film_or_contacts.py [TRUTH ...]
"""

import sys
import time
from pathlib import Path
from typing import Any

import mesoslip
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
# Seeds of runs and noise, of the trace that is fitted and of those that are predicted.
FITTED, HELD_OUT = 7, (8, 9)
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


def trace(truth: dict[str, Any], noise: float, seed: int) -> Any:
    changes = COMMON | truth | {"run.seed": seed, "run.duration": 12.0}
    return noisy(mesoslip.run(Config.load(KLEIN).replace(changes)), noise, seed)


def show(about: str, posteriors: dict[str, Any]) -> None:
    """Print how far each model is behind, and whether the trace agrees with its predictions."""
    scores = mesoslip.compare_fits(list(posteriors.values()))
    for (model, posterior), score in zip(posteriors.items(), scores, strict=True):
        print(
            f"    {about}: {model:9} behind by {score.difference:.3g} +- {score.error:.2g}; "
            f"agreement p = {posterior.attrs['agreement_probability']:.2g}",
            flush=True,
        )


def main() -> None:
    for name in sys.argv[1:] or TRUTHS:
        truth, noise = TRUTHS[name]
        start = time.perf_counter()
        tree = trace(truth, noise, FITTED)
        posteriors = {
            "film": fitted(tree, FILM, FREE),
            "contacts": fitted(tree, CONTACTS, FREE | MORE_OF_CONTACTS),
        }
        drops = mesoslip.slips(tree)["force_drop"].values
        print(f"{name}: {len(drops)} slips, {time.perf_counter() - start:.0f} s")
        show("fitted", posteriors)
        for seed in HELD_OUT:
            other = trace(truth, noise, seed)
            show(
                f"seed {seed}",
                {model: mesoslip.predict(one, other) for model, one in posteriors.items()},
            )


if __name__ == "__main__":
    main()
