"""What may be wrong between the tables of a configuration whatever the kinds of its slider and
contacts, and what is too much for the machine.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Sequence
from typing import Protocol

from mesoslip.configuration.drive import DrivePart
from mesoslip.configuration.sliders import SLIDERS, base
from mesoslip.configuration.table import Complaint, Complaints
from mesoslip.configuration.tables import Curve, Run

# What a run needs for each sample of the trace, avalanche in the catalogue, and contact in a
# snapshot [bytes].
BYTES_PER_SAMPLE = 3 * 7 * 8
BYTES_PER_SAMPLE_OF_SLIP = 3 * 10 * 8
BYTES_PER_LAYER = 2 * 8
BYTES_PER_AVALANCHE = 3 * 10 * 8
BYTES_PER_CONTACT_IN_SNAPSHOT = 3 * 3 * 8


class Setting(base.Setting, Protocol):
    """What is checked: a whole configuration."""

    @property
    def run(self) -> Run: ...
    @property
    def slider(self) -> base.SliderTable: ...
    @property
    def curve(self) -> Curve: ...
    @property
    def duration(self) -> float: ...
    @property
    def drive_parts(self) -> Sequence[DrivePart]: ...
    @property
    def output_interval(self) -> float: ...
    @property
    def has_avalanches(self) -> bool: ...


def drive_problems(config: Setting) -> Complaints:
    """What is wrong with the drive and the length of the run."""
    run, drive = config.run, config.drive
    if drive.force_rate is not None and not config.slider.driven_by_force:
        named = _named(kind for kind, table in SLIDERS.items() if table.driven_by_force)
        yield Complaint("drive.force_rate", f"is for {named} only", drive.force_rate)
    if run.drive_displacement is not None:
        way = run.drive_displacement
        if run.duration is not None:
            yield Complaint("run.drive_displacement", "give either this or run.duration", way)
        elif not drive.last_velocity and not any(part.way for part in drive.parts):
            yield Complaint(
                "run.drive_displacement",
                "needs a drive.velocity that is not 0, or stages that move",
                way,
            )
        elif math.isinf(config.duration):
            reach = math.fsum(part.way for part in drive.parts)
            yield Complaint(
                "run.drive_displacement",
                f"is never reached: the stages move the drive by {reach:g} m, and the last one "
                f"{'stands still' if drive.goes_on else 'ends'}"
                if drive.parts
                else f"takes for ever at {drive.velocity:g} m/s",
                way,
            )
    yield from _stop_problems(config)
    if run.avalanches is not None:
        if not config.has_avalanches:
            yield Complaint(
                "run.avalanches",
                f"needs [interaction] or {_named_jumping()}: otherwise contacts break one by one",
                run.avalanches,
            )
        elif drive.velocity == 0:
            yield Complaint(
                "drive.velocity", "must not be 0 for a run that avalanches end", drive.velocity
            )
    if run.avalanches is None and config.duration == math.inf and run.drive_displacement is None:
        if drive.force_rate is not None and not config.contacts.reattach:
            return
        yield Complaint("run.duration", "needed, as the drive has no stages")
    elif config.duration <= 0:
        yield Complaint("run.duration", "needed, as the drive has no stages")


def _stop_problems(config: Setting) -> Complaints:
    """What is wrong with what ends the run before its time."""
    stop = config.run.stops
    if stop.slips is not None and config.slider.slip_velocity(config) == 0:
        yield Complaint(
            "run.stop.slips",
            "needs slips, which a slider with inertia has while the drive moves",
            stop.slips,
        )
    if stop.steady is not None:
        parts = config.drive_parts
        last = parts[-1]
        if not config.drive.goes_on or last.start_velocity != last.end_velocity or not last.way:
            yield Complaint(
                "run.stop.steady", "needs a drive that comes to a constant velocity, not 0"
            )
        elif config.drive.force_rate is not None:
            yield Complaint("run.stop.steady", "has no meaning for a force that grows")


def output_problems(config: Setting) -> Complaints:
    """What is wrong with what is recorded, of a run whose drive is right."""
    if not (config.expected_duration > 0 and math.isfinite(config.expected_duration)):
        yield Complaint("drive", "so slow or so fast that the run has no finite duration")
        return
    output, interval = config.output, config.output_interval
    if interval > config.duration:
        yield Complaint(
            "output.interval",
            f"must not exceed the duration, {_below(config.duration, interval)} s",
            interval,
        )
    finer = output.slip_interval
    if finer is not None and finer > interval:
        yield Complaint(
            "output.slip_interval",
            f"must not exceed the interval, {_below(interval, finer)} s",
            finer,
        )
    if output.layers and not config.slider.layers_recorded(config):
        named = _named(kind for kind, table in SLIDERS.items() if "layers" in table.model_fields)
        yield Complaint("output.layers", f"is for {named} only", True)
    if not config.contact_kind.on_lattice:
        for key in ("snapshots", "snapshot_size"):
            if getattr(output, key):
                yield Complaint(f"output.{key}", "needs [interaction], for the places of contacts")
    times = list(output.snapshots)
    if times != sorted(set(times)) or (times and times[-1] > config.duration):
        yield Complaint("output.snapshots", "must grow, up to the duration of the run", times)
    if output.avalanche_size is not None and not config.has_avalanches:
        yield Complaint(
            "output.avalanche_size",
            f"needs [interaction] or {_named_jumping()}",
            output.avalanche_size,
        )


def curve_problems(config: Setting) -> Complaints:
    """What is wrong with the force curve."""
    width, stretch = config.curve.newborn_width, config.contacts.break_stretch
    if width > 0.25 * stretch:
        yield Complaint(
            "curve.newborn_width",
            "must be a narrow spread, at most a quarter of the mean breaking stretch, "
            f"{0.25 * stretch:.3g} m",
            width,
        )
    if width > 0 and config.contacts.initial == "steady":
        yield Complaint(
            "curve.newborn_width",
            'must be 0 with contacts.initial = "steady", the state of contacts without a spread',
            width,
        )


def memory_problems(config: Setting) -> Complaints:
    """What does not fit into the machine's memory."""
    run, output, contacts = config.run, config.output, config.contacts
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    together = min(run.realizations, os.cpu_count() or 1)
    in_catalogue = (run.avalanches or 0) if output.avalanche_size is None else 0
    per_sample = BYTES_PER_SAMPLE + BYTES_PER_LAYER * config.slider.layers_recorded(config)
    finer = 0.0 if output.slip_interval is None else _time_in_slips(config) / output.slip_interval
    lattices = BYTES_PER_CONTACT_IN_SNAPSHOT * contacts.count * run.realizations
    after = 0.0 if output.snapshot_size is None else _breaks(config) / output.snapshot_size
    for key, needed, value in (
        (
            "contacts.count",
            config.contact_kind.bytes_per_contact * contacts.count * together,
            contacts.count,
        ),
        ("run.avalanches", BYTES_PER_AVALANCHE * in_catalogue * run.realizations, run.avalanches),
        (
            "output.snapshots",
            lattices * len(output.snapshots),
            f"{len(output.snapshots)} times",
        ),
        (
            "output.snapshot_size",
            lattices * min(after, run.avalanches or math.inf),
            output.snapshot_size,
        ),
        (
            "output.interval",
            per_sample * config.expected_duration / config.output_interval * run.realizations,
            config.output_interval,
        ),
        (
            "output.slip_interval",
            BYTES_PER_SAMPLE_OF_SLIP * finer * run.realizations,
            output.slip_interval,
        ),
    ):
        if needed > memory:
            yield Complaint(
                key,
                f"the run may need {needed / 2**30:.3g} GiB for this, and the machine has "
                f"{memory / 2**30:.3g} GiB",
                value,
            )


