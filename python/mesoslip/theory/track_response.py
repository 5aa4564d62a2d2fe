"""Linear response of slow sliding to the strength along the track (model section 18).

Contacts of break stretch x_s(u) that attach where the strength is 1 + w e^(iqX) break δx_s =
w e^(iqX) u f_s/k later. With S(x) the share of contacts that live beyond the displacement x, all
contacts, pinned or waiting, are N at any X, which gives the rate at which they attach, and with
it the force,

    χ(q) = Γ_0 [D - A_1/(A_0 + T) B],   Γ_0 = N/(⟨l⟩ + v τ_d),

with the lives l = (u - f_b/f_s) f_s/k and the transforms A_1 = ⟨u f_s/k e^(-iql)⟩,
D = ⟨u² f_s²/k e^(-iql)⟩, A_0 of S, B of the force times S, and T = (e^(iqvτ_d) - 1)/(iq) of the
contacts that wait. Draws again of contacts too weak to attach cancel.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from mesoslip.array_types import Array, Complex, Dataset
from mesoslip.configuration import arguments
from mesoslip.configuration.config import Config
from mesoslip.errors import ConfigError, Problem
from mesoslip.output.variables import TRACK_RESPONSE
from mesoslip.theory.contacts.base import KNOWN_KEYS
from mesoslip.theory.delays import delay_law
from mesoslip.theory.thresholds import threshold_quadrature

# Quadrature over thresholds: panels and points of each.
PANELS, POINTS = 32, 8
# Wavenumbers of the variance, over one over the breaking stretch: maximum times the width of the
# breaking stretches; minimum width for which resonances are resolved; steps, over the width of a
# resonance, the wavenumber, and the breaking stretch.
MAX_REACH, MIN_WIDTH = 12.0, 0.005
RESONANCE_STEP, GEOMETRIC_STEP, MAX_STEP = 0.1, 0.05, 0.05
# Wavenumber over one over the breaking stretch below which the response is that of 0.
MIN_REACH = 1e-4
# Wavenumbers evaluated together, and wavenumbers of an output.
BLOCK, SAMPLES = 1024, 400


class TrackResponse:
    """Response of the contact force to the strength along the track, for N → ∞ and small w.

    Source: model section 18.

    The slider moves steadily; contacts attach with one force, at once or after a delay, and their
    drag is left out.

    Parameters
    ----------
    config
        A configuration with ``contacts.track``.

    Raises
    ------
    ConfigError
        If there is no track, or contacts age, break by thermal activation, interact, keep their
        thresholds, attach with several forces or not at all, or have the stiffnesses of a table.

    Examples
    --------
    >>> import mesoslip
    >>> path, *_ = mesoslip.example("track")  # writes track.toml
    >>> linear = mesoslip.TrackResponse(mesoslip.Config.load(path, ["contacts.initial=steady"]))
    >>> linear.force_deviation > 0, linear.response([0.0, 1e8]).shape
    (True, (2,))
    """

    @arguments.checked(config=arguments.instance(Config, "a Config"))
    def __init__(self, config: Config) -> None:
        problems = list(_problems(config))
        if problems:
            raise ConfigError(problems)
        self.track = config.contacts.needed_track
        contacts = config.contacts
        self._static, self._stretch = contacts.static_force, contacts.break_stretch
        self._width = contacts.stretch_width
        self._weight, self._threshold = threshold_quadrature(config, PANELS, POINTS)
        self._stiffness = np.sqrt(self._threshold) if contacts.coupling == "scaled" else 1.0
        self._back = contacts.back_force_ratio
        self._life = (self._threshold - self._back) / self._stiffness
        self._speed = 0.0 if config.slider.ignores_delay else config.drive_speed
        self._delays = delay_law(config)

    @arguments.checked(wavenumber=arguments.finite_array)
    def response(self, wavenumber: ArrayLike) -> Complex:
        """χ(q) [N] at wavenumbers q [1/m]: strength 1 + w e^(iqX) gives the force F + w χ e^(iqX).

        ``wavenumber`` has any shape, and the result the same.
        """
        q = np.atleast_1d(np.asarray(wavenumber, dtype=float))
        parts = [self._transforms(one) for one in np.split(q.ravel(), range(BLOCK, q.size, BLOCK))]
        values: Complex = np.concatenate(parts)
        return values.reshape(np.shape(wavenumber))

    def _transforms(self, wavenumber: Array) -> Complex:
        # Dimensionless; where q is 0 its limit.
        q = np.maximum(np.abs(wavenumber), MIN_REACH / self._stretch)
        q = np.where(wavenumber < 0, -q, q) * self._stretch
        life, stiffness, u = self._life, self._stiffness, self._threshold
        phase = q[:, None] * life
        turned = np.exp(-1j * phase)
        missing = (1 - turned) / (1j * q[:, None])
        ramp = (turned * (1 + 1j * phase) - 1) / q[:, None] ** 2
        broken = turned @ (self._weight * u / stiffness)
        released = turned @ (self._weight * u**2 / stiffness)
        pinned = missing @ self._weight
        borne = ramp @ (self._weight * stiffness) + self._back * pinned
        waiting: Complex = np.zeros_like(pinned)
        slid = self._speed * self._delays.mean / self._stretch
        if slid > 0:
            late, lost = self._delays.late(1j * q * self._speed / self._stretch)
            waiting = lost / late / (1j * q)
        mean = float(self._weight @ life) + slid
        change: Complex = released - broken / (pinned + waiting) * borne
        return change * (self._static / mean)

    @arguments.checked(wavenumber=arguments.finite_array)
    def strength_spectrum(self, wavenumber: ArrayLike) -> Array:
        """Spectral density G(q) of the strength over w² [m]; its integral over all q is 1."""
        reach = np.asarray(wavenumber, dtype=float) * self.track.length
        if self.track.correlation == "gaussian":
            return self.track.length / math.sqrt(2 * math.pi) * np.exp(-(reach**2) / 2)
        return np.asarray(self.track.length / math.pi / (1 + reach**2))

    @arguments.checked(wavenumber=arguments.finite_array)
    def force_spectrum(self, wavenumber: ArrayLike) -> Array:
        """Spectral density w² abs(χ)² G of the force [N² m]; its integral over all q is the
        variance."""
        response = np.abs(self.response(wavenumber))
        return np.asarray((self.track.spread * response) ** 2 * self.strength_spectrum(wavenumber))

    @cached_property
    def force_deviation(self) -> float:
        """Standard deviation of the force [N]; NaN for thresholds so narrow that contacts stay in
        step, where strength acts by resonance and not linearly."""
        if self._width < MIN_WIDTH:
            return math.nan
        q = self._grid / self._stretch
        return math.sqrt(2 * float(np.trapezoid(self.force_spectrum(q), q)))

    @cached_property
    def _grid(self) -> Array:
        """Wavenumbers for the variance, over one over the breaking stretch."""
        shortest = GEOMETRIC_STEP * self._stretch / self.track.length
        points, q, last = [0.0], 0.0, MAX_REACH / self._width
        while q < last:
            step = min(max(shortest, GEOMETRIC_STEP * q), MAX_STEP)
            if q > 1:
                step = min(step, RESONANCE_STEP * (q * self._width) ** 2)
            q += step
            points.append(q)
        return np.array(points)


def _problems(config: Config) -> Iterator[Problem]:
    """What a linear response to the strength along the track does not know."""
    contacts = config.contacts
    for key in sorted(config.given_contact_keys - KNOWN_KEYS - {"contacts.track"}):
        yield Problem("", key, "has no linear response to the strength along a track")
    if contacts.newborn_width > 0:
        yield Problem(
            "",
            "contacts.newborn_width",
            "must be 0 for the linear response to the strength along a track",
            contacts.newborn_width,
        )
    if contacts.coupling == "table":
        yield Problem(
            "", "contacts.coupling", 'must be "equal" or "scaled" for the response to a track'
        )
    if not contacts.reattach:
        yield Problem("", "contacts.reattach", "without it there is no steady sliding", False)


def track_dataset(linear: TrackResponse) -> Dataset:
    """Response and spectra over the wavenumber."""
    import xarray as xr

    # Four waves in a breaking stretch, or a fifth of one in a correlation length.
    last = max(8 * math.pi / linear._stretch, 1.2 / linear.track.length)
    q = np.linspace(0, last, SAMPLES + 1)
    response = linear.response(q)
    columns = {
        "response": np.abs(response),
        "phase": np.unwrap(np.angle(response)),
        "strength_spectrum": linear.strength_spectrum(q),
        "force_spectrum": linear.force_spectrum(q),
    }
    dimension = ("wavenumber",)
    deviation = linear.force_deviation
    return xr.Dataset(
        {name: TRACK_RESPONSE.variable(name, dimension, one) for name, one in columns.items()},
        coords={"wavenumber": TRACK_RESPONSE.variable("wavenumber", dimension, q)},
        attrs={"force_deviation": deviation} if math.isfinite(deviation) else {},
    )
