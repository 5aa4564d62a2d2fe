"""Independent models: thresholds from scipy, a fixed-step model, and one by matrix exponentials.

None of them shares code with the kernels, but for Philox, which is checked by known answers.
"""

import math
from dataclasses import dataclass, field

import numpy as np
from mesoslip import Config, _core
from mesoslip.configuration.kernel_parameters import named
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


def uniforms(
    seed: int, realization: int, contact: int, renewal: int, attempt: int = 0
) -> tuple[float, float]:
    """The two deviates of a birth, from the documented key; activation has those of attempt 1."""
    high = renewal >> 32 | attempt << 16
    counter = np.array([[contact], [renewal & 0xFFFFFFFF], [high], [realization]])
    key = np.array([[seed & 0xFFFFFFFF], [seed >> 32]])
    words = _core.philox(np.asfortranarray(counter), np.asfortranarray(key))[:, 0].tolist()
    return tuple(
        (((high << 20) | (low >> 12)) + 0.5) * 2.0**-52
        for low, high in ((words[0], words[1]), (words[2], words[3]))
    )


def relative_strength(track, seed: int, realization: int, x) -> np.ndarray:
    """The Gaussian function of a track, as the kernel has it."""
    parameters = named(track.kernel_parameters(0.05))
    values, status, message = _core.track_strength(*parameters, seed, realization, np.asarray(x))
    assert status == 0, message
    return values


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
        self.factor = np.full(count, self.strength(0.0))
        self.direction = 1.0
        self.time = 0.0
        self.birth = np.full(count, 0.0)
        ageing = contacts.ageing
        if ageing is not None and ageing.law == "relax" and ageing.initial_age is None:
            self.birth[:] = -np.inf
        # Hazard so far, and that at which the contact breaks, of thermal activation.
        self.hazard = np.zeros(count)
        self.deviate = np.array([self.draw_deviate(contact) for contact in range(count)])
        self.bonds = np.zeros((count, count))
        if self.config.interaction is not None:
            self.bonds = bonds(self.config)
        self.avalanches: list[tuple[float, list[int]]] = []
        self.order: list[int] = []

    def strength(self, x: float) -> float:
        """Factor of the thresholds of contacts that attach at x on the track."""
        track = self.config.contacts.track
        if track is None:
            return 1.0
        g = relative_strength(track, self.config.run.seed, self.realization, [x])[0]
        return max(0.05, 1 + track.spread * g)

    def draw(self, contact: int) -> float:
        if self.config.contacts.renewal == "keep":
            uniform, _ = uniforms(self.config.run.seed, self.realization, contact, 0)
            return self.law.isf(uniform * self.law.sf(0.0))
        seed = self.config.run.seed
        uniform, _ = uniforms(seed, self.realization, contact, int(self.renewal[contact]))
        return self.law.isf(uniform * self.law.sf(least_configured(self.config)))

    def draw_deviate(self, contact: int) -> float:
        """The hazard at which a contact breaks by thermal activation: an exponential deviate."""
        if self.config.contacts.thermal is None:
            return math.inf
        renewal = int(self.renewal[contact])
        return -math.log(uniforms(self.config.run.seed, self.realization, contact, renewal, 1)[0])

    def activate(self, x: float, step: float) -> bool:
        """Add the hazard of a step; whether a contact is due."""
        thermal = self.config.contacts.thermal
        if thermal is None:
            return False
        force = np.abs(self.breaking_force(x)) - self.thresholds
        scale = thermal.ratio(self.config.contacts.contact_static_force)
        rate = thermal.rate * np.exp(force / (scale * self.config.contacts.contact_static_force))
        self.hazard += np.where(self.pinned, rate * step, 0.0)
        return bool(np.any(self.hazard >= self.deviate))

    @property
    def thresholds(self) -> np.ndarray:
        """Thresholds of now [N]."""
        contacts = self.config.contacts
        if contacts.ageing is None:
            return self.factor * self.u * contacts.contact_static_force
        z = (self.u - 1) / contacts.threshold.relative_width
        mean, width = aged(self.config, self.time - self.birth)
        return self.factor * (mean + width * z) * contacts.contact_static_force

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
        return self.thresholds / self.stiffness

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

    def stretch(self, x: float) -> np.ndarray:
        """Stretch of each contact, 0 for a detached one."""
        return np.where(self.pinned, x - self.origin, 0.0)

    def excess(self, x: float) -> np.ndarray:
        """How far each contact is past where it breaks, its neighbours as they are [m]."""
        step = self.config.contacts.static_force / self.config.contacts.stiffness
        force = self.breaking_force(x)
        rate = (self.breaking_force(x + step) - force) / step
        over = np.abs(force) - self.thresholds
        excess = np.where(self.pinned, over / np.where(self.pinned, rate, 1.0), -np.inf)
        return np.where(self.hazard >= self.deviate, np.inf, excess)

    def closing_rate(self) -> float:
        """Upper limit of the speed at which displacements of breaks come nearer at rest [m/s]."""
        contacts, ageing = self.config.contacts, self.config.contacts.ageing
        if ageing is None or ageing.law == "log":
            return 0.0
        width = contacts.threshold.relative_width
        young = ageing.young_force_ratio
        spread = young * ageing.young_relative_width - width
        lost = young - 1 + spread * (self.u - 1) / width
        fall = lost * np.exp(-(self.time - self.birth) / ageing.time) / ageing.time
        return max(0.0, float(np.max(fall / self.stiffness))) * contacts.contact_static_force

    def breaking_force(self, x: float) -> np.ndarray:
        """Force that breaks each contact, that of its neighbours included."""
        stretch = self.stretch(x)
        between = (self.bonds * (stretch[:, None] - stretch[None, :])).sum(axis=1)
        return self.stiffness * stretch + between

    def act(self, x: float, v: float, time: float, slack: float = 0.0) -> None:
        """Break what is due at a displacement and time, and what that pushes over; attach."""
        contacts = self.config.contacts
        self.time = time
        if v != 0:
            self.direction = math.copysign(1.0, v)
        broken: list[int] = []
        while True:
            excess = self.excess(x)
            over = np.flatnonzero(excess >= -slack)
            if over.size:
                # Those that break forward come first, then as far as they are past their places.
                is_backward = self.breaking_force(x)[over] < 0
                order = over[np.lexsort((-excess[over], is_backward))]
                self.due[over] = time + contacts.delay
                self.hazard[over] = 0.0
                self.deviate[over] = np.inf
                self.order += [int(contact) for contact in order]
                broken += self.order[-len(order) :]
                slack = 0.0
                continue
            is_due = self.due <= time * (1 + 1e-15)
            if not (contacts.reattach and is_due.any()):
                break
            for contact in [contact for contact in self.order if is_due[contact]]:
                self.order.remove(contact)
                self.renewal[contact] += 1
                self.u[contact] = self.draw(contact)
                self.deviate[contact] = self.draw_deviate(contact)
                self.factor[contact], self.birth[contact] = self.strength(x), time
                force = self.direction * contacts.back_force_ratio * contacts.contact_static_force
                if contacts.renewal == "keep":
                    force = self.direction * contacts.back_force_ratio * self.thresholds[contact]
                force += self.bonds[contact] @ self.stretch(x)
                self.origin[contact] = x - force / (
                    self.stiffness[contact] + self.bonds[contact].sum()
                )
                self.due[contact] = np.nan
        self.events += [(time, contact) for contact in broken]
        if broken:
            self.avalanches.append((time, broken))