def _time_in_slips(config: Setting) -> float:
    """About how long slips take together, if each lasts two periods, after the spring's loading to
    the static force [s]."""
    slider = config.slider
    if config.drive_speed == 0 or slider.slip_velocity(config) == 0:
        return 0.0
    loading = config.contacts.static_force / slider.spring_stiffness / config.drive_speed
    return config.expected_duration * min(1.0, 4 * slider.quiet_time / loading)


def _breaks(config: Setting) -> float:
    """About how many contacts break: one after each mean breaking stretch, and under a force that
    grows each of them about once, before the slider slides without end."""
    contacts = config.contacts
    if not contacts.reattach or config.drive.force_rate is not None:
        return contacts.count
    way = math.fsum(part.way for part in config.drive_parts)
    return contacts.count * way / contacts.break_stretch


def _below(bound: float, value: float) -> str:
    """A bound that a value exceeds, with as many digits as distinguish them."""
    texts = (f"{bound:.{digits}g}" for digits in range(6, 18))
    return next(text for text in texts if float(text) < value)


def _named_jumping() -> str:
    return _named(kind for kind, table in SLIDERS.items() if table.jumps)


def _named(kinds: Iterable[str]) -> str:
    """Kinds of sliders, as a message names them."""
    return "slider.kind = " + " or ".join(f'"{kind}"' for kind in kinds)
