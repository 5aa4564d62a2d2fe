"""Tables of measurements: columns of numbers, with units in their headers."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mesoslip.configuration.columns import IGNORED, Quantity, cells_of, find_columns, values_of
from mesoslip.configuration.reading import text_of
from mesoslip.errors import FileError, shown
from mesoslip.measured.description import TraceDescription
from mesoslip.measured.record import Record, RecordedColumn

Array = NDArray[np.float64]

# Columns by the names allowed in headers.
COLUMNS = {
    "time": Quantity("time", "s", "time [s]"),
    "force": Quantity("force", "N", "force [uN]"),
    "spring_force": Quantity("force", "N", "force [uN]"),
    "friction": Quantity("friction", "1", "friction [1]"),
    "displacement": Quantity("displacement", "m", "displacement [nm]"),
    "load_point": Quantity("drive", "m", "load_point [um]"),
    "drive": Quantity("drive", "m", "drive [nm]"),
    "drive_displacement": Quantity("drive", "m", "drive [nm]"),
}
# Maximum size of a file [bytes].
MAX_BYTES = 2**31


def read_record(path: Path, trace: TraceDescription) -> Record:
    """Read a table of measurements, see `mesoslip.configuration.columns`."""
    columns, rate = trace.headers, trace.si("rate")
    cells = cells_of(_text(path), str(path))
    if not cells.has_header and columns is None:
        raise FileError(
            f"{path}: line {cells.lines[0][0]}: has no header such as 'time [s], force [uN]'; "
            "add one, or give headers with --columns"
        )
    headers = cells.first if columns is None else [one.strip() for one in columns.split(",")]
    if len(headers) != len(cells.first):
        raise FileError(
            f"{path}: --columns names {len(headers)} columns, the file has {len(cells.first)}; "
            f"'{IGNORED}' stands for a column to ignore"
        )
    places = find_columns(headers, COLUMNS, str(path))
    found = ", ".join(shown(header) for header in headers)
    if not {"force", "friction"} & places.keys():
        raise FileError(
            f"{path}: has no column of the force, such as 'force [uN]'; its columns are {found}; "
            "give other headers with --columns"
        )
    if "time" not in places and rate is None:
        raise FileError(
            f"{path}: has no column of the time, such as 'time [s]'; its columns are {found}; give "
            "other headers with --columns, or a sampling rate with --rate"
        )
    if "time" in places and rate is not None:
        raise FileError(
            f"{path}: has a column of the time, and a sampling rate is given; give no rate, or "
            f"'{IGNORED}' instead of the time in --columns"
        )
    values = {
        name: np.array(column)
        for name, column in values_of(cells, headers, places, keep_missing=True).items()
    }
    numbers = np.array([number for number, _ in cells.lines])
    if rate is not None:
        values["time"] = np.arange(len(numbers)) / rate
    whole = np.isfinite(list(values.values())).all(axis=0)
    used = {name: column[whole] for name, column in values.items()}
    _check(path, used["time"], numbers[whole])
    is_friction = "force" not in used
    return Record(
        used["time"],
        used["friction" if is_friction else "force"],
        is_friction,
        used.get("drive"),
        used.get("displacement"),
        columns=[
            RecordedColumn(headers[places[name].column], "", column / places[name].size)
            for name, column in values.items()
            if name in places
        ],
        report=[f"{len(used['time'])} samples"],
    )


def _text(path: Path) -> str:
    """The text of a table of measurements."""
    try:
        return text_of(path, "a table of measurements", MAX_BYTES)
    except FileError as error:
        if path.suffix == ".nc":
            raise FileError(f"{path}: is an output, not a table of measurements") from error
        raise


def _check(path: Path, time: Array, numbers: NDArray[np.int_]) -> None:
    """Check that times increase."""
    if len(time) < 4:
        raise FileError(f"{path}: has {len(time)} samples; a trace needs at least 4")
    back = np.flatnonzero(np.diff(time) <= 0)
    if back.size:
        at = back[0]
        raise FileError(
            f"{path}: line {numbers[at + 1]}: the time {time[at + 1]:g} s does not come after "
            f"{time[at]:g} s on line {numbers[at]}; times must increase"
        )