def aged(config: Config, age):
    """Mean and width of the thresholds at an age over the static force, of model section 9."""
    width, ageing = config.contacts.threshold.relative_width, config.contacts.ageing
    if ageing.law == "log":
        mean = 1 + ageing.growth * np.log(1 + age / ageing.time)
        return mean, width * mean
    young = ageing.young_force_ratio
    decay = np.exp(-age / ageing.time)
    return (
        1 + (young - 1) * decay,
        width + (young * ageing.young_relative_width - width) * decay,
    )


def least_configured(config: Config) -> float:
    """Configured threshold over the mean below which a contact is drawn again: one of the young or
    of the old would be below the back force."""
    contacts, ageing = config.contacts, config.contacts.ageing
    least = contacts.back_force_ratio
    if ageing is None or ageing.law == "log":
        return least
    mean, width = aged(config, 0.0)
    return max(least, 1 + contacts.threshold.relative_width * (least - mean) / width)


def bonds(config: Config) -> np.ndarray:
    """Stiffness of the bonds between contacts: G for each image of one at the distance a."""
    interaction, contacts = config.interaction, config.contacts
    height = math.sqrt(0.75) if interaction.lattice == "triangular" else 1.0
    places = [
        (column + (0.5 * (row % 2) if interaction.lattice == "triangular" else 0.0), row * height)
        for row in range(interaction.rows)
        for column in range(interaction.columns)
    ]
    spacing = math.sqrt(contacts.area / contacts.count)
    bond = 3 * interaction.strength * contacts.contact_static_force / spacing
    matrix = np.zeros((contacts.count, contacts.count))
    for i, (x, y) in enumerate(places):
        for j, (u, v) in enumerate(places):
            for right in (-1, 0, 1):
                for up in (-1, 0, 1):
                    far = math.hypot(
                        u - x + right * interaction.columns, v - y + up * interaction.rows * height
                    )
                    if abs(far - 1) < 1e-6:
                        matrix[i, j] += bond
    return matrix


