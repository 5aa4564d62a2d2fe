"""The posterior of rate-and-state laws: parameters of the friction, the spring and the noise.

The motion, the residuals and the noise are those of the least squares of
`mesoslip.analysis.rate_and_state`; the sampler is that of fits. Residuals are normal. Their
noise, white and correlated over time, is sampled with the law, so that intervals include that it is
not known.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mesoslip.analysis.rate_and_state.noise import Noise, NoiseModel, estimated_noise
from mesoslip.analysis.rate_and_state.records import Record
from mesoslip.analysis.rate_and_state.search import Fit, fit_laws, preferred_law
from mesoslip.array_types import Array
from mesoslip.errors import FileError, RunError
from mesoslip.execution.stop import StoppedError, StopRequest
from mesoslip.inference.prior import FreeParameter, Prior
from mesoslip.inference.sampler import check_installed, draw, step_count

# Names of the parameters of the noise.
NOISE = ("noise", "noise_share", "noise_time")
CHAINS = 4
# Tolerance of predicted motions; and those of sampled ones, whose forces are wrong by about a fifth
# of it in units of a: this part of the noise of the most exact point over a, within limits.
TOLERANCE = 1e-5
NOISE_TOLERANCE, TOLERANCES = 0.025, (1e-6, 1e-4)
# Ranges of the prior: reference force and trend over the range of the record and over that along
# its length, a over the friction, noise over the range.
MAX_LEVEL, MAX_TREND = 2.0, 10.0
MIN_A, MIN_NOISE = 1e-6, 1e-6
# Spreads of starting points about least squares, in standard errors, and their number.
SPREADS = (1.0, 0.3, 0.1, 0.03, 0.0)
STARTS, MIN_STARTS = 400, 100
# Spread of the logarithm of the noise, of its share and of the logarithm of its time at the start.
NOISE_SPREAD = (0.05, 0.02, 0.5)


@dataclass(frozen=True)
class RatePosterior:
    """A law with draws from its posterior."""

    fit: Fit
    """The least squares."""
    prior: Prior
    """Priors of the parameters of the law, and of `NOISE`."""
    chains: Array
    """Draws on the unit cube of the prior, shape (chains, draws, parameters)."""
    is_preferred: bool
    """Whether the record prefers the law to the others."""
    noise: Noise
    """The noise about the least squares of this law, which may not be the best one."""

    @cached_property
    def values(self) -> Array:
        """Draws in SI, shape (chains, draws, parameters)."""
        return self.prior.values(self.chains)

    @property
    def noise_by_squares(self) -> tuple[float, float, float]:
        """Values of `NOISE` about the least squares; NaN where the noise is known."""
        if self.fit.noise.is_known:
            return (math.nan,) * 3
        return self.noise.deviation * self.fit.law.scale, self.noise.share, self.noise.time

    @property
    def draws(self) -> Array:
        """Draws of all chains on the unit cube, shape (draws, parameters)."""
        return self.chains.reshape(-1, self.chains.shape[-1])

    def predicted(self, count: int, rng: np.random.Generator) -> Array:
        """Forces at the points of the record by some of the draws, with noise, shape (count,
        points)."""
        values = self.values.reshape(self.draws.shape)
        values = values[rng.choice(len(values), count, replace=False)]
        law, model = self.fit.law, NoiseModel.of(self.fit.law.points)
        forces = law.forces(law.scaled(values[:, : len(law.names)]), TOLERANCE)[0] * law.scale
        for force, (deviation, share, time) in zip(forces, values[:, -len(NOISE) :], strict=True):
            factor = np.linalg.cholesky(model.covariance(deviation, share, time))
            force += factor @ rng.standard_normal(force.size)
        return forces


def sample_laws(
    record: Record,
    *,
    laws: Sequence[str] = (),
    samples: int,
    seed: int,
    progress: Callable[[float], None] | None = None,
    stop: StopRequest | None = None,
) -> list[RatePosterior]:
    """Posteriors of laws of a record, the preferred or likeliest law first.

    Without names of laws these are the laws of one state variable, and those of two whose
    parameters least squares determine, but for those that do not describe a record that others
    describe.
    """
    check_installed()
    if record.noise is not None and record.noise.deviation == 0:
        raise FileError("the record has no noise, and so no posterior: least squares are exact")
    fits = fit_laws(record)
    missing = [name for name in laws if name not in fits]
    if missing:
        raise RunError(
            f"the motion of the law {missing[0]!r} along this record cannot be integrated"
        )
    chosen = list(laws) or _usual_laws(fits)
    preferred = preferred_law(fits) if record.noise is None else ""
    chosen.sort(key=lambda name: (name != preferred, fits[name].information_criterion))
    total, done = len(chosen) * step_count(CHAINS, samples // CHAINS), 0

    def count_step() -> None:
        nonlocal done
        done += 1
        if stop is not None and stop.is_set():
            raise StoppedError("stopped")
        if progress is not None:
            progress(done / total)

    found = []
    for name in chosen:
        density = Density(fits[name])
        rng = np.random.default_rng([seed, list(fits).index(name)])
        chains = draw(
            density,
            density.starts(rng),
            rng,
            chains=CHAINS,
            draws=-(-samples // CHAINS),
            after_step=count_step,
        )
        is_preferred = name == preferred
        found.append(
            RatePosterior(fits[name], density.prior, chains, is_preferred, density.own_noise)
        )
    return found


def _usual_laws(fits: Mapping[str, Fit]) -> list[str]:
    is_described = any(one.is_described for one in fits.values())
    return [
        name
        for name, one in fits.items()
        if one.law.states == 1 or one.is_described or (one.is_determined and not is_described)
    ]


class Density:
    """Logarithm of the density of a law on the unit cube of its prior."""

    def __init__(self, fit: Fit) -> None:
        self.fit, self.law = fit, fit.law
        self.noise = NoiseModel.of(fit.law.points)
        self.prior = prior_of(fit)
        # The second state variable stays on its side of the first.
        self.sign = 0.0
        if fit.law.states == 2:
            ratio = fit.value("slip_distance2") / fit.value("slip_distance")
            self.sign = 1.0 if ratio >= 1 else -1.0

    @cached_property
    def own_noise(self) -> Noise:
        """The noise about this law, which may not be the best one."""
        law, at = self.law, self.fit.at
        return estimated_noise(law.points, law.residuals(at), law.jacobian(at))

    @cached_property
    def tolerance(self) -> float:
        """Tolerance of the motions, whose errors are far below the noise."""
        exact = float(self.own_noise.point_deviation.min()) * self.law.scale
        return float(np.clip(NOISE_TOLERANCE * exact / self.fit.value("a"), *TOLERANCES))

    def __call__(self, unit: Array) -> Array:
        """The logarithm at points of shape (points, parameters), up to a constant."""
        law, values = self.law, self.prior.values(unit)
        value = np.full(len(values), -math.inf)
        possible = np.full(len(values), True)
        if self.sign:
            first, second = (law.names.index(f"slip_distance{one}") for one in ("", "2"))
            possible = self.sign * (values[:, second] - values[:, first]) >= 0
        if not possible.any():
            return value
        values = values[possible]
        forces, _, failed = law.forces(law.scaled(values[:, : len(law.names)]), self.tolerance)
        residual = law.points.force / law.scale - forces
        deviation, share, time = values[:, -len(NOISE) :].T
        likelihood = self.noise.log_likelihood(residual, deviation / law.scale, share, time)
        value[possible] = np.where(failed, -math.inf, likelihood)
        return value

    def starts(self, rng: np.random.Generator) -> Array:
        """Starting points about the least squares, with a density above 0, shape (points,
        parameters)."""
        fit, size = self.fit, len(self.law.names)
        low, high = fit.law.bounds()
        noise = self.own_noise
        time = noise.time if noise.time > 0 else math.sqrt(math.prod(self.noise.times))
        for spread in SPREADS:
            away = rng.multivariate_normal(np.zeros(size), fit.covariance, STARTS, method="svd")
            at = np.clip(fit.at + spread * away, low, high)
            around = rng.standard_normal((STARTS, len(NOISE))) * NOISE_SPREAD
            shares = np.clip(np.abs(noise.share + around[:, 1]), 0.0, 0.999)
            columns = (
                *(self.law.parameters(at)[name] for name in self.law.names),
                noise.deviation * self.law.scale * np.exp(around[:, 0]),
                shares,
                time * np.exp(around[:, 2]),
            )
            unit = np.clip(self.prior.unit(np.stack(columns, axis=-1)), 1e-9, 1 - 1e-9)
            good = unit[np.isfinite(self(unit))]
            if len(good) >= MIN_STARTS:
                return good
        raise RunError(f"the motion of the {self.law.name} law is unstable about its least squares")


def prior_of(fit: Fit) -> Prior:
    """Priors of the parameters of a law and of the noise, all independent of the parameters that
    were fitted."""
    law = fit.law
    points, scale = law.points, law.scale
    low, high = (dict(zip(law.names, np.exp(one), strict=True)) for one in law.bounds())
    steep = MAX_TREND * scale / law.length
    friction = float(np.max(np.abs(points.force)))
    length = (low["slip_distance"], high["slip_distance"], True, "m")
    change = (-friction, friction, False, "N")
    ranges: dict[str, tuple[float, float, bool, str]] = {
        "reference_force": (
            law.level - MAX_LEVEL * scale,
            law.level + MAX_LEVEL * scale,
            False,
            "N",
        ),
        "trend": (-steep, steep, False, "N/m"),
        "a": (MIN_A * friction, friction, True, "N"),
        "b": change,
        "slip_distance": length,
        "b2": change,
        "slip_distance2": length,
        "stiffness": (low.get("stiffness", 0.0), high.get("stiffness", 0.0), True, "N/m"),
        "noise": (MIN_NOISE * scale, scale, True, "N"),
        "noise_share": (0.0, 1.0, False, "1"),
        "noise_time": (*NoiseModel.of(points).times, True, "s"),
    }
    return Prior(tuple(FreeParameter(name, *ranges[name]) for name in (*law.names, *NOISE)))
