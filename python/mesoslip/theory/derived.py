"""Quantities that follow from a configuration in closed form, for ``mesoslip info``."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from mesoslip.configuration.config import Config
from mesoslip.configuration.contacts.base import LOAD_CHANGE_SECONDS
from mesoslip.output.inputs import ConfigLike, as_config
from mesoslip.theory.contacts import contact_theory
from mesoslip.theory.linear_stability import LinearStability, shown_by
from mesoslip.theory.sliders import quantities
from mesoslip.theory.steady_sliding import steady_sliding

# Maximum work for the stability of steady sliding, about a tenth of a second.
MAX_WORK = 10_000
# K* over its estimate, for thresholds of 0.3 to 10 % of all laws, and exponential ones.
ESTIMATE_RANGE = 0.2, 2.0
# What `mesoslip info` prints first: the limits of force and stiffness, times of stick-slip.
FIRST = (
    "K_star_estimate",
    "critical_stiffness_estimate",
    "F_steady_drive",
    "creep_velocity",
    "mean_avalanche_size",
    "crossing_time",
    "loading_time",
    "slip_time_sequential",
    "drive_duration",
)


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

    Parameters
    ----------
    config
        A TOML file, an output, nested tables, or a `Config`.

    Returns
    -------
    dict of `mesoslip.theory.derived.Derived`
        Each with its ``value``, ``unit`` and meaning.

    Raises
    ------
    FileError, ConfigError
        If the configuration cannot be read or is wrong.

    Examples
    --------
    >>> import mesoslip
    >>> path, *_ = mesoslip.example("klein")  # writes klein.toml
    >>> period = mesoslip.derived(path)["setup_period"]
    >>> round(period.value, 4), period.unit
    (0.0245, 's')
    """
    config = as_config(config)
    return {
        name: Derived(value, unit, meaning)
        for name, value, unit, meaning in (
            *contact_theory(config).quantities(),
            *quantities(config.slider, config),
            *_stability(steady_sliding(config, MAX_WORK)),
            *_drive(config),
        )
        if math.isfinite(value)
    }


def overview(config: Config, found: dict[str, Derived]) -> dict[str, Derived]:
    """The quantities to look at first, of those that were derived: forces, times and costs."""
    force = config.contacts.static_force
    first = {
        "static_force": Derived(force, "N", "mean static threshold of all contacts, F_s"),
        **{name: found[name] for name in FIRST if name in found},
    }
    life = found.get("mean_life_drive") or found.get("mean_life")
    if life is not None and config.contacts.reattach and config.duration < math.inf:
        length = math.fsum(part.path_length for part in config.drive_parts)
        first["contact_breaks"] = Derived(
            config.contacts.count * length / life.value,
            "1",
            "breaks of steady sliding along the whole drive, about the most there will be: fewer "
            "while it loads, and where slips pass detached contacts; engine eq: 0.1 to 0.5 µs each "
            "for most contacts",
        )
    changes = config.contact_kind.load_changes(config)
    if changes > 0:
        first["load_changes"] = Derived(
            changes,
            "1",
            "contacts that touch or separate as the load changes: "
            f"{LOAD_CHANGE_SECONDS * 1e6:g} µs each",
        )
    return first


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
    sliding, theory = steady_sliding(config, MAX_WORK), contact_theory(config)
    caveats = (theory.caveat, config.slider.caveat)
    sentences: tuple[str | None, ...] = (_verdict_of_stiffness(config), *caveats)
    if sliding is not None:
        # Contacts without a force curve have no K*, but a limit at each velocity.
        limit = sliding.limit if theory.depends_on_velocity else None
        sentences = (*sentences, sliding.summary, limit)
    return "\n".join(one for one in sentences if one) or None


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
    spring, theory = config.series_stiffness, contact_theory(config)
    if not 0 < spring < math.inf or theory.depends_on_velocity:
        return None
    estimate = theory.K_star_estimate
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