def quasistatic(config: Config, count: int) -> tuple[list[tuple[float, ...]], Contacts]:
    """The first avalanches of a slider without inertia that moves forward.

    For each the displacement of the drive (or its force), that of the slider at the start, breaks,
    drop of the contact force, and slip.
    """
    at_once = config.contacts.model_copy(update={"delay": 0.0})
    contacts = Contacts(config.model_copy(update={"contacts": at_once}))
    spring = config.slider.stiffness or 0.0
    is_force = config.slider.stiffness is None
    drive = x = 0.0
    avalanches = []

    def crossing(low: float, high: float) -> float | None:
        """Where the first contact breaks between two displacements."""
        excess = contacts.excess(low), contacts.excess(high)
        first = [
            low + (high - low) * -a / (b - a)
            for a, b in zip(*excess, strict=True)
            if np.isfinite(a) and a < 0 <= b
        ]
        return min(first) if first else None

    while len(avalanches) < count:
        reach = 10 * config.contacts.static_force / config.contacts.stiffness
        x = crossing(x, x + reach)
        if x is None:
            break
        stiffness, offset, _ = contacts.sums()
        drive = ((spring + stiffness) * x - offset) / (1 if is_force else spring)
        before, start, broken = contacts.force(x, 0.0), x, 0
        while x is not None:
            contacts.act(x, 1.0, 0.0, slack=1e-12 * reach)
            broken += len(contacts.avalanches[-1][1])
            stiffness, offset, _ = contacts.sums()
            pull = drive if is_force else spring * drive
            if spring + stiffness == 0:
                x = None
                break
            rest = (pull + offset) / (spring + stiffness)
            x = crossing(x, rest)
        if spring + stiffness == 0:
            avalanches.append((drive, start, broken, before, np.nan))
            break
        x = rest
        avalanches.append((drive, start, broken, before - contacts.force(x, 0.0), x - start))
    return avalanches, contacts


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
    """The model at a fixed step, events at ends of steps; trace columns time, X_d, X, V, F_d, F.

    Contacts are looked at only at steps at which one can break or is due.
    """
    contacts = Contacts(config)
    slider = config.slider
    prescribed = slider.kind == "prescribed"
    ends = np.cumsum([part.duration for part in config.drive_parts])
    velocities = np.array([part.start_velocity for part in config.drive_parts])
    steps = round(config.duration / step)
    every = round(config.output_interval / step)
    parts = np.searchsorted(ends, (np.arange(steps + 1) + 0.5) * step)
    driven = velocities[np.minimum(parts, len(ends) - 1)].tolist()
    if not prescribed:
        spring, mass, eta = slider.stiffness, slider.mass, slider.damping_rate
    x = v = w = drive = room = closing = 0.0
    due = math.inf
    stiffness, offset, drag = contacts.sums()
    direction = contacts.direction
    rows = []
    for number in range(steps + 1):
        time = number * step
        v_d = driven[number]
        if prescribed:
            x, v = drive, v_d
        force = stiffness * x - offset + drag * v
        if number % every == 0:
            rows.append((time, drive, x, v, force if prescribed else spring * (drive - x), force))
        if not prescribed:
            acceleration = (spring * (drive - x) - force) / mass - eta * (v - w)
            w += step * eta * (v - w)
            v += step * acceleration
            x += step * v
        drive += step * v_d
        moved = step * (v_d if prescribed else v)
        room -= abs(moved) + step * closing
        if v != 0:
            direction = math.copysign(1.0, v)
        at = drive if prescribed else x
        is_activated = contacts.activate(at - 0.5 * moved, step)
        if room <= 0 or is_activated or due <= (time + step) * (1 + 1e-15):
            contacts.direction = direction
            contacts.act(at, v, time + step)
            stiffness, offset, drag = contacts.sums()
            room, closing = -float(np.max(contacts.excess(at))), contacts.closing_rate()
            waiting = contacts.due[~np.isnan(contacts.due)]
            due = float(waiting.min(initial=math.inf)) if config.contacts.reattach else math.inf
    return np.array(rows), contacts


