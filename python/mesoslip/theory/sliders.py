"""Quantities from a slider's keys alone: its dynamic stiffness, and others in closed form.

Each function has a form for each kind of slider, chosen by the type of its table.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import singledispatch
from typing import TYPE_CHECKING, Any, NamedTuple

from mesoslip.configuration.sliders.base import SliderTable
from mesoslip.configuration.sliders.inertial import InertialSlider
from mesoslip.configuration.sliders.interface import InterfaceSlider
from mesoslip.configuration.sliders.layered import LayeredSlider
from mesoslip.configuration.sliders.quasistatic import QuasistaticSlider
from mesoslip.configuration.sliders.rigid import RigidSlider
from mesoslip.errors import Problem
from mesoslip.theory.quantity import Quantity, named_quantities

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from mesoslip.configuration.config import Config

    Complex = NDArray[np.complexfloating[Any, Any]]

# Units and meanings of derived quantities.
quantity = named_quantities("""
damping_rate | 1/s | setup damping, eta_S
block_spacing | m | distance of blocks, a
block_mass | kg | mass of a block, m_b = M/N_b
omega_s | 1/s | setup frequency, Omega_S = (K/M)^(1/2)
setup_period | s | period of the setup, tau_S = 2 pi/Omega_S
omega_l | 1/s | ringing of the pinned slider without its spring, Omega_L = (Nk/M)^(1/2)
ringing_period | s | period of the ringing, 2 pi/Omega_L
film_drag_rate | 1/s | drag of the whole molten film per slider mass, N m eta/M
slip_velocity_scale | m/s | velocity scale of a slip, Omega_S F_s/K
slider_mass | kg | mass of all layers, M
slider_stiffness | N/m | static stiffness of all springs, K
chain_frequency | 1/s | lowest frequency of the chain without contacts
chain_frequency_highest | 1/s | highest frequency of the chain
loading_time | s | time in which the spring alone loads to F_s, F_s/(K v_d); scale of the time
    between slips
D1 | 1 | velocity of the drive over the scale Omega_S F_s/K of slips, v_d (K M)^(1/2)/F_s (S46)
alpha | 1 | duration of a slip in which contacts break one after another (S46), in 1/Omega_S:
    (6/D1)^(1/3)
slip_time_sequential | s | duration of a slip in which contacts break one after another,
    alpha/Omega_S
B | 1 | start of a slip in which the whole film melts at once (S47), where the spring force falls by
    B F_s (Omega_S t)^2: (D0 - eta D1/Omega_S)/2, estimate with D0 = 1 - delta; mesoslip onset
    computes D0
mean_avalanche_size | 1 | mean size of avalanches in stationary sliding without interaction, 1 +
    Nk/K
