"""Tables of measurements: columns of numbers, with units in their headers."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mesoslip.configuration.columns import IGNORED, Quantity, cells_of, find_columns, values_of
from mesoslip.configuration.reading import text_of
from mesoslip.errors import FileError, shown

Array = NDArray[np.float64]

# Columns by the names allowed in headers.
COLUMNS = {
    "time": Quantity("time", "s", "time [s]"),
    "force": Quantity("force", "N", "force [uN]"),
    "spring_force": Quantity("force", "N", "force [uN]"),
    "displacement": Quantity("displacement", "m", "displacement [nm]"),
    "drive": Quantity("drive", "m", "drive [nm]"),
    "drive_displacement": Quantity("drive", "m", "drive [nm]"),
}
# Minimum interval of a gap, over the median interval.
MIN_GAP = 1.5
# Maximum size of a file [bytes].
MAX_BYTES = 2**31


@dataclass(frozen=True)
class Measurements:
    """Measured samples.

    Attributes
    ----------
    time
        Times of the samples [s], shape (samples,), increasing.
    force
        Force of the spring [N].
    displacement, drive
        Displacements of the slider and of the drive [m]; None if not measured.
    """

    time: Array
    force: Array
    displacement: Array | None
    drive: Array | None


def read_table(
    path: Path,
    *,
    columns: str | None = None,
    rate: float | None = None,
    max_gap: float | None = None,
) -> Measurements:
    """Read a table of measurements, see `mesoslip.configuration.columns`.

    Decimal commas are allowed between semicolons, tabs or blanks, unless they could group digits.

    Parameters
    ----------
    path
        The file.
    columns
        Headers instead of those of the file, such as "time [s], force [uN], -".
    rate
        Sampling rate [1/s], for a file without times.
    max_gap
        Maximum length [s] of gaps, which are interpolated linearly; by default gaps are errors.

    Raises
    ------
    FileError
        If the file cannot be read or is invalid; the message names the line.
    """
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
    if "force" not in places:
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
        for name, column in values_of(
            cells, headers, places, keep_missing=max_gap is not None
        ).items()
    }
    numbers = np.array([number for number, _ in cells.lines])
    if rate is not None:
        values["time"] = np.arange(len(numbers)) / rate
    return _checked(path, values, numbers, max_gap)


def _text(path: Path) -> str:
    """The text of a table of measurements."""
    try:
        return text_of(path, "a table of measurements", MAX_BYTES)
    except FileError as error:
        if path.suffix == ".nc":
            raise FileError(f"{path}: is an output, not a table of measurements") from error
        raise


def _checked(
    path: Path, values: dict[str, Array], numbers: NDArray[np.int_], max_gap: float | None
) -> Measurements:
    """Measurements, checked for increasing times without gaps; allowed gaps are filled."""
    whole = np.isfinite(list(values.values())).all(axis=0)
    values = {name: column[whole] for name, column in values.items()}
    numbers = numbers[whole]
    time = values["time"]
    if len(time) < 4:
        raise FileError(f"{path}: has {len(time)} samples; a trace needs at least 4")
    steps = np.diff(time)
    back = np.flatnonzero(steps <= 0)
    if back.size:
        at = back[0]
        raise FileError(
            f"{path}: line {numbers[at + 1]}: the time {time[at + 1]:g} s does not come after "
            f"{time[at]:g} s on line {numbers[at]}; times must increase"
        )
    usual = float(np.median(steps))
    gaps = np.flatnonzero(steps > MIN_GAP * usual)
    for at in gaps:
        if max_gap is None or steps[at] > max_gap:
            raise FileError(
                f"{path}: line {numbers[at + 1]}: a gap of {steps[at]:g} s after {time[at]:g} s, "
                f"where the sampling interval is {usual:g} s; cut the file there, or fill it "
                "with --max-gap"
            )
    if gaps.size:
        counts = [round(steps[at] / usual) for at in gaps]
        filled = [
            time[at] + np.arange(1, count) * steps[at] / count
            for at, count in zip(gaps, counts, strict=True)
        ]
        whole_time = np.sort(np.concatenate([time, *filled]))
        values = {
            name: np.interp(whole_time, time, column)
            for name, column in values.items()
            if name != "time"
        } | {"time": whole_time}
    return Measurements(
        values["time"], values["force"], values.get("displacement"), values.get("drive")
    )
