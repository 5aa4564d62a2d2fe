"""Files of LabVIEW (.tdms): channels of the same length are the columns."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from typing import IO, Any

import numpy as np

from mesoslip.measured.reading.binary import Contents, Found, Part, Reader
from mesoslip.measured.reading.packages import needed

# Properties of a channel that have its unit, in order of preference.
UNIT_PROPERTIES = ("unit_string", "unit", "Unit", "NI_UnitDescription")


@contextmanager
def _channels(source: IO[bytes]) -> Iterator[Contents]:
    library = needed("nptdms", "a file of LabVIEW (.tdms)", "npTDMS")
    with _warnings(library) as warnings, library.TdmsFile.open(source) as file:
        groups = [group for group in file.groups() if group.channels()]
        found: list[Found] = []
        for group in groups:
            # Names of groups distinguish channels of several groups only.
            before = f"{group.name}/" if len(groups) > 1 else ""
            found += _timed(before, group.channels())
        yield Contents(found, warnings)


@contextmanager
def _warnings(library: Any) -> Iterator[list[str]]:
    """The warnings of the library, such as those of a file that is cut short."""
    found: list[str] = []
    handler = logging.Handler()
    handler.emit = lambda record: found.append(record.getMessage())  # type: ignore[method-assign]
    loggers = library.log.log_manager.loggers.values()
    handlers = [one.handlers for one in loggers]
    for one in loggers:
        one.handlers = [handler]
    try:
        yield found
    finally:
        for one, before in zip(loggers, handlers, strict=True):
            one.handlers = before


def _timed(before: str, channels: list[Any]) -> Iterator[Found]:
    """The channels of a group, after the times of its waveforms if no channel has them."""
    waves = [one for one in channels if one.properties.get("wf_increment")]
    steps = {one.properties["wf_increment"] for one in waves}
    if len(steps) == 1 and not any(one.dtype.kind == "M" for one in channels):
        longest = max(waves, key=len)
        yield Found(
            f"{before}Time", (len(longest),), np.dtype(float), partial(_times, longest), "s"
        )
    for one in channels:
        name = f"{before}{one.name}"
        unit = next(
            (str(one.properties[key]) for key in UNIT_PROPERTIES if one.properties.get(key)), ""
        )
        if one.dtype.kind == "M":
            yield Found(name, (len(one),), np.dtype(float), partial(_seconds, one), "s")
        else:
            yield Found(name, (len(one),), one.dtype, partial(_numbers, one), unit)


def _times(channel: Any, part: Part) -> Any:
    """Times of a waveform [s]."""
    start, step = (channel.properties.get(key, 0.0) for key in ("wf_start_offset", "wf_increment"))
    return start + step * np.arange(*part[0].indices(len(channel)))


def _numbers(channel: Any, part: Part) -> Any:
    return channel[part[0]]


def _seconds(channel: Any, part: Part) -> Any:
    """Time stamps as seconds from the first one."""
    stamps, first = (
        np.asarray(channel[one], dtype="datetime64[ns]") for one in (part[0], slice(0, 1))
    )
    return (stamps - first) / np.timedelta64(1, "s")


READER = Reader("LabVIEW (.tdms)", b"TDSm", _channels, True)
