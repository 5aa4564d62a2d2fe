"""Statistics of the events of an output: slips, avalanches, or those of a second channel."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mesoslip.analysis.events.channel import CHANNEL, Emissions, emissions_of
from mesoslip.analysis.events.laws import BValue, Omori, b_value, omori
from mesoslip.array_types import Array
from mesoslip.configuration import arguments
from mesoslip.configuration.arguments import check_choice
from mesoslip.errors import ConfigError, FileError
from mesoslip.output.access import group_of
from mesoslip.output.arrays import Tree
from mesoslip.output.inputs import OutputLike, opened_run_arrays
from mesoslip.output.table_files import PrintedTable, write_table
from mesoslip.quantities import number, with_error

# Catalogues, and the column that is the size of an event.
CATALOGUES = {"slips": "force_drop", "avalanches": "size", "channel": "amplitude"}
# Share of the events that are main ones, the largest, and their minimum number.
MAIN_SHARE, MIN_MAIN = 0.05, 3
# Window around a slip in which an event of the channel belongs to it, over the slip's duration.
WINDOW = 1.0


@dataclass(frozen=True)
class Coincidence:
    """Slips and events of a channel beside each other."""

    slips: int
    with_events: int
    """Slips that have an event from one duration before their start to one after their end."""
    events: int
    in_slips: int
    """Events that belong to a slip."""
    by_chance: float
    """Expected number of such events, if they were independent of slips."""
    median_lag: float
    """Median time from the start of a slip to that of its first event [s]."""
    lag_error: float


@dataclass(frozen=True)
class EventSummary:
    """The events of a catalogue, with their statistics."""

    catalogue: str
    time: Array
    size: Array
    duration: float
    """Duration of the record [s], over all realizations."""
    b: BValue | None
    omori: Omori | None
    main_size: float
    coincidence: Coincidence | None
    emissions: Emissions | None

    @property
    def tables(self) -> list[PrintedTable]:
        """The statistics for print."""
        return [PrintedTable("Events", ("", "value"), tuple(self._rows()))]

    def _rows(self) -> Iterator[tuple[str, str]]:
        yield f"{self.catalogue}", str(self.time.size)
        yield "rate", f"{number(self.time.size / self.duration)} 1/s"
        if self.emissions is not None:
            kind = "trigger, between" if self.emissions.is_trigger else "envelope, above"
            yield f"channel ({kind})", number(self.emissions.threshold)
        if self.b is None:
            yield "b-value", "too few events, or all of one size"
        else:
            is_aki = math.isnan(self.b.half_detected)
            label = "b-value (Aki)" if is_aki else "b-value (with detection)"
            ends = [number(one, 3) for one in (self.b.low, self.b.high)]
            if math.isfinite(self.b.high):
                yield label, with_error(self.b.value, self.b.error)
                yield "95 % interval", " to ".join(ends)
            else:
                yield label, f"above {ends[0]} (95 %), by these events alone"
            yield "events of the fit", str(self.b.count)
            if not is_aki:
                yield "half are detected at log10(size)", number(self.b.half_detected)
            yield "completeness, log10(size)", number(self.b.completeness)
            verdict = "rejected" if self.b.p_value < 0.05 else "not rejected"
            yield "Gutenberg-Richter law", f"{verdict} (p = {number(self.b.p_value, 2)})"
        if self.omori is None:
            yield "Omori's law", "too few events after main ones"
            return
        law = self.omori
        yield "main events, of size from", f"{number(self.main_size)} ({law.main_count})"
        yield "events after them", str(law.count)
        text = "the rate decays" if law.decays else "no decay stands out"
        yield "Omori's law", f"{text} (gain of AIC {number(law.gain, 3)})"
        if law.decays:
            yield "p", with_error(law.p, law.p_error)
            yield "c", with_error(law.c, law.c_error, "s")
            yield "background", f"{number(law.background)} 1/s"

    @property
    def notes(self) -> list[str]:
        """Sentences on slips beside events of a channel."""
        one = self.coincidence
        if one is None:
            return []
        return (
            [
                f"{one.with_events} of {one.slips} slips have an event of the channel; "
                f"{one.in_slips} of {one.events} events belong to a slip, "
                f"{number(one.by_chance, 3)} by chance",
                f"the first event is {with_error(one.median_lag, one.lag_error, 's')} after the "
                "start of the slip, in the median",
            ]
            if one.with_events
            else ["no slip has an event of the channel"]
        )

    def write_csv(self, path: Path) -> None:
        """Write the events as a table in SI."""
        rows = zip(self.time.tolist(), self.size.tolist(), strict=True)
        units = {"time": "s", "size": "-"}
        write_table([{"time": time, "size": size} for time, size in rows], units, path)

    def to_json(self) -> dict[str, Any]:
        """Everything as nested lists and numbers."""

        def plain(one: Any) -> Any:
            return None if one is None else asdict(one)

        return {
            "catalogue": self.catalogue,
            "duration": self.duration,
            "b_value": plain(self.b),
            "omori": plain(self.omori),
            "main_size": self.main_size,
            "coincidence": plain(self.coincidence),
            "events": [
                {"time": time, "size": size}
                for time, size in zip(self.time.tolist(), self.size.tolist(), strict=True)
            ],
        }


@arguments.checked(
    threshold=arguments.number(0), completeness=arguments.number(), main_size=arguments.number(0)
)
def events_of(
    tree: Tree,
    catalogue: str | None = None,
    *,
    threshold: float | None = None,
    completeness: float | None = None,
    main_size: float | None = None,
    name: str = "the output",
) -> EventSummary:
    """The statistics of the events of an output; see `events`."""
    if catalogue is None:
        catalogue = "avalanches" if "avalanches" in tree.children else "slips"
        catalogue = "channel" if CHANNEL in tree.data_vars else catalogue
    if threshold is not None and catalogue != "channel":
        message = f"is that of the channel, and these events are {catalogue}"
        raise ConfigError.of("threshold", message, threshold)
    emissions = None
    times = tree.to_dataset()["time"].values
    record = float(times[-1] - times[0])
    realizations = max(1, tree.sizes.get("realization", 1))
    if catalogue == "channel":
        emissions = emissions_of(tree, threshold)
        time, size, owner = emissions.start_time, emissions.amplitude, None
    elif catalogue in tree.children:
        data = group_of(tree, catalogue)
        time = data["start_time"].values.astype(float)
        size = np.abs(data[CATALOGUES[catalogue]].values.astype(float))
        owner = data["realization_index"].values
    else:
        raise FileError(f"{name}: has no {catalogue}")
    if main_size is None:
        count = max(MIN_MAIN, math.ceil(MAIN_SHARE * size.size))
        main_size = float(np.sort(size)[-count]) if size.size >= count else math.inf
    # Realizations are one after the other.
    shifted = time if owner is None else time + 2 * owner * record
    decay = omori(shifted, size, main_size, float(times[-1])) if realizations == 1 else None
    coincidence = None
    if emissions is not None and "slips" in tree.children:
        coincidence = _coincidence(tree, emissions, record)
    return EventSummary(
        catalogue,
        time,
        size,
        record * realizations,
        b_value(size, completeness),
        decay,
        main_size,
        coincidence,
        emissions,
    )


def _coincidence(tree: Tree, emissions: Emissions, record: float) -> Coincidence | None:
    """Slips and events of the channel, whose times are those of one clock."""
    data = group_of(tree, "slips")
    start, end = data["start_time"].values, data["end_time"].values
    if not start.size:
        return None
    margin = WINDOW * (end - start)
    low = np.searchsorted(emissions.start_time, start - margin)
    high = np.searchsorted(emissions.start_time, end + margin, "right")
    has = high > low
    first = emissions.start_time[low[has]] - start[has]
    covered = min(float(np.sum(end - start + 2 * margin)), record)
    count = emissions.start_time.size
    error = (
        1.2533 * float(first.std(ddof=1)) / math.sqrt(first.size) if first.size > 1 else math.nan
    )
    inside = np.zeros(count, dtype=bool)
    for one, after in zip(low, high, strict=True):
        inside[one:after] = True
    return Coincidence(
        int(start.size),
        int(has.sum()),
        int(count),
        int(inside.sum()),
        count * covered / record,
        float(np.median(first)) if first.size else math.nan,
        error,
    )


def events(
    output: OutputLike,
    catalogue: str | None = None,
    *,
    threshold: float | None = None,
    completeness: float | None = None,
    main_size: float | None = None,
) -> dict[str, Any]:
    """The b-value and Omori's decay of a catalogue, and a second channel beside slips.

    Parameters
    ----------
    output
        Output of a run, or a measured trace.
    catalogue
        "slips" (sizes are force drops [N]), "avalanches" (breaks), or "channel" (amplitudes of
        acoustic emission); by default the last of these that the output has.
    threshold
        Minimum amplitude of an event of the channel, in its unit; 6 standard deviations of its
        noise by default.
    completeness
        Minimum magnitude, the decimal logarithm of a size, of the b-value; by default from a fit of
        the probability of detection, which is fitted together with b if there are few events.
    main_size
        Minimum size of main events, after which the rate may decay; the largest 5 % by default.

    Returns
    -------
    dict
        ``b_value``, with a 95 % interval from ``low`` to ``high``, and ``omori``, both with
        standard errors, None for too few events; ``coincidence`` of slips and events of the
        channel; ``events``, with times [s] and sizes.

    Raises
    ------
    FileError
        If the output cannot be read, or has no such catalogue.
    ConfigError
        If there is no catalogue of that name.

    Examples
    --------
    >>> import mesoslip
    >>> path, *_ = mesoslip.example("bundle")  # writes bundle.toml
    >>> tree = mesoslip.run(mesoslip.Config.load(path, ["contacts.count=20000"]))
    >>> found = mesoslip.events(tree, "avalanches")
    >>> found["b_value"]["value"] > 0, len(found["events"])
    (True, 24532)
    """
    check_choice("catalogue", catalogue, CATALOGUES)
    with opened_run_arrays(output) as tree:
        return events_of(
            tree, catalogue, threshold=threshold, completeness=completeness, main_size=main_size
        ).to_json()
