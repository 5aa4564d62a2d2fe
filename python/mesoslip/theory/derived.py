"""Quantities that follow from a configuration in closed form, for ``mesoslip info``."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from mesoslip.configuration.config import Config
from mesoslip.configuration.tables import LayeredSlider, QuasistaticSlider, RigidSlider
from mesoslip.theory.lives import scales


@dataclass(frozen=True)
class Derived:
    """A derived quantity: its value in SI, the unit, and what it is."""

    value: float
    unit: str
    meaning: str


def derived_quantities(config: Config) -> dict[str, Derived]:
    """Derived quantities by name.

    What has no meaning for the configuration is left out: the setup's frequency of a prescribed
    slider, for example, or what refers to the drive's velocity if that is zero. With several stages
    the first one that moves counts. Equation numbers are those of Braun's "Stick-slip kinetics".
    """
    return {
        name: Derived(value, unit, meaning)
        for name, value, unit, meaning in (*_contacts(config), *_slider(config))
        if math.isfinite(value)
    }


def _drive_speed(config: Config) -> float:
    """Speed of the first stage of the drive that moves [m/s]; 0 if none does."""
    if config.drive.force_rate is not None:
        return 0.0
    return next((abs(one.velocity) for one in config.drive_stages if one.velocity), 0.0)


def loading_rate(config: Config) -> float | None:
    """D1 = v_d √(KM)/F_s (S46) of the first stage that moves; None without one, or a spring."""
    slider = config.slider
    velocity = _drive_speed(config)
    if velocity == 0 or not isinstance(slider, RigidSlider | LayeredSlider):
        return None
    return velocity * math.sqrt(slider.stiffness * slider.mass) / config.contacts.static_force


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
        contacts.threshold.probability_above(contacts.back_force_ratio),
        "1",
        "probability that a threshold drawn is above the back force",
    )
    yield (
        "K_star_estimate",
        contacts.stiffness * (1 - contacts.back_force_ratio) / width,
        "N/m",
        "estimate of K*, above which sliding is smooth, Nk (f_s - f_b)/Delta f_s (S48)",
    )
    if config.interaction is not None:
        bond = config.bond_stiffness
        bonds = config.interaction.neighbours * bond
        yield "bond_stiffness", bond, "N/m", "stiffness between neighbours, G = 3 xi f_s/a"
        yield (
            "bond_ratio",
            bonds / stiffness,
            "1",
            "that of all bonds of a contact over its own, G z/k",
        )
    lives = scales(config)
    yield (
        "mean_life",
        lives.mean_life * static / stiffness,
        "m",
        "mean displacement from attaching to breaking, <x_s - x_b>",
    )
    if contacts.reattach:
        steady = lives.steady_force * contacts.static_force
        yield "F_steady", steady, "N", "force of stationary slow sliding"
        speed = _drive_speed(config)
        if speed > 0 and not isinstance(config.slider, QuasistaticSlider):
            life = lives.mean_life * static / stiffness
            dragged = lives.mean_mass * contacts.contact_drag * contacts.count
            force = steady * life + dragged * speed**2 * contacts.delay
            yield (
                "F_steady_drive",
                force / (life + speed * contacts.delay),
                "N",
                "force of stationary sliding at the drive's velocity, with delay and drag",
            )


def _slider(config: Config) -> Iterator[tuple[str, float, str, str]]:
    slider, contacts = config.slider, config.contacts
    if isinstance(slider, QuasistaticSlider) and slider.stiffness is not None:
        if contacts.reattach:
            yield (
                "mean_avalanche_size",
                1 + contacts.stiffness / slider.stiffness,
                "1",
                "mean size of avalanches in stationary sliding without interaction, 1 + Nk/K",
            )
        return
    if not isinstance(slider, RigidSlider | LayeredSlider):
        return
    if isinstance(slider, LayeredSlider):
        yield from _layers(slider, contacts.count * contacts.contact_mass)
    omega_s = slider.omega_s
    omega_l = math.sqrt(contacts.stiffness / slider.mass)
    yield "omega_s", omega_s, "1/s", "setup frequency, Omega_S = (K/M)^(1/2)"
    yield "setup_period", 2 * math.pi / omega_s, "s", "period of the setup, tau_S = 2 pi/Omega_S"
    if isinstance(slider, RigidSlider):
        yield "damping_rate", slider.damping_rate, "1/s", "setup damping, eta_S"
    yield (
        "omega_l",
        omega_l,
        "1/s",
        "ringing frequency of the pinned slider, Omega_L = (Nk/M)^(1/2)",
    )
    yield "ringing_period", 2 * math.pi / omega_l, "s", "period of the ringing, 2 pi/Omega_L"
    film = contacts.count * contacts.contact_drag / slider.mass
    yield "film_drag_rate", film, "1/s", "drag of the whole molten film per slider mass, N m eta/M"
    velocity_scale = omega_s * contacts.static_force / slider.stiffness
    yield "slip_velocity_scale", velocity_scale, "m/s", "velocity of a slip, Omega_S F_s/K"

    d_1 = loading_rate(config)
    if d_1 is None:
        return
    velocity = _drive_speed(config)
    loading = contacts.static_force / slider.stiffness / velocity
    yield "loading_time", loading, "s", "time in which the spring alone loads to F_s, F_s/(K v_d)"
    yield "D1", d_1, "1", "v_d (K M)^(1/2)/F_s (S46)"
    alpha = (6 / d_1) ** (1 / 3)
    yield (
        "alpha",
        alpha,
        "1",
        "slip time of sequential breaking times Omega_S, (6/D1)^(1/3); the source says 2.21 of "
        "Klein's case, for which this is 14.2",
    )
    yield "slip_time_sequential", alpha / omega_s, "s", "slip time of sequential breaking"
    # The peak of F(X) lies near F_s - Delta F_s, so D0 = F_d(X_c)/F_s is about 1 - delta.
    start = 1 - contacts.threshold.relative_width - film * d_1 / omega_s
    yield "B", start / 2, "1", "(D0 - eta D1/Omega_S)/2, the film melting at once, D0 ~ 1 - delta"
    if start > 0:
        beta = math.sqrt(2 / start)
        yield (
            "beta",
            beta,
            "1",
            "slip time of instant melting times Omega_S, [2/(D0 - eta D1/Omega_S)]^(1/2), "
            "with D0 ~ 1 - delta",
        )
        yield "slip_time_melting", beta / omega_s, "s", "slip time of instant melting"


def _layers(slider: LayeredSlider, film_mass: float) -> Iterator[tuple[str, float, str, str]]:
    yield "slider_mass", slider.mass, "kg", "mass of all layers, M"
    yield "slider_stiffness", slider.stiffness, "N/m", "static stiffness of all springs, K"
    frequencies = slider.frequencies
    yield "chain_frequency", frequencies[0], "1/s", "lowest frequency of the chain without contacts"
    yield "chain_frequency_highest", frequencies[-1], "1/s", "highest one"
    if slider.base is not None:
        mass = slider.base.mass + slider.mass + film_mass
        yield (
            "pinned_base_frequency",
            math.sqrt(slider.base.stiffness / mass),
            "1/s",
            "frequency of base and slider pinned together, [K_B/(M_B + M + Nm)]^(1/2)",
        )
    if slider.cantilever is not None:
        bending = slider.cantilever.bending_frequency
        yield "bending_frequency", bending, "1/s", "lowest bending frequency of the cantilever"
        ratio = bending / math.sqrt(slider.cantilever.stiffness / slider.cantilever.mass)
        yield "bending_ratio", ratio, "1", "that over (K/M)^(1/2) of the cantilever, 2.03"
