"""Do the intervals of the posterior of rates and states cover?

Records of `measured_rates`, with a trend, of random a, b, D_c, stiffness, law and rates, by an
integrator of its own: noise is white in half of them and correlated in the others, the stiffness is
unknown in every other pair. Prints for each record the quantile of the truth in the posterior of
its law, and the share of 90 % intervals that cover, also of those records alone that the law
describes. Usage: rate_posterior.py [RECORDS] [FIRST_SEED] [SAMPLES]
"""

import sys
import time as clock
from dataclasses import replace

import numpy as np
from measured_rates import draw, trace
from mesoslip.analysis.experiment_stages import Experiment
from mesoslip.analysis.rate_and_state.records import records_of
from mesoslip.errors import MesoslipError
from mesoslip.inference.rate_posterior import sample_laws

NAMES = ("reference_force", "trend", "a", "b", "slip_distance", "stiffness", "noise", "noise_share")


def quantiles(seed: int, samples: int) -> tuple[dict[str, float], str, float]:
    """Quantiles of the truth of a record, the verdict on its law, and the time that it took."""
    truth = draw(seed)
    share = 0.0 if seed % 2 else np.random.default_rng(seed + 10**7).uniform(0.05, 0.9)
    experiment = Experiment(trace(truth, seed, share, is_known=seed % 4 < 2))
    records = records_of(experiment)
    if isinstance(records, str):
        return {}, records, 0.0
    start = clock.process_time()
    (found,) = sample_laws(
        replace(records[0], laws=(truth.law,)), laws=[truth.law], samples=samples, seed=seed
    )
    passed = clock.process_time() - start
    # The slider has moved until the record starts that is used.
    velocity = truth.before * truth.stiffness / (truth.stiffness + truth.trend)
    known = {
        "reference_force": 0.6 + truth.trend * velocity * records[0].points.start,
        **{name: getattr(truth, name) for name in ("trend", "a", "b", "slip_distance")},
        **{name: getattr(truth, name) for name in ("stiffness", "noise")},
        "noise_share": share,
    }
    values = found.values.reshape(found.draws.shape)
    result = {
        name: float(np.mean(column < known[name]))
        for name, column in zip(found.prior.keys, values.T, strict=True)
        if name in known and not (name == "noise_share" and share == 0)
    }
    return result, found.fit.verdict, passed


def main(records: int, first: int, samples: int) -> None:
    """Run the study."""
    found: dict[str, list[tuple[float, str]]] = {name: [] for name in NAMES}
    verdicts, times = [], []
    for seed in range(first, first + records):
        try:
            one, verdict, passed = quantiles(seed, samples)
        except MesoslipError as error:
            one, verdict, passed = {}, str(error), 0.0
        verdicts.append(verdict)
        times.append(passed)
        for name, value in one.items():
            found[name].append((value, verdict))
        shown = ", ".join(f"{name} {value:.3f}" for name, value in one.items())
        print(f"{seed}: {verdict}; {passed:.0f} s; {shown}", flush=True)
    print(
        {one: verdicts.count(one) for one in dict.fromkeys(verdicts)}, f"{np.median(times):.1f} s"
    )
    for chosen in ("all", "described"):
        for name, pairs in found.items():
            values = np.array([one for one, verdict in pairs if chosen in {"all", verdict}])
            if values.size:
                inside = np.mean(np.abs(values - 0.5) < 0.45)
                print(f"{chosen}: {name}: {inside:.1%} of {values.size}")
        every = np.array(
            [
                one
                for name in ("a", "b", "slip_distance", "stiffness")
                for one, verdict in found[name]
                if chosen in {"all", verdict}
            ]
        )
        print(f"{chosen}: a, b, D_c, k: {np.mean(np.abs(every - 0.5) < 0.45):.1%} of {every.size}")


if __name__ == "__main__":
    given = [int(one) for one in sys.argv[1:]]
    main(*(given + [40, 0, 2000][len(given) :]))
