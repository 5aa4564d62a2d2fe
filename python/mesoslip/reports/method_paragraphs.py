"""The method behind an output as a paragraph of a paper, with citations as in Markdown of Pandoc.

Sentences about sliders and contacts have a form for each kind, chosen by the type of its table.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from functools import singledispatch
from typing import TYPE_CHECKING

from mesoslip.array_types import DataTree
from mesoslip.configuration.config import Config
from mesoslip.configuration.contacts.tables.ageing import Ageing
from mesoslip.configuration.contacts.tables.interaction import Interaction
from mesoslip.configuration.contacts.tables.thermal import Thermal
from mesoslip.configuration.contacts.tables.track import Track
from mesoslip.configuration.drive import Drive
from mesoslip.configuration.keys import key_kind
from mesoslip.configuration.load import Load
from mesoslip.configuration.sliders.base import SliderTable
from mesoslip.configuration.sliders.force import ForceSlider
from mesoslip.configuration.sliders.interface import InterfaceSlider
from mesoslip.configuration.sliders.layered import LayeredSlider
from mesoslip.configuration.sliders.prescribed import PrescribedSlider
from mesoslip.configuration.sliders.quasistatic import QuasistaticSlider
from mesoslip.configuration.sliders.rigid import RigidSlider
from mesoslip.configuration.threshold_laws import LAWS
from mesoslip.errors import ConfigError, Problem
from mesoslip.output.arrays import Tree
from mesoslip.output.kinds import kind_of
from mesoslip.quantities import column, with_unit

if TYPE_CHECKING:
    from mesoslip.inference.posterior import Row

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
# Share of the duration before whose end a run ended early.
EARLY = 1e-3
ENERGY = "The balance of energy closes to {residual:.0e} of the work of the drive."


def quantity(value: float, unit: str) -> str:
    """A parameter with its unit, in full."""
    return with_unit(value, unit, DIGITS)


def run_method(tree: DataTree, config: Config) -> Iterator[str]:
    yield from _engine(config)
    yield from model(config, _run_length(config))
    yield from _early_end(tree, config)
    yield from _accuracy(tree, config)


def curve_method(tree: DataTree, config: Config) -> Iterator[str]:
    error = ""
    if "error" in tree.attrs:
        size = f"{float(tree.attrs['error']):.0e}".replace("e-0", "e-")
        error = f", with an estimated error of {size} of the static force"
    yield (
        "The force F(X) of slow sliding was computed for infinitely many contacts of the "
        f"{MODEL} with mesoslip [@mesoslip]: the master equation [@braun2010] is solved as a "
        f"renewal equation{error}."
    )
    yield from _contacts(config, is_slow=True)
    yield INITIAL[config.contacts.initial]


# Ends of the sentence on the iteration to each settled motion.
SETTLED = {
    "periodic": "until period and peaks did not change any more",
    "irregular": "without reaching a period: numbers of the motion are means over passages",
    "smooth": "until the oscillation had decayed",
}


def cycle_method(tree: DataTree, config: Config) -> Iterator[str]:
    yield from _engine(config)
    is_continued = tree.attrs.get("continued") == "true"
    start = ", from the state of an earlier cycle" if is_continued else ""
    yield (
        "It was iterated from one passage of the spring force through a section to the next"
        f"{start}, {SETTLED[str(tree.attrs['settled_motion'])]}."
    )
    yield from model(config, has_start=not is_continued)


def branches_method(tree: DataTree, config: Config) -> Iterator[str]:
    yield from _engine(config)
    yield (
        "At each value it was iterated from one passage of the spring force through a section "
        "to the next, from the state of the value before, up and down over "
        f"{tree.attrs['continued_key']}."
    )
    yield from model(config)


def lyapunov_method(tree: DataTree, config: Config) -> Iterator[str]:
    yield from _engine(config)
    yield (
        f"The largest Lyapunov exponent is the rate at which {tree.sizes['twin']} twins depart "
        "from the run: they start a small distance away, with the same random numbers."
    )
    yield from model(config, _run_length(config))


def steady_method(tree: DataTree, config: Config) -> Iterator[str]:
    yield (
        f"The force of steady sliding of the {MODEL}, and its linear stability, were computed "
        "with mesoslip [@mesoslip] for infinitely many contacts, from the survival of contacts "
        "over their lives and its change under a small oscillation of the slider."
    )
    yield from _contacts(config)
    yield slider_sentence(config.slider)
    if "velocity" in tree.coords:
        velocities = tree.to_dataset()["velocity"].values
        ends = (quantity(float(one), "m/s") for one in velocities[[0, -1]])
        yield f"Velocities are from {' to '.join(ends)}."


def onset_method(_: DataTree, config: Config) -> Iterator[str]:
    drag = ""
    if config.contacts.drag_rate:
        drag = f" and is dragged at the rate η = {quantity(config.contacts.drag_rate, '1/s')}"
    yield (
        f"The onset of slip of the {MODEL} was computed with mesoslip [@mesoslip], from the "
        "force curve of the master equation [@braun2010], for contacts that break one after "
        f"another and for a film that melts at once{drag}."
    )
    yield from model(config, is_slow=True)


def sweep_method(tree: DataTree, config: Config) -> Iterator[str]:
    # Others are realizations, directions and numbers of samples.
    keys = ", ".join(str(name) for name in tree.coords if "." in str(name))
    count = tree.sizes.get("realization", 1)
    each = f", with {count} realizations each" if count > 1 else ""
    yield from _engine(config)
    yield from model(config, _run_length(config))
    each = (", up and down" if "direction" in tree.coords else "") + each
    yield f"Varied were {keys}{each}; values above of these keys are those of the base."


def fit_method(tree: DataTree, config: Config) -> Iterator[str]:
    """Sentences on a fit, with the medians of its free keys."""
    from mesoslip.inference import posterior

    rows = posterior.table(tree)
    estimates = "; ".join(_estimate(one) for one in rows)
    # With the digits that the intervals have.
    medians = {
        one.key: float(f"{one.percentiles[2]:.{one.digits}g}")
        for one in rows
        if key_kind(one.key) is not None
    }
    whole = {key for key in medians if (kind := key_kind(key)) is not None and kind.is_whole}
    values = {key: round(one) if key in whole else one for key, one in medians.items()}
    note = "Values of free keys are medians of the posterior."
    try:
        config = config.replace(values)
    except ConfigError:
        note = f"Values above of {', '.join(values)} are not those of the fit."
    is_predicted = tree.attrs.get("predicted") == "true"
    count = 1 if is_predicted else len(str(tree.attrs.get("traces", "")).split("\n"))
    what, those, its = (
        ("a measured force", "The trace", "of it, with its")
        if count == 1
        else (f"{count} measured forces", "The traces", "of them, with their")
    )
    yield (
        f"Parameters of the {MODEL} were estimated with mesoslip [@mesoslip] from {what} (median, "
        f"interval of 90 %): {estimates}. {those} and {tree.attrs['simulation_count']} "
        f"simulations {its} sampling and noise, are reduced to the same summaries, and parameters "
        "are drawn from a synthetic likelihood of these [@wood2010] by an affine-invariant "
        "ensemble sampler [@foreman2013]."
    )
    if is_predicted:
        yield f"The trace {tree.attrs['traces']}, not in the fit, is predicted by these draws."
    yield from model(config)
    yield note


# Sentences on the method of each kind of output.
METHODS: dict[str, Callable[[DataTree, Config], Iterator[str]]] = {
    "run": run_method,
    "sweep": sweep_method,
    "cycle": cycle_method,
    "branches": branches_method,
    "curve": curve_method,
    "steady": steady_method,
    "onset": onset_method,
    "lyapunov": lyapunov_method,
    "rates": lambda tree, _: rates_method(tree),
    "fit": fit_method,
}


def computed_method(tree: DataTree, config: Config) -> str:
    """The method of an output that was computed."""
    return " ".join(METHODS[kind_of(tree)](tree, config))


def _estimate(row: Row) -> str:
    """A free key with its median and interval of 90 %."""
    shown = column(row.percentiles, row.unit, row.digits)
    low, _, median, _, high = (shown.text(one) for one in row.percentiles)
    return f"{row.key} {median} {shown.scale.name} ({low} to {high})".replace("  ", " ")


def rates_method(tree: DataTree) -> Iterator[str]:
    """A sentence on a posterior of rates and states."""
    laws = " and ".join(str(tree.attrs["laws"]).split("\n"))
    yield (
        "Rate-and-state parameters [@dieterich1979; @ruina1983] were estimated with mesoslip "
        f"[@mesoslip] from the record of the force: the motion of a slider without inertia by the "
        f"{laws} law is compared with the record, with normal noise, white and correlated, and "
        "parameters and noise are drawn by an affine-invariant ensemble sampler [@foreman2013] "
        "from independent priors, uniform or uniform in the logarithm."
    )


def measured_method(tree: DataTree) -> str:
    """The method of a measured trace, or of a posterior of its rates and states."""
    if kind_of(tree) == "rates":
        return " ".join(rates_method(tree))
    source = tree.attrs.get("measured_file", "a file")
    return (
        f"The measured trace ({source}) was analysed with mesoslip [@mesoslip]: slips are falls of "
        "the force that stand out of the noise and of ringing, by a rule without a model."
    )


def model(
    config: Config, length: str = "", *, has_start: bool = True, is_slow: bool = False
) -> Iterator[str]:
    """Sentences on contacts, slider and drive.

    Only a run has a length. Contacts start from their initial state, or from another one; in slow
    sliding their delay and drag do not matter.
    """
    yield from _contacts(config, is_slow=is_slow)
    if has_start:
        yield INITIAL[config.contacts.initial]
    yield slider_sentence(config.slider)
    yield f"{_motion(config.drive)}{length}."
    several = config.run.realizations
    if length and several > 1:
        yield f"{several} realizations have the seed {config.run.seed}."


def _engine(config: Config) -> Iterator[str]:
    if config.contact_kind.is_discrete:
        yield f"The {MODEL} was simulated with mesoslip [@mesoslip], from event to event."
    else:
        yield (
            f"The master equation [@braun2010] of the {MODEL}, its limit of infinitely many "
            "contacts, was solved with mesoslip [@mesoslip], in populations no wider than "
            f"{config.run.resolution:g} standard deviations of the breaking stretch."
        )


def _contacts(config: Config, *, is_slow: bool = False) -> Iterator[str]:
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
    raise ConfigError([Problem("", key, "has no sentence in reports")])


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


def _run_length(config: Config) -> str:
    """The end of the sentence on the drive of a run."""
    finite = math.isfinite(config.duration)
    return f" for {quantity(config.duration, 's')}" if finite else " until a condition is met"


def _early_end(tree: Tree, config: Config) -> Iterator[str]:
    """A sentence on a run that ended before its drive."""
    data = tree.to_dataset()
    if "time" not in data or not len(data["time"].values):
        return
    end, ending = float(data["time"].values[-1]), str(tree.attrs.get("ending", ""))
    if tree.attrs.get("complete") == "false":
        ending = "it was interrupted"
    if end < (1 - EARLY) * config.duration and ending:
        which = "It" if config.run.realizations == 1 else "The longest realization"
        yield f"{which} ended at {quantity(end, 's')}: {ending}."


def _motion(drive: Drive) -> str:
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


def _accuracy(tree: DataTree, config: Config) -> Iterator[str]:
    """Sentences on the integration of the slider, and on its error."""
    method = config.slider.solver_name(config)
    if method in {"adams", "bdf"}:
        yield "The slider is integrated by CVODE of SUNDIALS [@hindmarsh2005]."
    residual = abs(float(tree.attrs.get("energy_residual", math.nan)))
    if residual > 0:
        yield ENERGY.format(residual=residual)
