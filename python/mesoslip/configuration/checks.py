"""Checks between the tables of a configuration that hold for all kinds of sliders and contacts."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Protocol

from mesoslip.configuration.drive import DrivePart
from mesoslip.configuration.run_tables import Curve, Run
from mesoslip.configuration.sliders import SLIDERS, base
from mesoslip.configuration.table import Complaint, Complaints


class Setting(base.Setting, Protocol):
    """A whole configuration to check."""

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
    """Errors of the drive and the length of the run."""
    run, drive = config.run, config.drive
    if drive.force_rate is not None and not config.slider.driven_by_force:
        named = _named(kind for kind, table in SLIDERS.items() if table.driven_by_force)
        yield Complaint("drive.force_rate", f"is for {named} only", drive.force_rate)
    elif drive.is_force and drive.force_rate is None and not config.slider.takes_forces:
        named = _named(kind for kind, table in SLIDERS.items() if table.takes_forces)
        key = "drive.force" if drive.force is not None else "drive.stage"
        yield Complaint(key, f"a force is for {named} only")
    if run.drive_displacement is not None:
        distance = run.drive_displacement
        if drive.is_force:
            yield Complaint(
                "run.drive_displacement", "is not for a force; give run.duration", distance
            )
        elif run.duration is not None:
            yield Complaint("run.drive_displacement", "give either this or run.duration", distance)
        elif not drive.last_velocity and not any(part.path_length for part in drive.parts):
            yield Complaint(
                "run.drive_displacement",
                "needs a drive.velocity that is not 0, or stages that move",
                distance,
            )
        elif math.isinf(config.duration):
            reach = math.fsum(part.path_length for part in drive.parts)
            yield Complaint(
                "run.drive_displacement",
                f"is never reached: the stages move the drive by {reach:g} m, and the last one "
                f"{'stands still' if drive.continues else 'ends'}"
                if drive.parts
                else f"is never reached at {drive.velocity:g} m/s",
                distance,
            )
    yield from _stop_problems(config)
    if run.avalanches is not None:
        if not config.has_avalanches:
            yield Complaint(
                "run.avalanches",
                f"needs [interaction] or {_named_jumping()}: otherwise there are no avalanches",
                run.avalanches,
            )
        elif drive.velocity == 0:
            yield Complaint(
                "drive.velocity", "must not be 0 if run.avalanches ends the run", drive.velocity
            )
    if run.avalanches is None and config.duration == math.inf and run.drive_displacement is None:
        if drive.force_rate is not None and not config.contacts.reattach:
            return
        yield Complaint("run.duration", "needed, as the drive has no stages")
    elif config.duration <= 0:
        yield Complaint("run.duration", "needed, as the drive has no stages")


def _stop_problems(config: Setting) -> Complaints:
    """Errors of the conditions that end a run early."""
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
        if (
            not config.drive.continues
            or last.start_velocity != last.end_velocity
            or not last.path_length
        ):
            yield Complaint(
                "run.stop.steady", "needs a drive that ends at a constant velocity other than 0"
            )
        elif config.drive.is_force:
            yield Complaint("run.stop.steady", "is not for a force")


def output_problems(config: Setting) -> Complaints:
    """Errors of [output]; the drive must be right."""
    if not (config.expected_duration > 0 and math.isfinite(config.expected_duration)):
        yield Complaint("drive", "too slow or too fast for a finite duration of the run")
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
    times = list(output.snapshots)
    if times and not config.contact_kind.is_discrete:
        yield Complaint("output.snapshots", 'needs engine "eq", which has contacts one by one')
    if output.snapshot_size is not None and not config.has_avalanches:
        yield Complaint(
            "output.snapshot_size",
            f"needs [interaction] or {_named_jumping()}; output.snapshots needs neither",
            output.snapshot_size,
        )
    if times != sorted(set(times)) or (times and times[-1] > config.duration):
        yield Complaint("output.snapshots", "must increase, up to the duration of the run", times)
    if output.avalanche_size is not None and not config.has_avalanches:
        yield Complaint(
            "output.avalanche_size",
            f"needs [interaction] or {_named_jumping()}",
            output.avalanche_size,
        )


def curve_problems(config: Setting) -> Complaints:
    """Errors of [curve]."""
    width, stretch = config.curve.newborn_width, config.contacts.break_stretch
    if width > 0.25 * stretch:
        yield Complaint(
            "curve.newborn_width",
            f"must be at most a quarter of the mean breaking stretch, {0.25 * stretch:.3g} m",
            width,
        )
    if width > 0 and config.contacts.newborn_width > 0:
        yield Complaint(
            "curve.newborn_width",
            "must be 0 with contacts.newborn_width, which the curve uses then",
            width,
        )
    if width > 0 and config.contacts.initial == "steady":
        yield Complaint(
            "curve.newborn_width",
            'must be 0 with contacts.initial = "steady", where all contacts attach at one stretch',
            width,
        )


def _below(bound: float, value: float) -> str:
    """A bound with enough digits to distinguish it from a value above it."""
    texts = (f"{bound:.{digits}g}" for digits in range(6, 18))
    return next(text for text in texts if float(text) < value)


def _named_jumping() -> str:
    return _named(kind for kind, table in SLIDERS.items() if table.jumps)


def _named(kinds: Iterable[str]) -> str:
    """Kinds of sliders, as a message names them."""
    return "slider.kind = " + " or ".join(f'"{kind}"' for kind in kinds)