def exact_events(config: Config, scan: float) -> Contacts:
    """Breaks by matrix exponentials and root finding; crossings are looked for at a fine scan."""
    contacts = Contacts(config)
    (part,) = config.drive_parts
    state = np.array([0.0, 0.0, 0.0, 0.0, 1.0])
    time = 0.0
    while time < config.duration:
        system = matrix(config, contacts.sums(), part.start_velocity)
        due = contacts.due[~np.isnan(contacts.due)] if config.contacts.reattach else np.array([])
        end = min([time + scan, config.duration, *due])

        def excess(at: float, start=state, since=time, system=system) -> float:
            x = (linalg.expm(system * (at - since)) @ start)[0]
            return max(-1.0, float(np.max(contacts.excess(x))))

        if excess(end) >= 0:
            end = optimize.brentq(excess, time, end, xtol=1e-15, rtol=1e-15)
        state = linalg.expm(system * (end - time)) @ state
        time = end
        contacts.act(state[0], state[1], time, slack=1e-19)
    return contacts


def assert_same_events(actual, expected, first: int | None = None, rtol: float = 1e-9) -> None:
    """The same contacts at the same times, of the first events if a number is given."""
    actual, expected = actual[:first], expected[:first]
    assert [contacts for _, contacts in actual] == [contacts for _, contacts in expected]
    times = ([time for time, _ in one] for one in (actual, expected))
    np.testing.assert_allclose(*times, rtol=rtol)


def ageing_force(config: Config, velocity: float) -> float:
    """Steady contact force at a velocity of contacts that age, without delay [N].

    F/F_s = <int_0^T f dt> / <T> over the law of the thresholds, T being the first time at which the
    force f of a contact, k v t above the back force, is its threshold.
    """
    contacts = config.contacts
    width = contacts.threshold.relative_width
    law = frozen_law(contacts.threshold.law, width)
    back, least = contacts.back_force_ratio, least_configured(config)
    speed = velocity / contacts.break_stretch

    def gap(time: np.ndarray) -> np.ndarray:
        mean, spread = aged(config, time)
        return mean + spread * z - back - speed * time

    # Thresholds at the nodes of a quadrature.
    point, weight = np.polynomial.legendre.leggauss(20)
    edges = np.linspace(max(least, law.ppf(1e-15)), law.isf(1e-15), 81)
    half = np.diff(edges)[:, None] / 2
    u = ((edges[:-1, None] + half) + half * point).ravel()
    z = (u - 1) / width
    chance = np.tile(weight, half.size) * law.pdf(u)
    # The first of several zeros, if the threshold grows faster than the force for a while.
    end = np.full_like(u, 1.0 / speed)
    while np.any(gap(end) > 0):
        end[gap(end) > 0] *= 2
    times = end * np.concatenate([[0.0], np.geomspace(1e-9, 1.0, 400)])[:, None]
    first = np.argmax(gap(times) <= 0, axis=0)
    node = np.arange(u.size)
    low, high = times[np.maximum(first - 1, 0), node], times[first, node]
    while np.any(high - low > 1e-15 * high):
        middle = (low + high) / 2
        if np.all((middle == low) | (middle == high)):
            break
        is_before = gap(middle) > 0
        low, high = np.where(is_before, middle, low), np.where(is_before, high, middle)
    last = high
    work = np.sum(chance * (back * last + speed * last**2 / 2))
    time = np.sum(chance * last)
    return contacts.static_force * work / time


