"""The plateaus of an output: friction, load, speed, and the abscissa of Stribeck's curve."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mesoslip.analysis.apparatus import apparatus_of
from mesoslip.analysis.plateaus.levels import Level, levels_of
from mesoslip.analysis.printed_columns import printed_columns
from mesoslip.analysis.steady_force import NORMAL_95, steady_mean
from mesoslip.analysis.strokes.segments import output_pieces
from mesoslip.array_types import Array, Dataset
from mesoslip.configuration import arguments
from mesoslip.configuration.arguments import check_choice
from mesoslip.configuration.units import to_si
from mesoslip.errors import FileError
from mesoslip.output.access import group_of
from mesoslip.output.arrays import Tree
from mesoslip.output.inputs import OutputLike, opened_run_arrays
from mesoslip.output.table_files import PrintedTable, rows_of, write_table
from mesoslip.output.variables import REALIZATION_INDEX, Estimate, Group, Meaning

PLATEAUS = Group(
    realization_index=REALIZATION_INDEX,
    plateau_number=Meaning("1", "number of the plateau, from 1", np.int64),
    start_time=Meaning("s", "start of the plateau"),
    end_time=Meaning("s", "end of the plateau"),
    sliding_speed=Meaning("m s-1", "mean speed of sliding"),
    normal_force=Meaning("N", "mean normal force"),
    mean_friction=Estimate("N", "mean friction force after the transient"),
    mean_friction_coefficient=Estimate("1", "the same over the mean normal force"),
    standard_deviation=Meaning("N", "standard deviation of the force about the mean"),
    hersey_number=Meaning("m-1", "viscosity times speed over normal force"),
    sample_count=Meaning("1", "samples after the transient", np.int64),
    effective_sample_count=Meaning("1", "number of independent samples with the same error"),
    is_steady=Meaning("1", "whether the transient is over, and halves of the rest agree", np.int64),
)
HEADS = {
    "plateau_number": ("plateau", "1"),
    "start_time": ("start", "s"),
    "end_time": ("end", "s"),
    "sliding_speed": ("speed", "m/s"),
    "normal_force": ("normal force", "N"),
    "mean_friction": ("mean friction", "N"),
    "mean_friction_coefficient": ("coefficient", "1"),
    "hersey_number": ("viscosity × speed/load", "1/m"),
}
# Signals of the machine, whose steps make plateaus; their names are those of variables.
SPEEDS = ("sliding_speed", "rotation_speed")
MACHINE = (*SPEEDS, "normal_force")
# Smaller relative changes of them are those of their control.
MIN_CHANGE = 0.03
# Minimum number of samples of a plateau.
MIN_SAMPLES = 5
STAGES, FORCE = "stages of the load point", "force"
# Names of the signals for `signal`, and in messages.
SIGNALS = ("speed", "load", FORCE)


@dataclass(frozen=True)
class Plateaus:
    columns: Mapping[str, NDArray[Any]]
    """Columns in SI, each of shape (rows,)."""
    force_unit: str
    source: str
    """The signals whose steps make the plateaus."""
    viscosity: float | None
    """Viscosity [Pa s]."""

    @property
    def rows(self) -> list[dict[str, Any]]:
        """A dictionary for each plateau; None for unknown values."""
        return rows_of(self.columns)

    @property
    def notes(self) -> list[str]:
        """Sentences on what was found, with guesses."""
        guess = "guess: " if self.source == FORCE else ""
        count = f"{len(self.rows)} plateau{'s' * (len(self.rows) != 1)}"
        found = [f"{guess}{count} between steps of the {self.source}"]
        moving = int(np.sum(self.columns["is_steady"] == 0))
        if moving:
            found.append(f"in {moving} the friction still changes: the mean is not that of a state")
        has_force = self.force_unit == "N"
        if has_force and not np.isfinite(self.columns["mean_friction_coefficient"]).any():
            found.append("no coefficients: the normal force is unknown (trace --normal-force)")
        return found

    @property
    def tables(self) -> list[PrintedTable]:
        """The plateaus for print."""
        return [printed_columns("Plateaus", self.columns, HEADS, self.force_unit)]

    def write_csv(self, path: Path) -> None:
        """Write the plateaus as a table in SI."""
        write_table(self.rows, PLATEAUS.units(self.force_unit), path)

    def to_json(self) -> dict[str, Any]:
        """Everything as nested lists and numbers."""
        return {
            "source": self.source,
            "force_unit": self.force_unit,
            "viscosity": self.viscosity,
            "notes": self.notes,
            "plateaus": self.rows,
        }


def plateaus_of(
    tree: Tree,
    *,
    signal: str | None = None,
    viscosity: float | None = None,
    name: str = "the output",
) -> Plateaus:
    """The plateaus of all realizations of an output; see `plateaus`."""
    apparatus = apparatus_of(tree, name)
    given = viscosity if viscosity is not None else _viscosity(tree)
    rows: list[dict[str, Any]] = []
    source = ""
    for index in range(tree.sizes.get("realization", 1)):
        if output_pieces(tree, index)[0] is not None:
            raise FileError(f"{name}: goes back and forth: mesoslip strokes has its friction")
        levels, source = _levels(tree, index, apparatus.force_name, signal, name)
        signals = _signals(tree, index, apparatus.force_name)
        means = [row for one in levels if (row := _row(signals, one, given)) is not None]
        rows += [
            {"realization_index": index, "plateau_number": number} | one
            for number, one in enumerate(means, 1)
        ]
    if not rows:
        raise FileError(
            f"{name}: has no plateau by the {source}: no {MIN_SAMPLES} samples at one level"
        )
    return Plateaus(PLATEAUS.columns(rows), apparatus.force_unit, source, given)


def _viscosity(tree: Tree) -> float | None:
    """The viscosity of the description of a measured trace [Pa s]."""
    trace = tomllib.loads(tree.attrs.get("trace", "")).get("trace", {})
    given = trace.get("viscosity")
    return None if given is None else to_si(given, "Pa*s", "90 mPa*s")


def _signals(tree: Tree, index: int, force_name: str) -> dict[str, Array]:
    """Time, force, and the signals of the machine that an output has."""
    root = tree.to_dataset()
    force = root[force_name].values[index].astype(float)
    found = {"time": root["time"].values.astype(float), FORCE: force}
    for name in (*MACHINE, "viscosity", "drive_displacement"):
        if name in root and (force_name == "spring_force" or name != "normal_force"):
            found[name] = _of(root[name].values, index)
    return found


def _of(values: NDArray[Any], index: int) -> Array:
    """Values of a realization; one row may be for all."""
    rows = np.atleast_2d(values)
    row: Array = rows[min(index, rows.shape[0] - 1)].astype(float)
    return row


def _levels(
    tree: Tree, index: int, force_name: str, signal: str | None, name: str
) -> tuple[list[Level], str]:
    """Plateaus by the machine or else by the force, and the signals whose steps cut them."""
    signals = _signals(tree, index, force_name)
    known: dict[str, list[Level]] = {}
    for one in MACHINE:
        if one in signals and not (one == "rotation_speed" and "sliding speed" in known):
            known[one.replace("_", " ")] = levels_of(np.abs(signals[one]), MIN_CHANGE)
    if "stages" in tree.children and not any(one in signals for one in SPEEDS):
        known[STAGES] = _steady_stages(tree, signals["time"])
    if signal == "speed":
        known = {key: one for key, one in known.items() if key != "normal force"}
    elif signal == "load":
        known = {key: one for key, one in known.items() if key == "normal force"}
    if signal in {"speed", "load"} and not known:
        raise FileError(f"{name}: has no record of the {signal}; --signal force is always there")
    stepped = {key: one for key, one in known.items() if len(one) > 1}
    if signal == FORCE or (signal is None and not stepped):
        return levels_of(signals[FORCE], are_sharp=True), FORCE
    chosen = list((stepped or known).values())
    levels = chosen[0]
    for other in chosen[1:]:
        levels = list(_common(levels, other))
    return levels, " and ".join(stepped or known)


def _steady_stages(tree: Tree, time: Array) -> list[Level]:
    data = group_of(tree, "stages")
    start, end, first, last = (
        data[one].values
        for one in (
            "stage_start_time",
            "stage_end_time",
            "drive_start_velocity",
            "drive_end_velocity",
        )
    )
    moves = (first == last) & (first != 0)
    ends = np.searchsorted(time, [start[moves], end[moves]])
    return [
        Level(begin, after, speed)
        for (begin, after), speed in zip(ends.T.tolist(), first[moves].tolist(), strict=True)
    ]


def _common(one: Sequence[Level], other: Sequence[Level]) -> Iterator[Level]:
    """Stretches that are plateaus of two signals."""
    for mine in one:
        for yours in other:
            first, after = max(mine.first, yours.first), min(mine.after, yours.after)
            if after > first:
                yield Level(first, after, mine.mean)


def _row(
    signals: Mapping[str, Array], level: Level, viscosity: float | None
) -> dict[str, Any] | None:
    """Means of a plateau; None if it is too short or has no friction."""
    inside = slice(level.first, level.after)
    force = signals[FORCE][inside]
    force = force[np.isfinite(force)]
    if force.size < MIN_SAMPLES:
        return None
    sign = -1.0 if force.mean() < 0 else 1.0
    found = steady_mean(sign * force[np.newaxis])
    start = 0 if found is None else found.start
    time = signals["time"][inside]
    mean, error = _mean_of(sign * force[start:])
    row: dict[str, Any] = {
        "start_time": float(time[0]),
        "end_time": float(time[-1]),
        "mean_friction": mean,
        "mean_friction_error": error,
        "standard_deviation": float(force[start:].std(ddof=1)),
        "sample_count": force.size - start,
        "effective_sample_count": math.nan if found is None else found.effective_count,
        "is_steady": int(found is None or found.is_steady),
    }
    if "sliding_speed" in signals:
        row["sliding_speed"] = float(np.nanmean(np.abs(signals["sliding_speed"][inside])))
    elif "drive_displacement" in signals:
        drive = signals["drive_displacement"][inside]
        row["sliding_speed"] = abs(float(np.polyfit(time - time[0], drive, 1)[0]))
    if "normal_force" in signals:
        load = np.abs(signals["normal_force"][inside][start:])
        known = np.isfinite(load)
        row["normal_force"] = size = float(load[known].mean()) if known.any() else math.nan
        if size > 0 and known.all() and load.size == force.size - start:
            # Of the ratio of two means, force and load may be correlated.
            ratio = mean / size
            error = _mean_of(sign * force[start:] - ratio * load)[1] / size
            row |= {"mean_friction_coefficient": ratio, "mean_friction_coefficient_error": error}
    if viscosity is None and "viscosity" in signals:
        viscosity = float(np.nanmean(signals["viscosity"][inside]))
    if viscosity is not None and {"sliding_speed", "normal_force"} <= row.keys():
        row["hersey_number"] = viscosity * row["sliding_speed"] / row["normal_force"]
    return row


def _mean_of(values: Array) -> tuple[float, float]:
    """Mean of a steady series, and its standard error, which includes correlation."""
    from scipy.special import stdtrit

    found = steady_mean(values[np.newaxis])
    if found is not None and math.isfinite(found.error):
        return float(values.mean()), found.half_width / NORMAL_95
    width = float(stdtrit(values.size - 1, 0.975)) / NORMAL_95
    return float(values.mean()), width * float(values.std(ddof=1)) / math.sqrt(values.size)


def plateaus_from(data: Dataset) -> Plateaus:
    """The plateaus that `plateaus` returned."""
    columns = {str(name): one.values for name, one in data.data_vars.items()}
    viscosity = data.attrs.get("viscosity")
    return Plateaus(columns, data["mean_friction"].attrs["units"], data.attrs["source"], viscosity)


@arguments.checked(viscosity=arguments.number(0, is_open=True))
def plateaus(
    output: OutputLike, *, signal: str | None = None, viscosity: float | None = None
) -> Dataset:
    """Mean friction of each plateau of a record, between steps of speed, load or force.

    Parameters
    ----------
    output
        Output of a run, or a measured trace.
    signal
        "speed", "load" or "force": the signal whose steps cut the record. By default speed and load
        together, where they are recorded and have steps, and else the force, which is a guess.
    viscosity
        Viscosity of a lubricant [Pa s], for Stribeck's curve; by default that of the description of
        the trace.

    Returns
    -------
    xarray.Dataset
        Dimension ``plateau``: times, mean friction after the transient with its standard error,
        which includes their correlation, the coefficient where the normal force is known,
        mean speed and load, and ``hersey_number``, viscosity times speed over load [1/m].
        Attribute ``source``: the signals.

    Raises
    ------
    FileError
        If the output cannot be read, goes back and forth, or has no plateau.
    ConfigError
        If the signal is another one, or the viscosity not above 0.

    Examples
    --------
    >>> import mesoslip
    >>> path, *_ = mesoslip.example("measured/stribeck")  # writes the file and a description
    >>> mesoslip.plateaus(mesoslip.read_trace(path))["mean_friction_coefficient"].shape
    (14,)
    """
    check_choice("signal", signal, SIGNALS)
    with opened_run_arrays(output) as tree:
        found = plateaus_of(tree, signal=signal, viscosity=viscosity)
    known = {} if found.viscosity is None else {"viscosity": found.viscosity}
    attributes = {"source": found.source} | known
    return PLATEAUS.dataset(("plateau",), found.columns, found.force_unit, attributes)
