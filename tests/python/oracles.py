"""Independent models: thresholds from scipy, a fixed-step model, and one by matrix exponentials.

None of them shares code with the kernels, but for Philox, which is checked by known answers.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from mesoslip import Config, _core
from scipy import integrate, linalg, optimize, special, stats


def frozen_law(law: str, width: float):
    """The threshold law as a scipy distribution, before rejection."""
    if law == "gaussian":
        return stats.norm(1, width)
    if law == "uniform":
        return stats.uniform(1 - math.sqrt(3) * width, 2 * math.sqrt(3) * width)
    if law == "lognormal":
        sigma = math.sqrt(math.log1p(width**2))
        return stats.lognorm(sigma, scale=math.exp(-(sigma**2) / 2))
    if law == "weibull":
        shape = optimize.brentq(
            lambda c: special.gamma(1 + 2 / c) / special.gamma(1 + 1 / c) ** 2 - 1 - width**2,
            0.2,
            500,
            xtol=1e-13,
        )
        return stats.weibull_min(shape, scale=1 / special.gamma(1 + 1 / shape))
    return stats.expon(1 - width, width)


def uniforms(seed: int, realization: int, contact: int, renewal: int) -> tuple[float, float]:
    """The two deviates of a birth, from the documented key."""
    counter = np.array([[contact], [renewal & 0xFFFFFFFF], [renewal >> 32], [realization]])
    key = np.array([[seed & 0xFFFFFFFF], [seed >> 32]])
    words = _core.philox(np.asfortranarray(counter), np.asfortranarray(key))[:, 0].tolist()
    return tuple(
        (((high << 20) | (low >> 12)) + 0.5) * 2.0**-52
        for low, high in ((words[0], words[1]), (words[2], words[3]))
    )


def stationary_force(config: Config, velocity: float = 0.0) -> float:
    """F_ss, or F(v) with the delay, of model section 4, by quadrature over the threshold law."""
    contacts = config.contacts
    law = frozen_law(contacts.threshold.law, contacts.threshold.relative_width)
    back = contacts.back_force_ratio
    lower, upper = max(back, law.ppf(1e-16)), law.isf(1e-16)
    scaled = contacts.coupling == "scaled"

    def mean(function) -> float:
        value, _ = integrate.quad(
            lambda u: function(u) * law.pdf(u),
            lower,
            upper,
            epsabs=0,
            epsrel=1e-10,
            limit=500,
            points=[1.0],
        )
        return value / law.sf(back)

    static, stiffness = contacts.contact_static_force, contacts.contact_stiffness

    def k(u: float) -> float:
        return stiffness * math.sqrt(u) if scaled else stiffness

    work = mean(lambda u: ((u * static) ** 2 - (back * static) ** 2) / (2 * k(u)))
    way = mean(lambda u: (u - back) * static / k(u))
    drag = contacts.contact_drag * (mean(lambda u: u) if scaled else 1.0)
    delay = contacts.delay
    return contacts.count * (work + drag * velocity**2 * delay) / (way + velocity * delay)


@dataclass
class Contacts:
    """The contacts of a configuration, one by one: the earthquake-like model as it is written."""

    config: Config
    realization: int = 0
    events: list[tuple[float, int]] = field(default_factory=list)

    def __post_init__(self) -> None:
        contacts = self.config.contacts
        assert contacts.initial == "relaxed"
        self.law = frozen_law(contacts.threshold.law, contacts.threshold.relative_width)
        count = contacts.count
        self.renewal = np.zeros(count, dtype=int)
        self.origin = np.zeros(count)
        self.due = np.full(count, np.nan)
        self.u = np.array([self.draw(contact) for contact in range(count)])
        self.sense = 1.0

    def draw(self, contact: int) -> float:
        seed = self.config.run.seed
        uniform, _ = uniforms(seed, self.realization, contact, int(self.renewal[contact]))
        return self.law.isf(uniform * self.law.sf(self.config.contacts.back_force_ratio))

    @property
    def pinned(self) -> np.ndarray:
        return np.isnan(self.due)

    @property
    def stiffness(self) -> np.ndarray:
        scaled = self.config.contacts.coupling == "scaled"
        return self.config.contacts.contact_stiffness * (
            np.sqrt(self.u) if scaled else 1 + 0 * self.u
        )

    @property
    def drag(self) -> np.ndarray:
        scaled = self.config.contacts.coupling == "scaled"
        return self.config.contacts.contact_drag * (self.u if scaled else 1 + 0 * self.u)

    @property
    def limit(self) -> np.ndarray:
        return self.u * self.config.contacts.contact_static_force / self.stiffness

    def sums(self) -> tuple[float, float, float]:
        """K_c, S, C of the linear law."""
        pinned, stiffness = self.pinned, self.stiffness
        return (
            stiffness[pinned].sum(),
            (stiffness * self.origin)[pinned].sum(),
            self.drag[~pinned].sum(),
        )

    def force(self, x: float, v: float) -> float:
        stiffness, offset, drag = self.sums()
        return stiffness * x - offset + drag * v

    def act(self, x: float, v: float, time: float, slack: float = 0.0) -> None:
        """Break and attach what is due at a displacement and time."""
        contacts = self.config.contacts
        if v != 0:
            self.sense = math.copysign(1.0, v)
        over = np.flatnonzero(self.pinned & (np.abs(x - self.origin) >= self.limit - slack))
        for contact in over[np.argsort((self.limit - np.abs(x - self.origin))[over])]:
            self.due[contact] = time + contacts.delay
            self.events.append((time, int(contact)))
        if not contacts.reattach:
            return
        for contact in np.flatnonzero(self.due <= time * (1 + 1e-15)):
            self.renewal[contact] += 1
            self.u[contact] = self.draw(contact)
            back = contacts.back_force_ratio * contacts.contact_static_force
            self.origin[contact] = x - self.sense * back / self.stiffness[contact]
            self.due[contact] = np.nan


def matrix(config: Config, sums: tuple[float, float, float], velocity: float) -> np.ndarray:
    """The system of S40 and S41 for (X, V, W, X_d, 1) under a linear law and a moving drive."""
    slider = config.slider
    stiffness, offset, drag = sums
    eta = slider.damping_rate
    m = slider.mass
    system = np.zeros((5, 5))
    system[0, 1] = 1
    system[1] = [
        -(slider.stiffness + stiffness) / m,
        -drag / m - eta,
        eta,
        slider.stiffness / m,
        offset / m,
    ]
    system[2, 1:3] = eta, -eta
    system[3, 4] = velocity
    return system


def fixed_step(config: Config, step: float) -> tuple[np.ndarray, Contacts]:
    """The model at a fixed step, events at ends of steps; trace columns time, X_d, X, V, F_d, F."""
    contacts = Contacts(config)
    prescribed = config.slider.kind == "prescribed"
    ends = np.cumsum([stage.duration for stage in config.drive_stages])
    velocities = [stage.velocity for stage in config.drive_stages]
    steps = round(config.duration / step)
    every = round(config.output_interval / step)
    x = v = w = drive = 0.0
    rows = []
    for number in range(steps + 1):
        time = number * step
        v_d = velocities[min(np.searchsorted(ends, time + step / 2), len(ends) - 1)]
        if prescribed:
            x, v = drive, v_d
        force = contacts.force(x, v)
        if number % every == 0:
            spring = force if prescribed else config.slider.stiffness * (drive - x)
            rows.append((time, drive, x, v, spring, force))
        if not prescribed:
            slider = config.slider
            acceleration = (slider.stiffness * (drive - x) - force) / slider.mass
            acceleration -= slider.damping_rate * (v - w)
            w += step * slider.damping_rate * (v - w)
            v += step * acceleration
            x += step * v
        drive += step * v_d
        contacts.act(drive if prescribed else x, v, time + step)
    return np.array(rows), contacts


def exact_events(config: Config, scan: float) -> Contacts:
    """Breaks by matrix exponentials and root finding; crossings are looked for at a fine scan."""
    contacts = Contacts(config)
    (stage,) = config.drive_stages
    state = np.array([0.0, 0.0, 0.0, 0.0, 1.0])
    time = 0.0
    while time < config.duration:
        system = matrix(config, contacts.sums(), stage.velocity)
        due = contacts.due[~np.isnan(contacts.due)] if config.contacts.reattach else np.array([])
        end = min([time + scan, config.duration, *due])

        def excess(at: float, start=state, since=time, system=system) -> float:
            x = (linalg.expm(system * (at - since)) @ start)[0]
            pinned = contacts.pinned
            if not pinned.any():
                return -1.0
            return float(np.max(np.abs(x - contacts.origin)[pinned] - contacts.limit[pinned]))

        if excess(end) >= 0:
            end = optimize.brentq(excess, time, end, xtol=1e-15, rtol=1e-15)
        state = linalg.expm(system * (end - time)) @ state
        time = end
        contacts.act(state[0], state[1], time, slack=1e-19)
    return contacts