neighbour_spring | N/m | spring of neighbours, k_b = K_b N_b
sound_velocity | m/s | sound in the row, c = a (k_b/m_b)^(1/2)
block_time | s | time of sound over a block, a/c
crossing_time | s | time of sound over the interface
decay_length | m | length in which a static load of the pinned row decays, Lambda = a (k_b/k')^(1/2)
pinned_frequency_highest | 1/s | highest of the pinned row
drive_ratio | 1 | springs of the drive over the row of blocks, (K + K_t)/K_b
contact_ratio | 1 | stiffness of the contacts over that of the row, Nk/K_b = (length/Lambda)^2
pinned_base_frequency | 1/s | frequency of base and slider pinned together, [K_B/(M_B + M +
    Nm)]^(1/2)
bending_frequency | 1/s | lowest bending frequency of the cantilever
bending_ratio | 1 | bending frequency over (K/M)^(1/2) of the cantilever
beta | 1 | duration of such a slip, in 1/Omega_S: B^(-1/2)
slip_time_melting | s | duration of such a slip, beta/Omega_S
""")


class DynamicStiffness(NamedTuple):
    """The force that moves a slider without contacts by e^(λt), over its displacement [N/m].

    A ratio of two polynomials in λ, up to a positive factor; ``degree`` is that of the numerator,
    whose leading coefficient is positive.
    """

    numerator: Complex
    denominator: Complex
    degree: int


@singledispatch
def dynamic_stiffness(slider: SliderTable, rate: Complex) -> DynamicStiffness | None:  # noqa: ARG001
    """The slider alone, moved at its contacts by e^(λt), for rates λ [1/s]; None without
    inertia."""
    return None


@dynamic_stiffness.register
def _rigid_stiffness(slider: RigidSlider | InterfaceSlider, rate: Any) -> DynamicStiffness:
    """M λ² + K + M η_S λ²/(λ + η_S) (S40, S41); of blocks that move together."""
    free = slider.mass * rate**2 + slider.spring_stiffness
    damping = slider.damping_rate
    if damping == 0:
        return DynamicStiffness(free, rate**0, 2)
    mean = rate + damping
    return DynamicStiffness(free * mean + slider.mass * damping * rate**2, mean, 3)


@singledispatch
def stability_problems(slider: SliderTable) -> list[Problem]:  # noqa: ARG001
    """The keys of a slider for which there is no theory of steady sliding."""
    return []


@stability_problems.register
def _interface_problems(slider: InterfaceSlider) -> list[Problem]:
    if slider.moves_as_one:
        return []
    message = 'has no theory of stability: blocks move together with "top" only'
    return [Problem("", "slider.loading", message, slider.loading)]


@dynamic_stiffness.register
def _layered_stiffness(slider: LayeredSlider, rate: Any) -> DynamicStiffness:
    """The chain from the drive's spring down to layer 1; with a base, moved against it."""
    numerator, denominator = chain_stiffness(slider, rate, slider.stiffness)
    degree = 2 * slider.layers
    if slider.base is not None:
        ground = slider.base.mass * rate * (rate + slider.base.damping) + slider.base.stiffness
        numerator, denominator = numerator * ground, numerator + denominator * ground
        degree += 2
    return DynamicStiffness(numerator, denominator, degree)


def chain_stiffness(slider: LayeredSlider, rate: Any, stiffness: Any) -> tuple[Complex, Complex]:
    """Numerator and denominator of the dynamic stiffness of a chain, whose static stiffness may
    differ from the slider's and between rates."""
    mass = slider.mass / slider.layers
    spring = slider.layers * stiffness
    inertia = mass * rate**2
    joint = spring + slider.layer_damping * mass * rate
    numerator, denominator = inertia + spring, rate**0
    for _ in range(slider.layers - 1):
        above = joint * numerator
        denominator = joint * denominator + numerator
        numerator = inertia * denominator + above
        # Products of very many layers would overflow; only the ratio matters.
        size = abs(denominator)
        numerator, denominator = numerator / size, denominator / size
    return numerator, denominator


class RowScales(NamedTuple):
    """A row of blocks in units of the mass and the springs of neighbours, with its velocity of
    sound [m/s]."""

    sound_velocity: float
    contacts: float
    top: float
    edge: float
    drag: float
    viscosity: float
    damping: float


@singledispatch
def row_scales(slider: SliderTable, config: Config) -> RowScales | None:  # noqa: ARG001
    """Stiffnesses of contacts and drive, drag and damping of a block; None without neighbours."""
    return None


@row_scales.register
def _interface_scales(slider: InterfaceSlider, config: Any) -> RowScales | None:
    if slider.blocks < 2:
        return None
    contacts, rate, spring = config.contacts, slider.neighbour_frequency, slider.neighbour_spring
    return RowScales(
        sound_velocity=slider.sound_velocity,
        contacts=contacts.stiffness / slider.blocks / spring,
        top=slider.total_top_stiffness / slider.blocks / spring,
        edge=slider.edge_stiffness / spring,
        drag=contacts.count * contacts.contact_drag / slider.mass / rate,
        viscosity=slider.neighbour_damping / rate,
        damping=slider.damping_rate / rate,
    )


@singledispatch
def mode_frequencies(slider: SliderTable) -> list[float]:  # noqa: ARG001
    """Ascending frequencies of layers with free contacts and with clamped ones [1/s]; layers on
    undamped springs have one between each pair."""
    return []


@mode_frequencies.register
def _chain_frequencies(slider: LayeredSlider) -> list[float]:
    n = slider.layers
    clamped = (2 * n * slider.omega_s * math.sin(j * math.pi / (2 * n)) for j in range(1, n))
    return sorted([*slider.frequencies, *clamped])


@singledispatch
def loading_rate(slider: SliderTable, config: Config) -> float | None:  # noqa: ARG001
    """D1 = v_d √(KM)/F_s (S46); None if the drive stands, or without spring or mass."""
    return None


@loading_rate.register
def _inertial_loading_rate(slider: InertialSlider, config: Any) -> float | None:
    if config.drive_speed == 0:
        return None
    root = math.sqrt(slider.spring_stiffness * slider.mass)
    return float(config.drive_speed * root / config.contacts.static_force)


@singledispatch
def quantities(slider: SliderTable, config: Config) -> Iterator[Quantity]:  # noqa: ARG001
    """Quantities that follow from the slider's keys in closed form."""
    yield from ()


@quantities.register
def _quasistatic_quantities(slider: QuasistaticSlider, config: Any) -> Iterator[Quantity]:
    if slider.stiffness is not None and config.contacts.reattach:
        yield quantity("mean_avalanche_size", 1 + config.contacts.stiffness / slider.stiffness)


@quantities.register
def _rigid_quantities(slider: RigidSlider, config: Any) -> Iterator[Quantity]:
    yield quantity("damping_rate", slider.damping_rate)
    yield from _inertial_quantities(slider, config)


@quantities.register
def _interface_quantities(slider: InterfaceSlider, config: Any) -> Iterator[Quantity]:
    contacts = config.contacts
    block = contacts.stiffness / slider.blocks
    yield quantity("block_spacing", slider.block_spacing)
    yield quantity("block_mass", slider.block_mass)
    if slider.blocks > 1:
        spring, neighbour = slider.neighbour_spring, slider.neighbour_frequency
        yield quantity("neighbour_spring", spring)
        yield quantity("sound_velocity", slider.sound_velocity)
        yield quantity("block_time", 1 / neighbour)
        yield quantity("crossing_time", slider.blocks / neighbour)
        yield quantity("decay_length", slider.block_spacing * math.sqrt(spring / block))
        highest = math.sqrt(4 * neighbour**2 + block / slider.block_mass)
        yield quantity("pinned_frequency_highest", highest)
        yield quantity("drive_ratio", slider.spring_stiffness / (slider.bar_stiffness or math.inf))
        yield quantity("contact_ratio", contacts.stiffness / (slider.bar_stiffness or math.inf))
    yield quantity("damping_rate", slider.damping_rate)
    yield from _inertial_quantities(slider, config)


def _inertial_quantities(slider: InertialSlider, config: Config) -> Iterator[Quantity]:
    contacts, omega_s = config.contacts, slider.omega_s
    omega_l = math.sqrt(contacts.stiffness / slider.mass)
    yield quantity("omega_s", omega_s)
    yield quantity("setup_period", 2 * math.pi / omega_s)
    yield quantity("omega_l", omega_l)
    yield quantity("ringing_period", 2 * math.pi / omega_l)
    film = contacts.count * contacts.contact_drag / slider.mass
    yield quantity("film_drag_rate", film)
    yield quantity("slip_velocity_scale", slider.velocity_scale(config))
    yield from _first_slip(slider, config, film)


@quantities.register
def _layered_quantities(slider: LayeredSlider, config: Any) -> Iterator[Quantity]:
    yield quantity("slider_mass", slider.mass)
    yield quantity("slider_stiffness", slider.stiffness)
    lowest, *_, highest = (slider.frequencies[0], *slider.frequencies)
    yield quantity("chain_frequency", lowest)
    yield quantity("chain_frequency_highest", highest)
    if slider.base is not None:
        film_mass = config.contacts.count * config.contacts.contact_mass
        mass = slider.base.mass + slider.mass + film_mass
        yield quantity("pinned_base_frequency", math.sqrt(slider.base.stiffness / mass))
    if slider.cantilever is not None:
        bending = slider.cantilever.bending_frequency
        yield quantity("bending_frequency", bending)
        ratio = bending / math.sqrt(slider.cantilever.stiffness / slider.cantilever.mass)
        yield quantity("bending_ratio", ratio)
    yield from _inertial_quantities(slider, config)


def _first_slip(slider: InertialSlider, config: Config, film: float) -> Iterator[Quantity]:
    """Properties of the first slip without the force curve; ``film`` in 1/s."""
    contacts, omega_s = config.contacts, slider.omega_s
    d_1 = loading_rate(slider, config)
    if not d_1:
        return
    loading = contacts.static_force / slider.spring_stiffness / config.drive_speed
    yield quantity("loading_time", loading)
    yield quantity("D1", d_1)
    alpha = (6 / d_1) ** (1 / 3)
    yield quantity("alpha", alpha)
    yield quantity("slip_time_sequential", alpha / omega_s)
    # The peak of F(X) lies near F_s - Delta F_s, so D0 = F_d(X_c)/F_s is about 1 - delta.
    start = 1 - contacts.threshold.relative_width - film * d_1 / omega_s
    yield quantity("B", start / 2)
    if start > 0:
        beta = math.sqrt(2 / start)
        yield quantity("beta", beta)
        yield quantity("slip_time_melting", beta / omega_s)
