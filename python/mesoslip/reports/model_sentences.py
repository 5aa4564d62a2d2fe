"""A model in sentences: its engine, contacts, slider and drive.

Sentences about sliders and contacts have a form for each kind, chosen by the type of its table.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import singledispatch

from mesoslip.configuration.config import Config
from mesoslip.configuration.contacts.tables.ageing import Ageing
from mesoslip.configuration.contacts.tables.interaction import Interaction
from mesoslip.configuration.contacts.tables.thermal import Thermal
from mesoslip.configuration.contacts.tables.track import Track
from mesoslip.configuration.drive import Drive
from mesoslip.configuration.load import Load
from mesoslip.configuration.sliders.base import SliderTable
from mesoslip.configuration.sliders.force import ForceSlider
from mesoslip.configuration.sliders.interface import InterfaceSlider
from mesoslip.configuration.sliders.layered import LayeredSlider
from mesoslip.configuration.sliders.prescribed import PrescribedSlider
from mesoslip.configuration.sliders.quasistatic import QuasistaticSlider
from mesoslip.configuration.sliders.rigid import RigidSlider
from mesoslip.configuration.threshold_laws import LAWS
from mesoslip.errors import ConfigError
from mesoslip.quantities import with_unit

MODEL = "earthquake-like model of a multicontact interface [@braun2009; @braun2011; @braun2015]"
INITIAL = {
    "relaxed": "At the start no contact bears a force.",
    "steady": "At the start contacts are in the stationary state of slow sliding.",
    "uniform": "At the start the stretches are uniformly distributed up to breaking.",
}
COUPLINGS = {
    "scaled": "the stiffness of a contact is proportional to the square root of its threshold",
    "equal": "all contacts have the same stiffness",
    "table": "each has the stiffness that its table has beside it",
}
# Significant digits of parameters.
DIGITS = 6


def quantity(value: float, unit: str) -> str:
    """A parameter with its unit, in full."""
    return with_unit(value, unit, DIGITS)


def model(
    config: Config, length: str = "", *, has_start: bool = True, is_slow: bool = False
) -> Iterator[str]:
    """Sentences on contacts, slider and drive.

    Only a run has a length. Contacts start from their initial state, or from another one; in slow
    sliding their delay and drag do not matter.
    """
    yield from contact_sentences(config, is_slow=is_slow)
    if has_start:
        yield INITIAL[config.contacts.initial]
    yield slider_sentence(config.slider)
    yield f"{motion(config.drive)}{length}."
    several = config.run.realizations
    if length and several > 1:
        yield f"{several} realizations have the seed {config.run.seed}."


def engine(config: Config) -> Iterator[str]:
    if config.contact_kind.is_discrete:
        yield f"The {MODEL} was simulated with mesoslip [@mesoslip], from event to event."
    else:
        yield (
            f"The master equation [@braun2010] of the {MODEL}, its limit of infinitely many "
            "contacts, was solved with mesoslip [@mesoslip], in populations no wider than "
            f"{config.run.resolution:g} standard deviations of the breaking stretch."
        )


def contact_sentences(config: Config, *, is_slow: bool = False) -> Iterator[str]:
    contacts = config.contacts
    count = f"N = {contacts.count}" if config.contact_kind.is_discrete else "Infinitely many"
    law = contacts.threshold
    is_sampled = LAWS[law.law].is_sampled
    spread = "are those of a table of samples," if is_sampled else f"follow the {law.law} law"
    yield (
        f"{count} contacts have the total stiffness "
        f"Nk = {quantity(contacts.stiffness, 'N/m')} and the total static force "
        f"F_s = {quantity(contacts.static_force, 'N')}; their thresholds "
        f"{spread} with a relative standard deviation of "
        f"{law.relative_width:.6g}, and {COUPLINGS[contacts.coupling]}."
    )
    yield _lives(config, is_slow=is_slow or config.slider.ignores_delay)
    for key, feature in config.contact_features.items():
        yield feature_sentence(feature, key, config)
    if not config.pressing.is_uniform:
        shares = config.block_shares
        yield (
            f"Blocks bear {shares.min():.3g} to {shares.max():.3g} times the mean normal force of "
            "all, with as many contacts."
        )


def _lives(config: Config, *, is_slow: bool) -> str:
    """The sentence on breaking contacts; in slow sliding they attach at once, without drag."""
    contacts = config.contacts
    if not contacts.reattach:
        return "A contact that reaches its threshold breaks for good."
    drag = ""
    if contacts.drag and not is_slow:
        drag = f"is dragged (all together: Nmη = {quantity(contacts.drag, 'N s/m')}), "
    elif contacts.drag_rate and not is_slow:
        drag = f"is dragged at the rate η = {quantity(contacts.drag_rate, '1/s')}, "
    wait = "at once"
    if contacts.delay and not is_slow:
        delay = quantity(contacts.delay, "s")
        drawn = " drawn from the exponential law of mean" if contacts.delay_law != "fixed" else ""
        wait = f"after a delay{drawn} τ_d = {delay}"
    force = "without force"
    if contacts.back_force_ratio:
        force = f"under the force f_b = {contacts.back_force_ratio:g} f_s"
    width = ""
    if contacts.newborn_width:
        width = f", with a standard deviation of {contacts.newborn_width:g} f_s"
    return (
        f"A contact that reaches its threshold breaks, {drag}and attaches again {wait}, "
        f"{force}{width} (f_s: mean threshold)."
    )


@singledispatch
def feature_sentence(feature: object, key: str, config: Config) -> str:  # noqa: ARG001
    """A sentence on the key or table that makes contacts of a kind of their own."""
    raise ConfigError.of(key, "has no sentence in reports")


@feature_sentence.register
def _ageing(ageing: Ageing, key: str, config: Config) -> str:  # noqa: ARG001
    time = quantity(ageing.time, "s")
    if ageing.law == "log":
        return (
            f"Thresholds grow with age as 1 + β ln(1 + t/τ_a), β = {ageing.growth:g} and "
            f"τ_a = {time}."
        )
    return (
        f"Thresholds of young contacts are {ageing.young_force_ratio:g} of those of old ones, with "
        f"a relative standard deviation of {ageing.young_relative_width:g}, and relax within "
        f"τ_a = {time}."
    )


@feature_sentence.register
def _thermal(thermal: Thermal, key: str, config: Config) -> str:  # noqa: ARG001
    rate = quantity(thermal.rate, "1/s")
    ratio = thermal.ratio(config.contacts.contact_static_force)
    return (
        "Under a force f below its threshold a contact breaks at the rate ω_0 exp((f − f_s)/f_T) "
        f"[@barel2010; @braun2011temperature], ω_0 = {rate}, f_T = "
        f"{quantity(ratio, '1')} f_s."
    )


@feature_sentence.register
def _track(track: Track, key: str, config: Config) -> str:  # noqa: ARG001
    return (
        "The thresholds of contacts that attach where the slider is at X are multiplied by "
        f"1 + w g(X), a Gaussian function of mean 1 with w = {track.spread:g} and a correlation "
        f"that is {track.correlation}, of length {quantity(track.length, 'm')}."
    )


@feature_sentence.register
def _renewal(renewal: str, key: str, config: Config) -> str:  # noqa: ARG001
    return "A contact keeps its threshold in all its lives."


@feature_sentence.register
def _load(load: Load, key: str, config: Config) -> str:  # noqa: ARG001
    reference = quantity(load.normal_force, "N")
    if not load.varies:
        return (
            f"Contacts are {load.max_force / load.normal_force:g} times as many, under the normal "
            f"force {quantity(load.max_force, 'N')}, N under {reference}."
        )
    within = f"between {quantity(load.min_force, 'N')} and {quantity(load.max_force, 'N')}"
    if load.cycle is not None:
        within += f" at {quantity(load.cycle.frequency, '1/s')}"
    return (
        f"Their number is that at the normal force {reference}, and proportional to it; it varies "
        f"{within}. Contacts touch without a force, and the last ones separate first."
    )


@feature_sentence.register
def _interaction(lattice: Interaction, key: str, config: Config) -> str:  # noqa: ARG001
    return (
        f"Contacts interact with their neighbours on a periodic {lattice.lattice} lattice of "
        f"{lattice.columns} × {lattice.rows} sites, with the strength ξ = {lattice.strength:g}."
    )


@singledispatch
def slider_sentence(slider: SliderTable) -> str:
    raise TypeError(f"there is no sentence on a slider of kind {slider.kind}")


@slider_sentence.register
def _rigid(slider: RigidSlider) -> str:
    damping = "without damping"
    if slider.damping_rate:
        rate = quantity(slider.damping_rate, "1/s")
        damping = f"with damping of its velocity relative to the running mean, η_S = {rate}"
    return (
        f"The slider is a rigid mass M = {quantity(slider.mass, 'kg')} on a spring "
        f"K = {quantity(slider.stiffness, 'N/m')}, {damping}."
    )


@slider_sentence.register
def _layered(slider: LayeredSlider) -> str:
    base = damping = ""
    if slider.layer_damping:
        damping = (
            f", with damping between layers at the rate {quantity(slider.layer_damping, '1/s')}"
        )
    if slider.base is not None:
        base = (
            f" It slides on a base of the mass {quantity(slider.base.mass, 'kg')} on a spring of "
            f"{quantity(slider.base.stiffness, 'N/m')}."
        )
    return (
        f"The slider is an elastic block of {slider.layers} layers, with the mass "
        f"M = {quantity(slider.mass, 'kg')} and the static stiffness "
        f"K = {quantity(slider.stiffness, 'N/m')}{damping}.{base}"
    )


@slider_sentence.register
def _row_of_blocks(slider: InterfaceSlider) -> str:
    springs = {
        "edge": f"at the first block, K = {quantity(slider.edge_stiffness, 'N/m')}",
        "top": f"from above on every block, K_t = {quantity(slider.total_top_stiffness, 'N/m')}",
        "both": f"at the first block, K = {quantity(slider.edge_stiffness, 'N/m')}, and from above "
        f"on every block, K_t = {quantity(slider.total_top_stiffness, 'N/m')}",
    }[slider.loading]
    bar = damping = ""
    if slider.blocks > 1:
        bar = f" and the static stiffness K_b = {quantity(slider.bar_stiffness or 0.0, 'N/m')}"
    if slider.neighbour_damping and slider.blocks > 1:
        rate = quantity(slider.neighbour_damping, "1/s")
        damping = f", with damping between neighbours at the rate {rate}"
    if slider.damping_rate:
        rate = quantity(slider.damping_rate, "1/s")
        damping += f", with damping of velocities relative to their running means, η_S = {rate}"
    return (
        f"The slider is a row of {slider.blocks} blocks over {quantity(slider.length, 'm')}, each "
        f"on its own contacts, with the mass M = {quantity(slider.mass, 'kg')}{bar}{damping}. The "
        f"drive pulls it {springs}."
    )


@slider_sentence.register
def _prescribed(slider: PrescribedSlider) -> str:  # noqa: ARG001
    return "The slider moves with the drive."


@slider_sentence.register
def _quasistatic(slider: QuasistaticSlider) -> str:
    if not slider.spring_stiffness:
        return "The slider has no inertia and is in equilibrium with the force of the drive."
    stiffness = quantity(slider.spring_stiffness, "N/m")
    return f"The slider has no inertia and is in equilibrium with its spring K = {stiffness}."


@slider_sentence.register
def _under_a_force(slider: ForceSlider) -> str:
    damping = "without damping"
    if slider.damping:
        damping = f"with damping at the rate η_S = {quantity(slider.damping, '1/s')}"
    return f"The slider is a rigid mass M = {quantity(slider.mass, 'kg')} {damping}."


def motion(drive: Drive) -> str:
    """A sentence on a drive, without its end."""
    if drive.velocity is not None:
        return f"The drive moves at v_d = {quantity(drive.velocity, 'm/s')}"
    if drive.force_rate is not None:
        return f"The force of the drive grows at {quantity(drive.force_rate, 'N/s')}"
    if drive.force is not None:
        return f"The force of the drive is {quantity(drive.force, 'N')}"
    if drive.cycle is not None:
        cycle = drive.cycle
        return (
            f"The drive oscillates between ±{quantity(cycle.amplitude, 'm')} at "
            f"{quantity(cycle.speed, 'm/s')}"
        )
    if drive.history is not None:
        return "The drive follows a measured history"
    count = drive.parts[-1].stage + 1
    return f"The drive has {count} stage{'s' * (count > 1)}"