@dataclass(frozen=True)
class Friction:
    """Rate-and-state friction of one state variable: F_0 [N, or 1], V_0 [m/s], a, b and D_c."""

    reference_force: float
    reference_velocity: float
    a: float
    b: float
    slip_distance: float
    law: str = "ageing"

    def evolution(self, ratio: float, state: float) -> float:
        """Derivative of ψ = ln(V_0 θ/D_c) at a velocity over V_0."""
        rate = self.reference_velocity / self.slip_distance
        if self.law == "ageing":
            return rate * (math.exp(min(-state, 100.0)) - ratio)
        return -rate * ratio * (math.log(ratio) + state) if ratio > 0 else 0.0


@dataclass(frozen=True)
class Motion:
    """Force of the spring and displacement of the slider at some times."""

    force: np.ndarray
    displacement: np.ndarray


def spring_slider(
    law: Friction, stages, times: np.ndarray, stiffness: float, *, damping: float = 0.0
) -> Motion:
    """A slider on a spring, from steady sliding on, by LSODA: its force k (X_lp - X) is that of
    friction, F + η V, so that (a + η V) d ln V/dt = k (V_lp - V) - b dψ/dt.

    With an infinite stiffness it moves with the load point, and has no force where that is at rest.
    """
    reference, is_rigid = law.reference_velocity, math.isinf(stiffness)

    def on_spring(time, at, start, acceleration):
        ratio = math.exp(min(at[0], 100.0))
        velocity = reference * ratio
        change = law.evolution(ratio, at[1])
        loading = stiffness * (start + acceleration * time - velocity)
        return [(loading - law.b * change) / (law.a + damping * velocity), change, velocity]

    def rigid(time, at, start, acceleration):
        velocity = max(start + acceleration * time, 0.0)
        return [0.0, law.evolution(velocity / reference, at[1]), velocity]

    begin, logarithm = 0.0, math.log(stages[0].start_velocity / reference)
    at = [logarithm, -logarithm, 0.0]
    path = np.zeros((times.size, 3))
    driven = np.zeros(times.size)
    for number, stage in enumerate(stages):
        end = begin + stage.duration if number < len(stages) - 1 else math.inf
        inside = (times > begin) & (times <= end) if number else times <= end
        since = np.clip(times[inside] - begin, 0.0, end - begin)
        acceleration = (stage.end_velocity - stage.start_velocity) / stage.duration
        found, report = integrate.odeint(
            rigid if is_rigid else on_spring,
            at,
            np.concatenate([[0.0], since, [end - begin] if math.isfinite(end) else []]),
            args=(stage.start_velocity, acceleration),
            tfirst=True,
            rtol=1e-10,
            atol=[1e-10, 1e-10, 1e-16],
            mxstep=20_000,
            full_output=True,
        )
        assert report["message"] == "Integration successful."
        path[inside], at = found[1 : 1 + since.size], found[-1]
        driven[inside] = stage.start_velocity + acceleration * since
        begin = end
    velocity = driven if is_rigid else reference * np.exp(path[:, 0])
    rate = np.log(np.where(velocity > 0, velocity, np.nan) / reference)
    force = law.reference_force + law.a * rate + law.b * path[:, 1] + damping * velocity
    return Motion(force, path[:, 2])
