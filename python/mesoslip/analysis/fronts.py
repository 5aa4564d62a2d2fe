"""The fronts of an interface with a length: catalogues of fronts and events, their statistics."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mesoslip.analysis.avalanche_sizes import PowerLawFit, fit_power_law
from mesoslip.array_types import Array, DataTree
from mesoslip.configuration.config import Config
from mesoslip.errors import FileError
from mesoslip.output.access import config_of, group_of
from mesoslip.output.arrays import Tree
from mesoslip.output.inputs import OutputLike, opened_run_arrays
from mesoslip.output.table_files import PrintedTable, rows_of, write_tables
from mesoslip.output.variables import FRONTS, Group, Meaning
from mesoslip.quantities import column, number, with_error
from mesoslip.simulation.fronts import ARRESTED, ARRESTS, KINDS, PRECURSOR

NO_FRONTS = 'no fronts: they are recorded with slider.kind = "interface"'

# Types of fronts: those that stop on the way, those of a known speed, and all others. Slow ones are
# slower than this part of the velocity of sound.
FRONT_TYPES = ("arrested", "slow", "subsonic", "supersonic", "unresolved")
SLOW = 0.1

# Columns of fronts that are not in the group of an output.
ALL_FRONTS = Group(
    FRONTS,
    speed_ratio=Meaning("1", "size of the speed over that of sound in the row of blocks"),
    front_type=Meaning(
        "1",
        "type of the front: arrested on the way; else by its speed, slow below a tenth of sound",
        np.int8,
        further={"flag_meanings": " ".join(FRONT_TYPES)},
    ),
)
EVENTS = Group(
    FRONTS.subset("realization_index", "event", "start_time", "end_time", "kind"),
    front_count=Meaning("1", "fronts of the event", np.int64),
    block_count=Meaning("1", "blocks that ruptured", np.int64),
    length=Meaning("m", "length of the interface that detached"),
    nucleation_position=Meaning("m", "position of the first nucleation"),
    force_drop=FRONTS["force_drop"],
    spring_force=Meaning("N", "force of the drive before the event"),
    stress_ratio_before=FRONTS["stress_ratio_before"],
)
# Printed columns: header, and SI unit.
EVENT_HEADS = {
    "event": ("event", "1"),
    "start_time": ("start", "s"),
    "kind": ("kind", ""),
    "front_count": ("fronts", "1"),
    "length": ("length", "m"),
    "nucleation_position": ("from", "m"),
    "force_drop": ("force drop", "N"),
    "spring_force": ("spring force", "N"),
    "stress_ratio_before": ("stress ratio", "1"),
}
FRONT_HEADS = {
    "event": ("event", "1"),
    "start_time": ("start", "s"),
    "kind": ("kind", ""),
    "start_position": ("from", "m"),
    "end_position": ("to", "m"),
    "speed": ("speed", "m/s"),
    "speed_ratio": ("speed/c", "1"),
    "stress_ratio_before": ("stress ratio", "1"),
    "arrest": ("end", ""),
    "front_type": ("type", ""),
}
WORDS = {"kind": KINDS, "arrest": ARRESTS, "front_type": FRONT_TYPES}
DIGITS = 4


@dataclass(frozen=True)
class Fronts:
    """Fronts and events of an output; columns in SI, each of shape (rows,)."""

    fronts: Mapping[str, NDArray[Any]]
    events: Mapping[str, NDArray[Any]]
    sound_velocity: float
    """c [m/s]; NaN for a single block."""
    blocks: int
    notes: tuple[str, ...] = ()

    @property
    def statistics(self) -> dict[str, dict[str, float]]:
        """Of each kind: events, fronts, arrested fronts; median length and speed over c of the
        first passages, and their quartiles."""
        result = {}
        for value, kind in enumerate(KINDS):
            of_kind = self.fronts["kind"] == value
            first = of_kind & (self.fronts["passage"] == 0)
            row = {
                "events": float(np.sum(self.events["kind"] == value)),
                "fronts": float(np.sum(of_kind)),
                "arrested": float(
                    np.sum(self.fronts["arrest"][of_kind] == ARRESTS.index(ARRESTED))
                ),
            }
            for name in ("length", "speed_ratio", "stress_ratio_before"):
                values = self.fronts[name][first]
                values = values[np.isfinite(values)]
                if values.size:
                    low, middle, high = np.quantile(values, [0.25, 0.5, 0.75]).tolist()
                    row |= {f"{name}_25": low, name: middle, f"{name}_75": high}
            result[kind] = row
        return result

    def size_fit(self) -> PowerLawFit | None:
        """The power law of the numbers of blocks in precursors; None with too few of them."""
        sizes = self.events["block_count"][self.events["kind"] == KINDS.index(PRECURSOR)]
        return fit_power_law(sizes, max_size=self.blocks - 1) if sizes.size > 1 else None

    @property
    def tables(self) -> list[PrintedTable]:
        """Statistics by kind, events, and fronts, for print."""
        return [
            self._statistics_table(),
            _table("Events", self.events, EVENT_HEADS),
            _table("Fronts", self.fronts, FRONT_HEADS),
        ]

    def _statistics_table(self) -> PrintedTable:
        lengths = [one.get("length", np.nan) for one in self.statistics.values()]
        shown = column(lengths, "m", DIGITS)
        heads = (
            "",
            "events",
            "fronts",
            "arrested",
            shown.head("length"),
            "speed/c",
            "stress ratio",
        )
        rows = []
        for kind, one in self.statistics.items():
            ranges = [
                f"{number(one[name], 3)} ({number(one[f'{name}_25'], 3)} to "
                f"{number(one[f'{name}_75'], 3)})"
                if name in one
                else "-"
                for name in ("speed_ratio", "stress_ratio_before")
            ]
            length = shown.text(one["length"]) if "length" in one else "-"
            counts = [f"{one[name]:.0f}" for name in ("events", "fronts", "arrested")]
            rows.append((kind, *counts, length, *ranges))
        return PrintedTable("Medians of first passages (quartiles)", tuple(heads), tuple(rows))

    def size_sentence(self) -> str | None:
        """The fitted law of the sizes of precursors; None without one."""
        fit = self.size_fit()
        if fit is None:
            return None
        text = (
            f"blocks in precursors: exponent {with_error(fit.exponent, fit.exponent_error)} from "
            f"{fit.min_size} blocks on, {fit.count} precursors"
        )
        if fit.is_rejected:
            text += f"; they do not follow the law (p = {fit.p_value:.2g})"
        return text

    def rows(self, group: str) -> list[dict[str, Any]]:
        """A dictionary for each front or event; None for unknown values, kinds as words."""
        columns = self.fronts if group == "fronts" else self.events
        words = {
            name: np.array(WORDS[name])[columns[name]] for name in WORDS.keys() & columns.keys()
        }
        return rows_of({**columns, **words})

    def to_json(self) -> dict[str, Any]:
        """Everything as nested lists and numbers."""
        fit = self.size_fit()
        found: dict[str, Any] = {
            "sound_velocity": None if np.isnan(self.sound_velocity) else self.sound_velocity,
            "statistics": self.statistics,
            "fronts": self.rows("fronts"),
            "events": self.rows("events"),
        }
        if fit is not None:
            found["size_fit"] = {
                "exponent": fit.exponent,
                "exponent_error": fit.exponent_error,
                "min_size": fit.min_size,
                "count": fit.count,
                "p_value": fit.p_value,
            }
        return found

    def write_csv(self, path: Path) -> None:
        """Write fronts and events as two tables, with an empty line between them."""
        groups = (("fronts", ALL_FRONTS), ("events", EVENTS))
        write_tables([(self.rows(name), one.units()) for name, one in groups], path)


def _table(
    title: str, columns: Mapping[str, NDArray[Any]], heads: Mapping[str, tuple[str, str]]
) -> PrintedTable:
    cells: list[tuple[str, ...]] = []
    if columns["realization_index"].any():
        cells.append(("realization", *map(str, columns["realization_index"].tolist())))
    for name, (head, unit) in heads.items():
        values = columns[name]
        if name in WORDS:
            words = (WORDS[name][one].replace("_", " ") for one in values.tolist())
            cells.append((head, *words))
        elif values.dtype.kind == "i":
            cells.append((head, *map(str, values.tolist())))
        else:
            shown = column(values.tolist(), unit, 7 if name == "start_time" else DIGITS)
            cells.append((shown.head(head), *map(shown.text, values.tolist())))
    names, *rows = zip(*cells, strict=True)
    return PrintedTable(title, names, tuple(rows))


def fronts_of(tree: Tree, name: str = "the output", realization: int | None = None) -> Fronts:
    """The fronts of all realizations of an output, or of one."""
    if "fronts" not in tree.children:
        raise FileError(f"{name} has {NO_FRONTS}")
    slider = config_of(tree, name).slider
    data = group_of(tree, "fronts")
    columns = {one: np.asarray(data[one].values) for one in FRONTS}
    if realization is not None:
        mine = columns["realization_index"] == realization
        columns = {one: values[mine] for one, values in columns.items()}
    sound = slider.block_spacing / slider.block_time if slider.block_time > 0 else np.nan
    columns["speed_ratio"] = np.abs(columns["speed"]) / sound
    columns["front_type"] = _types(columns["arrest"], columns["speed_ratio"])
    events = _events(tree, columns, slider.block_spacing)
    return Fronts(columns, events, sound, slider.block_count)


def _types(arrest: NDArray[Any], speed_ratio: Array) -> NDArray[Any]:
    """Indices in `FRONT_TYPES`."""
    by_speed = 1 + np.searchsorted([SLOW, 1.0], speed_ratio, "right")
    by_speed[np.isnan(speed_ratio)] = FRONT_TYPES.index("unresolved")
    return np.where(arrest == ARRESTS.index(ARRESTED), 0, by_speed).astype(np.int8)


def first_front(tree: Tree) -> dict[str, float]:
    """Columns of the longest front in the first event of a run; none without events."""
    found = fronts_of(tree).fronts
    first = np.flatnonzero(found["event"] == 0)
    if not first.size:
        return {}
    longest = first[np.argmax(found["length"][first])]
    return {name: float(values[longest]) for name, values in found.items()}


def _events(
    tree: Tree, fronts: Mapping[str, NDArray[Any]], spacing: float
) -> dict[str, NDArray[Any]]:
    owners = np.stack([fronts["realization_index"], fronts["event"]], axis=1)
    ends = np.append(np.flatnonzero(np.any(np.diff(owners, axis=0), axis=1)) + 1, len(owners))
    rows = [
        _event({name: values[start:end] for name, values in fronts.items()}, spacing)
        for start, end in zip(np.append(0, ends[:-1]), ends, strict=True)
        if end > start
    ]
    found = EVENTS.columns(rows)
    found["spring_force"][:] = _spring_forces(tree, found)
    return found


def _event(own: Mapping[str, NDArray[Any]], spacing: float) -> dict[str, float]:
    is_first = own["passage"] == 0
    length = float(own["length"][is_first].sum())
    return {
        **{name: own[name][0] for name in ("realization_index", "event", "kind")},
        "start_time": own["start_time"].min(),
        "end_time": own["end_time"].max(),
        "front_count": is_first.size,
        "block_count": round(length / spacing),
        "length": length,
        "nucleation_position": own["start_position"][np.argmin(own["start_time"])],
        "force_drop": own["force_drop"].sum(),
        "stress_ratio_before": np.average(
            own["stress_ratio_before"][is_first], weights=own["length"][is_first]
        ),
    }


def _spring_forces(tree: Tree, events: Mapping[str, NDArray[Any]]) -> Array:
    """Force of the drive at the last sample before each event [N]."""
    root = tree.to_dataset()
    times = root["time"].values
    forces = np.full(events["start_time"].size, np.nan)
    for realization in np.unique(events["realization_index"]).tolist():
        mine = np.flatnonzero(events["realization_index"] == realization)
        trace = root["spring_force"].isel(realization=realization).values
        place = np.searchsorted(times, events["start_time"][mine], "right") - 1
        forces[mine] = trace[np.maximum(place, 0)]
    return forces


def static_balance(config: Config, residual: float) -> Array | None:
    """Force of the spring at the edge [N] at which a rupture of the first 0, 1, ... blocks goes on.

    The ruptured blocks bear ``residual`` times their static force. The pinned blocks ahead bear the
    rest, the first of them its static force, the others less: the row ahead, with its free end,
    resists as S_j = k'_j + 1/(1/k_b + 1/S_{j+1}). Where all blocks bear the same and Λ ≫ a,
    F(n)/F_s = residual ℓ/L + Λ/L tanh((L - ℓ)/Λ). None with springs from above.
    """
    slider, contacts = config.slider, config.contacts
    blocks = slider.block_count
    if blocks < 2 or slider.springs_from_above:
        return None
    pinned = contacts.stiffness / blocks * config.block_shares
    resistance = pinned.copy()
    for block in range(blocks - 2, -1, -1):
        resistance[block] += 1 / (1 / slider.neighbour_spring + 1 / resistance[block + 1])
    strengths = config.block_strengths
    behind: Array = residual * (np.cumsum(strengths) - strengths)
    return behind + strengths * resistance / pinned


def residual_of(tree: Tree, realization: int | None = None) -> float:
    """Mean force on the contacts after ruptures over the static force; NaN without ruptures."""
    config, data = config_of(tree), group_of(tree, "ruptures")
    after = np.asarray(data["force_after"].values)
    ratios = after / config.block_strengths[np.asarray(data["block_number"].values) - 1]
    if realization is not None:
        ratios = ratios[np.asarray(data["realization_index"].values) == realization]
    return float(ratios.mean()) if ratios.size else float("nan")


def fronts(output: OutputLike) -> DataTree:
    """The fronts of detachment of an interface with a length, and the events that they are in.

    Ruptures of neighbouring blocks whose slips overlap are one event: a precursor, or whole if it
    reaches both ends. A front is an arm of an event, from a nucleation to where it stops.

    Parameters
    ----------
    output
        Output of a run with ``slider.kind = "interface"``.

    Returns
    -------
    xarray.DataTree
        Group ``fronts``, dimension ``front``: the columns of that group of the output, and
        ``speed_ratio``, the size of the speed over that of sound, and the ``front_type`` (0
        arrested, 1 slow, 2 subsonic, 3 supersonic, 4 without a speed). Group ``events``, dimension
        ``event_row``: ``kind`` (0 precursor, 1 whole), ``length`` and ``block_count`` that
        detached, the ``spring_force`` before, ``force_drop``, and the mean stress over strength
        before. SI. Attribute ``sound_velocity`` [m/s].

    Raises
    ------
    FileError
        If the output cannot be read, or is not of such a slider.

    Examples
    --------
    >>> import mesoslip
    >>> path, *_ = mesoslip.example("front-types")  # writes front-types.toml
    >>> found = mesoslip.fronts(mesoslip.run(path))
    >>> round(float(found["fronts"]["speed_ratio"][0]), 2)
    1.12
    """
    import xarray as xr

    with opened_run_arrays(output) as tree:
        found = fronts_of(tree)
    groups = {
        "fronts": ALL_FRONTS.dataset(("front",), found.fronts),
        "events": EVENTS.dataset(("event_row",), found.events),
    }
    result = xr.DataTree.from_dict(groups)
    result.attrs |= {"sound_velocity": found.sound_velocity, "blocks": found.blocks}
    return result


def fronts_from(tree: DataTree) -> Fronts:
    """The fronts that `fronts` returned."""
    columns = [
        {str(name): one.values for name, one in tree[group].data_vars.items()}
        for group in ("fronts", "events")
    ]
    return Fronts(columns[0], columns[1], tree.attrs["sound_velocity"], tree.attrs["blocks"])
