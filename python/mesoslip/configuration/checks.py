"""What may be wrong between the tables of a configuration, and what is too much for the machine."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable
from typing import TYPE_CHECKING

from mesoslip.configuration.tables import LayeredSlider, QuasistaticSlider

if TYPE_CHECKING:
    from mesoslip.configuration.config import Config

# What a run needs for each contact, and for each sample of the trace [bytes].
BYTES_PER_CONTACT = 150
BYTES_PER_SAMPLE = 3 * 7 * 8

# The same for a contact on a lattice, and for an avalanche in the catalogue.
BYTES_PER_CONTACT_ON_LATTICE = 260
BYTES_PER_AVALANCHE = 3 * 10 * 8
BYTES_PER_CONTACT_IN_SNAPSHOT = 3 * 3 * 8

# Stiffness of all bonds of a contact over its own, beyond which the force that breaks it, the
# difference of what it and what its neighbours pull, has fewer than ten digits.
STRONGEST_BONDS = 1e6

# Step of the master equation over the mean breaking stretch that can be followed.
FINEST = 2e-5


def cross_checks(config: Config) -> Iterable[tuple[str, str, object]]:
    """What is wrong between tables: key, message, value."""
    problems = [*_drive_checks(config)]
    if problems:
        yield from problems
        return
    if not (config.expected_duration > 0 and math.isfinite(config.expected_duration)):
        yield "drive", "so slow or so fast that the run has no finite duration", None
        return
    yield from _interaction_checks(config)
    interval = config.output_interval
    if interval > config.duration:
        yield "output.interval", f"must not exceed the duration, {config.duration:g} s", interval
    finer = config.output.slip_interval
    if finer is not None and finer > interval:
        yield "output.slip_interval", f"must not exceed the interval, {interval:g} s", finer

    if config.run.engine == "me" and config.run.realizations > 1:
        yield (
            "run.realizations",
            'must be 1 with engine "me", which leaves nothing to chance',
            config.run.realizations,
        )
    stretch = config.contacts.static_force / config.contacts.stiffness
    if config.curve.newborn_width > 0.25 * stretch:
        yield (
            "curve.newborn_width",
            "must be a narrow spread, at most a quarter of the mean breaking stretch, "
            f"{0.25 * stretch:.3g} m",
            config.curve.newborn_width,
        )

    if config.curve.newborn_width > 0 and config.contacts.initial == "steady":
        yield (
            "curve.newborn_width",
            'must be 0 with contacts.initial = "steady", the state of contacts without a spread',
            config.curve.newborn_width,
        )
    if isinstance(config.slider, LayeredSlider):
        method = config.slider.solver.method
        if config.run.engine == "me" and method not in {"auto", "series"}:
            yield (
                "slider.solver.method",
                'must be "series" with engine "me", whose contacts change their law at every step',
                method,
            )
    if config.run.engine == "me":
        fineness = config.run.resolution * config.contacts.threshold.relative_width
        if fineness < FINEST:
            yield (
                "run.resolution",
                f"times the relative width of the thresholds must be at least {FINEST:g}, or there "
                "are more populations than can be followed",
                config.run.resolution,
            )
    if config.output.layers and not isinstance(config.slider, LayeredSlider):
        yield "output.layers", 'is for slider.kind = "layered" only', True

    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    together = min(config.run.realizations, os.cpu_count() or 1)
    for key, needed, value in (
        (
            "contacts.count",
            (BYTES_PER_CONTACT if config.interaction is None else BYTES_PER_CONTACT_ON_LATTICE)
            * config.contacts.count
            * together
            * (config.run.engine == "eq"),
            config.contacts.count,
        ),
        (
            "run.avalanches",
            BYTES_PER_AVALANCHE
            * (config.run.avalanches or 0)
            * config.run.realizations
            * (config.output.avalanche_size is None),
            config.run.avalanches,
        ),
        (
            "output.snapshots",
            BYTES_PER_CONTACT_IN_SNAPSHOT
            * config.contacts.count
            * len(config.output.snapshots)
            * config.run.realizations,
            f"{len(config.output.snapshots)} times",
        ),
        (
            "output.interval",
            (BYTES_PER_SAMPLE + 16 * getattr(config.slider, "layers", 0) * config.output.layers)
            * config.expected_duration
            / interval
            * config.run.realizations,
            interval,
        ),
    ):
        if needed > memory:
            yield (
                key,
                f"the run needs {needed / 2**30:.3g} GiB for this, and the machine has "
                f"{memory / 2**30:.3g} GiB",
                value,
            )


def _drive_checks(config: Config) -> Iterable[tuple[str, str, object]]:
    """What is wrong with the drive and the length of the run: key, message, value."""
    run, drive = config.run, config.drive
    if isinstance(config.slider, QuasistaticSlider):
        spring = config.slider.stiffness
        if drive.force_rate is None and spring is None:
            yield "slider.stiffness", "missing; only a drive by force needs no spring", None
        elif drive.force_rate is not None and spring is not None:
            yield (
                "slider.stiffness",
                "has no meaning with drive.force_rate, which acts on the slider without a spring",
                spring,
            )
    elif drive.force_rate is not None:
        yield "drive.force_rate", 'is for slider.kind = "quasistatic" only', drive.force_rate
    if run.drive_displacement is not None:
        if not drive.velocity:
            yield (
                "run.drive_displacement",
                "needs a drive.velocity that is not 0",
                run.drive_displacement,
            )
        elif run.duration is not None:
            yield (
                "run.drive_displacement",
                "give either this or run.duration",
                run.drive_displacement,
            )
        elif math.isinf(config.duration):
            yield (
                "run.drive_displacement",
                f"takes for ever at {drive.velocity:g} m/s",
                run.drive_displacement,
            )
    if run.avalanches is not None:
        if not config.has_avalanches:
            yield (
                "run.avalanches",
                'needs [interaction] or slider.kind = "quasistatic": otherwise contacts break one '
                "by one",
                run.avalanches,
            )
        elif drive.velocity == 0:
            yield "drive.velocity", "must not be 0 for a run that avalanches end", drive.velocity
    if run.avalanches is None and config.duration == math.inf and run.drive_displacement is None:
        if drive.force_rate is not None and not config.contacts.reattach:
            return
        yield "run.duration", "needed, as the drive has no stages", None
    elif config.duration <= 0:
        yield "run.duration", "needed, as the drive has no stages", None


def _interaction_checks(config: Config) -> Iterable[tuple[str, str, object]]:
    """What is wrong with interaction, avalanches and snapshots: key, message, value."""
    contacts, interaction, output = config.contacts, config.interaction, config.output
    if isinstance(config.slider, QuasistaticSlider) and config.run.engine == "me":
        yield (
            "slider.kind",
            'needs engine "eq"; the force of infinitely many contacts over the displacement of a '
            "slider without inertia is that of mesoslip curve",
            config.slider.kind,
        )
    if interaction is None:
        for key in ("snapshots", "snapshot_size"):
            if getattr(output, key):
                yield f"output.{key}", "needs [interaction], for the places of contacts", None
        if output.avalanche_size is not None and not config.has_avalanches:
            yield (
                "output.avalanche_size",
                'needs [interaction] or slider.kind = "quasistatic"',
                output.avalanche_size,
            )
        return

    if config.run.engine == "me":
        yield (
            "interaction",
            'needs engine "eq": the master equation has no neighbours; in the mean, interaction '
            "acts like a narrower law of thresholds (contacts.threshold.relative_width)",
            None,
        )
    places = interaction.columns * interaction.rows
    if places != contacts.count:
        yield (
            "interaction.columns",
            f"times rows must be contacts.count: {interaction.columns} x {interaction.rows} = "
            f"{places}, not {contacts.count}",
            interaction.columns,
        )
    if contacts.area is None:
        yield "contacts.area", "needed for the distance between neighbours, a = (A/N)^(1/2)", None
    relative = interaction.neighbours * config.bond_stiffness / contacts.contact_stiffness
    if relative > STRONGEST_BONDS:
        strongest = interaction.strength * (STRONGEST_BONDS / relative)
        yield (
            "interaction.strength",
            "so strong that a contact cannot attach: the force at which it does, (k + G z) x less "
            f"the pull of its neighbours, is a difference of terms {relative:.1g} times as large, "
            f"without digits enough; at most {strongest:.3g}",
            interaction.strength,
        )
    times = output.snapshots
    if list(times) != sorted(set(times)) or (times and times[-1] > config.duration):
        yield (
            "output.snapshots",
            "must grow, up to the duration of the run",
            list(times),
        )
