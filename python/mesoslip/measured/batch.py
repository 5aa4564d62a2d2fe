"""Many files of measurements with one description: an output and a row of a table for each."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mesoslip.analysis import slips
from mesoslip.analysis.regime.outputs import regimes
from mesoslip.analysis.regime.result import NAMES
from mesoslip.errors import ConfigError, FileError, MesoslipError, shown
from mesoslip.execution.executors import ExecutorLike, ThreadsThenProcesses, as_executor, completed
from mesoslip.execution.stop import Stop, StopRequest
from mesoslip.measured.trace import trace_of
from mesoslip.measured.understanding import understand
from mesoslip.output import targets, writing
from mesoslip.output.variables import force_among

PACKED = (".gz", ".bz2", ".xz", ".zip")
# Columns of the table and their units; of forces see the column of their unit.
FORCE = "N or 1"
COLUMNS = {
    "file": "-",
    "output": "-",
    "force_unit": "-",
    "samples": "1",
    "duration": "s",
    "mean_force": FORCE,
    "force_deviation": FORCE,
    "mean_normal_force": "N",
    "noise": FORCE,
    "regime": "-",
    "slips": "1",
    "mean_force_drop": FORCE,
    "mean_waiting_time": "s",
    "message": "-",
}
# Start of a table.
HEADER = b"file [-],output [-],"
Row = dict[str, Any]


@dataclass(frozen=True)
class Piece:
    """A file, its output, and how it is read."""

    file: Path
    output: Path
    description: Path | None
    options: Mapping[str, Any]


def pieces_of(
    files: Sequence[Path], folder: Path, description: Path | None, options: Mapping[str, Any]
) -> list[Piece]:
    """Files and their outputs in a folder; two files of one name are refused."""
    outputs = [folder / output_name(one) for one in files]
    twice = [one for one, count in Counter(outputs).items() if count > 1]
    if twice:
        both = " and ".join(
            str(one) for one, output in zip(files, outputs, strict=True) if output == twice[0]
        )
        raise FileError(f"{both} have the same output, {twice[0]}; read them one after the other")
    return [
        Piece(file, output, description, options)
        for file, output in zip(files, outputs, strict=True)
    ]


def output_name(file: Path) -> str:
    return f"{Path(file.stem).stem if file.suffix in PACKED else file.stem}.nc"


def may_be_replaced(table: Path) -> bool:
    """Whether a table may take a name: no measurement has it, such as the first of all files."""
    if not table.exists() or table.suffix.lower() in {".md", ".tex"}:
        return True
    with table.open("rb") as file:
        return file.readline(len(HEADER)) in {b"", HEADER}


def read_pieces(
    pieces: Sequence[Piece],
    stop: StopRequest,
    *,
    executor: ExecutorLike = None,
    progress: Callable[[float], None] = lambda _: None,
) -> list[Row]:
    """Read files and write their outputs; returns the rows of those read before a stop, with a
    message for a file that cannot be read."""
    pool = as_executor(executor, ThreadsThenProcesses)
    rows = []
    with closing(completed(pool, read_piece, pieces, stop, in_order=True)) as done:
        for _, future in done:
            rows.append(future.result())
            progress(len(rows) / len(pieces))
    return rows


def read_piece(piece: Piece, stop: Stop) -> Row:  # noqa: ARG001
    """Read one file and write its output."""
    row: Row = {"file": str(piece.file)}
    try:
        targets.check_output(piece.output, [piece.file])
        options = dict(piece.options)
        if piece.description is not None:
            options["file"] = str(piece.file.absolute())
        understood = understand(piece.description or piece.file, **options)
        tree = trace_of(understood)
        writing.write(tree, piece.output)
        normal = understood.record.mean_normal_force
        row |= {"output": str(piece.output), "mean_normal_force": "" if normal is None else normal}
        return row | dict(_statistics(tree))
    except ConfigError as error:
        # The message is on one line.
        return row | {"message": "; ".join(str(one) for one in error.problems)}
    except MesoslipError as error:
        return row | {"message": str(error)}


def _statistics(tree: Any) -> Iterator[tuple[str, Any]]:
    """Values of an output by column."""
    root = tree.to_dataset()
    name = force_among(root)
    force, time = root[name].values[0], root["time"].values
    yield "force_unit", root[name].attrs["units"]
    yield "samples", time.size
    yield "duration", float(time[-1] - time[0])
    yield "mean_force", float(np.mean(force))
    yield "force_deviation", float(np.std(force))
    yield "noise", float(tree.attrs["noise"])
    yield "regime", NAMES[int(regimes(tree)["regime"].values[0])]
    catalogue = slips.catalogue_of(tree).columns
    drops, waits = (catalogue[one].values for one in ("force_drop", "waiting_time"))
    yield "slips", drops.size
    if drops.size:
        yield "mean_force_drop", float(np.mean(np.abs(drops)))
    if np.isfinite(waits).any():
        yield "mean_waiting_time", float(np.nanmean(waits))


def described(files: Sequence[Path]) -> tuple[Path | None, list[Path]]:
    """The description among files, if the first one is one, and the files of measurements."""
    first, *others = files
    if first.suffix.lower() != ".toml":
        return None, list(files)
    if not others:
        message = "needs the files of the measurements after their description"
        raise ConfigError.of("--batch", f"{message}, {shown(first.name)}")
    return first, others
