"""Quantities that follow from a configuration in closed form, for ``mesoslip info``."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from mesoslip.configuration.config import Config
from mesoslip.configuration.contacts.tables import Ageing, Thermal
from mesoslip.errors import ConfigError
from mesoslip.output.inputs import ConfigLike, as_config
from mesoslip.theory.linear_stability import LinearStability, shown_by
from mesoslip.theory.lives import newborn_stretch, scales
from mesoslip.theory.sliders import quantities
from mesoslip.theory.steady_sliding import depends_on_velocity, steady_sliding

# Maximum work for the stability of steady sliding, about a tenth of a second.
MAX_WORK = 10_000
# K* over its estimate, for thresholds of 0.3 to 10 % of all laws, and exponential ones.
ESTIMATE_RANGE = 0.2, 2.0


@dataclass(frozen=True)
class Derived:
    """A derived quantity: its value in SI, its unit, and its meaning."""

    value: float
    unit: str
    meaning: str


def derived(config: ConfigLike) -> dict[str, Derived]:
    """Quantities that follow from a configuration, by name.

    Quantities without a meaning for the configuration are left out, such as the setup's frequency
    of a prescribed slider. The velocity of the drive is that of the first stage that moves, of a
    ramp its maximum. Equation numbers are those of Braun's "Stick-slip kinetics".

    Raises
    ------
    FileError, ConfigError
        If the configuration cannot be read or is wrong.
    """
    config = as_config(config)
    return {
        name: Derived(value, unit, meaning)
        for name, value, unit, meaning in (
            *_contacts(config),
            *quantities(config.slider, config),
            *_stability(steady_sliding(config, MAX_WORK)),
            *_drive(config),
        )
        if math.isfinite(value)
    }


def _drive(config: Config) -> Iterator[tuple[str, float, str, str]]:
    """Totals of a drive with more than one velocity."""
    parts = config.drive_parts
    if not config.drive.parts:
        return
    yield "drive_stages", float(parts[-1].stage + 1), "1", "stages of the drive in the run"
    yield "drive_duration", config.duration, "s", "duration of the run"
    length = math.fsum(part.path_length for part in parts)
    yield "drive_path_length", length, "m", "path length of the drive (both directions added)"
    yield (
        "drive_speed",
        config.drive_speed,
        "m/s",
        "reference speed of the drive: of the first stage that moves, the maximum of a ramp",
    )


def verdict(config: Config) -> str | None:
    """Predictions for the motion, and their limits; None without a spring."""
    sliding = steady_sliding(config, MAX_WORK)
    sentences: tuple[str | None, ...] = (_verdict_of_stiffness(config),)
    if sliding is not None:
        # Contacts that age or creep have no force curve, and no K*, but a limit at each velocity.
        limit = sliding.limit if depends_on_velocity(config) else None
        sentences = (*sentences, sliding.summary, limit)
    return "\n".join(one for one in sentences if one is not None) or None


def _stability(sliding: LinearStability | None) -> Iterator[tuple[str, float, str, str]]:
    """Growth or decay of small perturbations of steady sliding, if it is found quickly."""
    if sliding is None:
        return
    yield (
        "steady_growth_rate",
        sliding.growth_rate,
        "1/s",
        "growth rate of small perturbations of steady sliding at the drive's velocity, with delay, "
        "ageing and temperature; negative: they decay",
    )
    yield "steady_frequency", sliding.frequency, "1/s", "angular frequency of these perturbations"


def _verdict_of_stiffness(config: Config) -> str | None:
    """The spring against the estimate of K*; None without a spring."""
    spring = config.series_stiffness
    if not 0 < spring < math.inf or depends_on_velocity(config):
        return None
    estimate = next(one[1] for one in _contacts(config) if one[0] == "K_star_estimate")
    name = "K" if spring == config.spring_stiffness else "K in series with the base"
    ratio = spring / estimate
    low, high = ESTIMATE_RANGE
    if low < ratio < high:
        return (
            f"{name} is {ratio:.2g} times the estimate of K*, and K* itself {low:g} to {high:g} "
            "times it for most threshold laws: mesoslip curve computes K*. Slow sliding from "
            "relaxed contacts without delay is stable above K*, and has a first slip below"
        )
    sentences = [
        f"{name} is {'above' if ratio > 1 else 'below'} the estimate of K*, which depends on the "
        "threshold law: mesoslip curve computes K*"
    ]
    if ratio > 1:
        sentences.append("Above K* slow sliding from relaxed contacts without delay is stable")
        after = "with a delay there may be stick-slip nevertheless"
    else:
        sentences.append("Below K* slow sliding from relaxed contacts has a first slip")
        after = "delay and inertia decide whether slips continue or decay"
    if config.contacts.reattach:
        sentences[-1] += f"; {after}: {shown_by(config)}"
    return ". ".join(sentences)


def _contacts(config: Config) -> Iterator[tuple[str, float, str, str]]:
    contacts = config.contacts
    width = contacts.threshold.relative_width
    static, stiffness = contacts.contact_static_force, contacts.contact_stiffness
    yield "contact_static_force", static, "N", "mean static threshold of a contact, f_s = F_s/N"
    yield "contact_stiffness", stiffness, "N/m", "mean stiffness of a contact, k"
    yield "break_stretch", static / stiffness, "m", "mean stretch at which a contact breaks, f_s/k"
    if contacts.contact_mass > 0:
        yield "contact_mass", contacts.contact_mass, "kg", "mass of a contact, m = rho (A/N) h"
    if contacts.area is not None:
        area = contacts.area / contacts.count
        yield (
            "contact_spacing",
            math.sqrt(area),
            "m",
            "distance between neighbours, a = (A/N)^(1/2)",
        )
        yield "contact_radius", math.sqrt(area / math.pi), "m", "radius of a contact"
    yield (
        "threshold_acceptance",
        contacts.threshold.probability_above(contacts.min_threshold),
        "1",
        "probability that a drawn threshold exceeds the back force"
        + (", young and old" if contacts.ageing is not None else ""),
    )
    yield (
        "K_star_estimate",
        contacts.stiffness * (1 - contacts.back_force_ratio) / width,
        "N/m",
        "estimate of K*, above which slow sliding without delay is stable, "
        "Nk (f_s - f_b)/Delta f_s (S48); mesoslip curve computes K*, which depends on the "
        "threshold law",
    )
    if config.interaction is not None:
        bond = config.bond_stiffness
        bonds = config.interaction.neighbours * bond
        yield "bond_stiffness", bond, "N/m", "stiffness between neighbours, G = 3 xi f_s/a"
        yield (
            "bond_ratio",
            bonds / stiffness,
            "1",
            "stiffness of all bonds of a contact over its own, G z/k",
        )
    if contacts.thermal is not None:
        yield from _thermal(config, contacts.thermal)
    elif contacts.ageing is not None:
        yield from _ageing(config, contacts.ageing)
    else:
        yield from _lives(config)


def _lives(config: Config) -> Iterator[tuple[str, float, str, str]]:
    """Averages over the lives of contacts, from attaching to breaking."""
    contacts = config.contacts
    static, stiffness = contacts.contact_static_force, contacts.contact_stiffness
    newborn_width = newborn_stretch(config)
    if newborn_width is None:
        return
    lives = scales(config, newborn_width)
    yield (
        "mean_life",
        lives.mean_life * static / stiffness,
        "m",
        "mean displacement from attaching to breaking, <x_s - x_b>",
    )
    if contacts.reattach:
        steady = lives.steady_force * contacts.static_force
        yield "F_steady", steady, "N", "force of stationary slow sliding"
        speed = config.drive_speed
        if speed > 0 and not config.slider.ignores_delay:
            life = lives.mean_life * static / stiffness
            dragged = lives.mean_mass * contacts.contact_drag * contacts.count
            force = steady * life + dragged * speed**2 * contacts.delay
            yield (
                "F_steady_drive",
                force / (life + speed * contacts.delay),
                "N",
                "force of stationary sliding at the drive's velocity, with delay and drag",
            )


def _thermal(config: Config, thermal: Thermal) -> Iterator[tuple[str, float, str, str]]:
    """Thermally activated breaking, and friction at the velocity of the drive."""
    # scipy takes long to import.
    from mesoslip.theory.thermal import creep_velocity, steady_force, steady_slope

    contacts = config.contacts
    ratio = thermal.ratio(contacts.contact_static_force)
    yield "activation_force_ratio", ratio, "1", "force scale of activation over f_s, f_T/f_s"
    idle = thermal.rate_under(contacts.back_force_ratio, contacts.contact_static_force)
    yield (
        "newborn_break_rate",
        idle,
        "1/s",
        "rate at which a contact of mean threshold breaks that bears the back force",
    )
    yield (
        "activation_velocity",
        thermal.rate * ratio * contacts.break_stretch,
        "m/s",
        "omega_0 f_T/k: in much faster sliding contacts come to their thresholds",
    )
    speed = config.drive_speed
    if contacts.newborn_width > 0 or not contacts.reattach:
        return
    if speed > 0:
        yield (
            "F_steady_drive",
            steady_force(config, speed),
            "N",
            "force of stationary sliding at the drive's velocity, with activation, delay and drag",
        )
        yield (
            "F_steady_slope",
            steady_slope(config, speed),
            "N",
            "dF/d ln v of stationary sliding at the drive's velocity, a - b: below zero sliding "
            "weakens with velocity",
        )
        yield from _rate_and_state(config, speed)
    force = first_force(config)
    if force > 0:
        yield (
            "creep_velocity",
            creep_velocity(config, force),
            "m/s",
            "velocity of steady creep under the force of the drive, that of the first stage",
        )


def first_force(config: Config) -> float:
    """Constant force of the drive, or that of the first stage [N]; 0 for a ramp from 0."""
    if config.drive.force is not None:
        return config.drive.force
    stages = config.drive.stage or ()
    return stages[0].first_force if stages and stages[0].is_force else 0.0


def _rate_and_state(config: Config, speed: float) -> Iterator[tuple[str, float, str, str]]:
    """Rate and state of activated contacts at the velocity of the drive."""
    from mesoslip.theory.activated_sliding import ActivatedSliding

    try:
        found = ActivatedSliding(config, speed).rate_and_state
    except ConfigError:
        return
    yield "direct_effect", found.a, "N", "a of rate and state: N f_T of the pinned contacts"
    yield "evolution_effect", found.b, "N", "b of rate and state: a - dF/d ln v"
    yield (
        "slip_distance",
        found.slip_distance,
        "m",
        "D_c: displacement over which the force evolves after a small velocity step",
    )
    mass = getattr(config.slider, "mass", None)
    if found.b > found.a and mass is not None and 0 < config.spring_stiffness < math.inf:
        yield (
            "critical_stiffness_estimate",
            found.critical_stiffness(speed, mass),
            "N/m",
            "Rice and Ruina's K_c = ((b - a)/D_c)(1 + M v^2/(a D_c)) at the drive's velocity: with "
            "softer springs steady sliding is unstable",
        )


def _ageing(config: Config, ageing: Ageing) -> Iterator[tuple[str, float, str, str]]:
    """Averages over the lives of contacts that age: young, old, and at the drive's velocity."""
    # scipy takes long to import.
    from mesoslip.theory.ageing import mean_life, steady_force

    contacts, width = config.contacts, config.contacts.threshold.relative_width
    weakest, mean, strongest = ageing.threshold([1 - width, 1.0, 1 + width], width, 0.0)
    yield (
        "young_static_force",
        contacts.static_force * float(mean),
        "N",
        "force of all contacts at their mean thresholds when they attach",
    )
    yield (
        "young_relative_width",
        float((strongest - weakest) / (2 * mean)),
        "1",
        "relative standard deviation of the thresholds at attachment, before draws are rejected",
    )
    yield (
        "ageing_velocity",
        contacts.break_stretch / ageing.time,
        "m/s",
        "mean breaking stretch over the ageing time: in much slower sliding contacts age fully "
        "before they break, in much faster sliding they stay young",
    )
    if ageing.growth is not None:
        yield (
            "growth_per_decade",
            ageing.growth * math.log(10),
            "1",
            "growth of thresholds per decade of age, relative to the threshold at birth",
        )
    else:
        life = mean_life(config, 0.0)
        yield (
            "mean_life",
            life,
            "m",
            "mean displacement from attaching to breaking, of old contacts",
        )
    if not contacts.reattach:
        return
    if ageing.growth is None:
        slow = steady_force(config, 0.0)
        yield "F_steady", slow, "N", "force of stationary slow sliding, of old contacts"
    fast = steady_force(config, math.inf)
    yield (
        "F_steady_young",
        fast,
        "N",
        "force of stationary fast sliding, of young contacts, without delay and drag",
    )
    speed = config.drive_speed
    if speed > 0:
        yield (
            "mean_life_drive",
            mean_life(config, speed),
            "m",
            "mean displacement from attaching to breaking, sliding at the drive's velocity",
        )
        yield (
            "F_steady_drive",
            steady_force(config, speed),
            "N",
            "force of stationary sliding at the drive's velocity, with ageing, delay and drag",
        )
