"""Averages over the threshold laws."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mesoslip.array_types import Array

if TYPE_CHECKING:
    from mesoslip.configuration.config import Config


# Normal deviate that has the probability of the limits of the quadrature.
MAX_DEVIATE = 8.0


def threshold_quadrature(config: Config, panels: int, points: int) -> tuple[Array, Array]:
    """Points and weights, which add up to 1, of a quadrature over configured thresholds over the
    mean, shape (panels × points)."""
    # scipy takes long to import.
    from scipy import special

    threshold_law = config.contacts.threshold
    law = threshold_law.above(config.contacts.min_threshold)
    point, share = np.polynomial.legendre.leggauss(points)
    if threshold_law.kind.is_sampled:
        # Thresholds of samples are smoother over the probability than their density is.
        probability = (np.arange(panels)[:, None] + (1 + point) / 2).ravel() / panels
        return np.tile(share, panels) / (panels * np.sum(share)), law.quantile(1 - probability)
    # Panels that a normal law would have of one width: narrow where a law is steep.
    edges = law.quantile(special.ndtr(np.linspace(MAX_DEVIATE, -MAX_DEVIATE, panels + 1)))
    half = np.diff(edges)[:, None] / 2
    threshold = (edges[:-1, None] + half * (1 + point)).ravel()
    weight = (half * share).ravel() * law.density(threshold)
    return weight / np.sum(weight), threshold
