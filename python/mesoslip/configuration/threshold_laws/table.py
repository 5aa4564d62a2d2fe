"""The law of a table of thresholds, such as those of the measured areas of contacts."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mesoslip.configuration.columns import HEADER, Cells, FoundColumn, cells_of, values_of
from mesoslip.configuration.kernel_parameters import Parameters
from mesoslip.configuration.reading import text_of
from mesoslip.configuration.threshold_laws.base import Keys, ThresholdLawKind
from mesoslip.configuration.units import to_si
from mesoslip.errors import FileError

# Names of columns. Areas can stand for thresholds, which are proportional to them.
SAMPLE_COLUMNS = ("threshold", "area")
WEIGHT_COLUMN = "weight"
STIFFNESS_COLUMN = "stiffness"
# Maximum number of samples, and of cells of a law in the kernels.
MAX_SAMPLES, MAX_CELLS = 100_000, 4000
# Relative difference up to which break stretches are equal.
SAME_STRETCH = 1e-9
WANTED = (
    "the header must name a column threshold or area, and may name the columns weight and stiffness"
)


class LawCells(NamedTuple):
    """Cells of thresholds in each of which the density is constant; the mean is 1."""

    edges: NDArray[np.float64]
    """Edges, ascending, shape (cells + 1)."""
    weights: NDArray[np.float64]
    """Probability of each cell, shape (cells)."""

    @property
    def relative_width(self) -> float:
        """Standard deviation of the thresholds."""
        low, high = self.edges[:-1], self.edges[1:]
        square = float(np.sum(self.weights * (low**2 + low * high + high**2)) / 3)
        return math.sqrt(max(0.0, square - 1))

    @property
    def kernel_parameters(self) -> Parameters:
        return {
            "threshold_edges": tuple(self.edges.tolist()),
            "threshold_weights": tuple(self.weights.tolist()),
        }


class StretchCells(NamedTuple):
    """Cells of break stretches f_s/k, in each of which density and stiffness are constant.

    The mean stiffness is 1, and so is the mean threshold, the product of stretch and stiffness.
    """

    edges: NDArray[np.float64]
    """Edges, ascending, shape (cells + 1)."""
    weights: NDArray[np.float64]
    """Probability of each cell, shape (cells)."""
    stiffnesses: NDArray[np.float64]
    """Stiffness in each cell, shape (cells)."""

    @property
    def width(self) -> float:
        """Standard deviation of the break stretches, in units of mean threshold over mean k."""
        low, high = self.edges[:-1], self.edges[1:]
        mean = float(np.sum(self.weights * (low + high)) / 2)
        square = float(np.sum(self.weights * (low**2 + low * high + high**2)) / 3)
        return math.sqrt(max(0.0, square - mean**2))

    @property
    def kernel_parameters(self) -> Parameters:
        return {
            "threshold_edges": tuple(self.edges.tolist()),
            "threshold_weights": tuple(self.weights.tolist()),
            "threshold_stiffnesses": tuple(self.stiffnesses.tolist()),
        }


def sample_problem(
    samples: Sequence[float],
    weights: Sequence[float] | None,
    stiffnesses: Sequence[float] | None = None,
) -> tuple[str, str]:
    """The key and the error of samples, in any unit; empty strings if they make a law."""
    if len(samples) > MAX_SAMPLES:
        return "samples", f"must have at most {MAX_SAMPLES} values (has {len(samples)})"
    wrong = [one for one in samples if not one > 0]
    if wrong:
        return "samples", f"must be positive: a threshold is {wrong[0]:g}"
    if not math.isfinite(sum(samples)):
        return "samples", "must have a finite sum"
    if weights is not None:
        if len(weights) != len(samples):
            return "weights", f"must have as many values as samples, {len(samples)}"
        wrong = [one for one in weights if one < 0]
        if wrong:
            return "weights", f"must not be negative: one is {wrong[0]:g}"
        if not math.isfinite(sum(weights)):
            return "weights", "must have a finite sum"
        if samples and not any(weights):
            return "weights", "must not all be 0"
    used = {
        one for one, weight in zip(samples, weights or [1] * len(samples), strict=True) if weight
    }
    if len(used) < 2:
        return "samples", (
            f"must have at least two different values with a weight (has {len(used)}); contacts of "
            "one threshold have a narrow law of another kind"
        )
    if stiffnesses is not None:
        return _stiffness_problem(samples, weights, stiffnesses)
    return "", ""


def _stiffness_problem(
    samples: Sequence[float], weights: Sequence[float] | None, stiffnesses: Sequence[float]
) -> tuple[str, str]:
    """The same for stiffnesses, after samples and weights without error."""
    if len(stiffnesses) != len(samples):
        return "stiffnesses", f"must have as many values as samples, {len(samples)}"
    wrong = [one for one in stiffnesses if not one > 0]
    if wrong:
        return "stiffnesses", f"must be positive: one is {wrong[0]:g}"
    used = np.ones(len(samples), bool) if weights is None else np.array(weights) > 0
    stretch = np.array(samples)[used] / np.array(stiffnesses)[used]
    if not np.max(stretch) > np.min(stretch) * (1 + len(stretch) * SAME_STRETCH):
        return "stiffnesses", (
            "must not all be proportional to the thresholds: all contacts would break at one "
            "stretch, threshold over stiffness"
        )
    return "", ""


@lru_cache(maxsize=8)
def law_cells(samples: tuple[float, ...], weights: tuple[float, ...] | None) -> LawCells:
    """The law of samples: each has a cell around it, with its weight; the mean of the law is 1.

    A cell extends half-way to the adjacent samples, at the ends equally far to both sides, but not
    below 0. Equal samples share a cell, and so do adjacent ones if there are more than `MAX_CELLS`
    different ones.
    """
    value, place = np.unique(np.array(samples), return_inverse=True)
    shares = np.ones(len(samples)) if weights is None else np.array(weights)
    weight = np.bincount(place, shares).astype(np.float64)
    value, weight = value[weight > 0], weight[weight > 0]
    if len(value) > MAX_CELLS:
        group = _groups(weight)
        total = np.bincount(group, weight)
        value = (np.bincount(group, weight * value) / total).astype(np.float64)
        weight = total.astype(np.float64)
    edges = _edges(value)
    weight = weight / np.sum(weight)
    mean = np.sum(weight * (edges[1:] + edges[:-1]) / 2)
    return LawCells(edges / mean, weight)


def _edges(value: NDArray[np.float64]) -> NDArray[np.float64]:
    """Edges of cells around ascending values."""
    middle = value[:-1] + np.diff(value) / 2
    first = max(0.0, 2 * value[0] - middle[0])
    return np.concatenate([[first], middle, [2 * value[-1] - middle[-1]]])


def _groups(weight: NDArray[np.float64]) -> NDArray[np.intp]:
    """The group of each sample, of at most `MAX_CELLS` groups of about equal weight."""
    middle_share = (np.cumsum(weight) - weight / 2) / np.sum(weight)
    return np.unique((MAX_CELLS * middle_share).astype(int), return_inverse=True)[1]


@lru_cache(maxsize=8)
def stretch_cells(
    samples: tuple[float, ...], weights: tuple[float, ...] | None, stiffnesses: tuple[float, ...]
) -> StretchCells:
    """The law of samples with stiffnesses: each has a cell of break stretches around it.

    The cells are those of `law_cells`, but of thresholds over stiffnesses, in whose order contacts
    break. Samples of one break stretch and different stiffnesses have a part each of its cell.
    Adjacent samples that are combined have their mean stretch and stiffness.
    """
    threshold, stiffness = np.array(samples), np.array(stiffnesses)
    weight = np.ones(len(samples)) if weights is None else np.array(weights)
    used = weight > 0
    threshold, stiffness, weight = threshold[used], stiffness[used], weight[used]
    stretch = threshold / stiffness
    order = np.lexsort((stiffness, stretch))
    stretch, stiffness, weight = stretch[order], stiffness[order], weight[order]
    if len(stretch) > MAX_CELLS:
        is_new = (np.diff(stretch) > SAME_STRETCH * stretch[1:]) | (np.diff(stiffness) != 0)
        place = np.concatenate([[0], np.cumsum(is_new)])
        group = _groups(np.bincount(place, weight).astype(np.float64))[place]
        total = np.bincount(group, weight)
        stretch = np.bincount(group, weight * stretch) / total
        stiffness = np.bincount(group, weight * stiffness) / total
        weight = total
    is_new = np.diff(stretch) > SAME_STRETCH * stretch[1:]
    place = np.concatenate([[0], np.cumsum(is_new)])
    first = np.concatenate([[0], np.flatnonzero(is_new) + 1])
    edges = _edges(stretch[first])
    before = np.cumsum(weight) - weight
    part = (before - before[first][place]) / np.bincount(place, weight)[place]
    low = edges[place] + part * np.diff(edges)[place]
    edges = np.concatenate([low, edges[-1:]])
    weight = weight / np.sum(weight)
    stiffness = stiffness / np.sum(weight * stiffness)
    mean = np.sum(weight * stiffness * (edges[1:] + edges[:-1]) / 2)
    return StretchCells(edges / mean, weight, stiffness)


class TableLaw(ThresholdLawKind):
    """The law of samples; its width is theirs."""

    def kernel_parameters(self, keys: Keys) -> Parameters:
        return law_cells(keys.samples or (), keys.weights).kernel_parameters


LAW = TableLaw("table", jumps="lower", is_sampled=True)


def read_samples(path: Path) -> dict[str, list[float]]:
    """Samples of a file, with weights and stiffnesses if it has them.

    The file is a table (`mesoslip.configuration.columns`) with a column ``threshold`` or ``area``,
    in any unit, and maybe the columns ``weight`` and ``stiffness``; others are ignored. The
    FileError of a file that is not such a table names the line and the fix.
    """
    cells = cells_of(text_of(path, "a table of thresholds"), str(path))
    columns = _columns(cells)
    found = [name for name in SAMPLE_COLUMNS if name in columns]
    if not found:
        raise FileError(f"{path}: there is no column threshold or area; {WANTED}")
    if len(found) > 1:
        raise FileError(f"{path}: has a column threshold and a column area; remove one of them")
    if len(cells.lines) < 2:
        raise FileError(f"{path}: must have at least two rows of numbers (has {len(cells.lines)})")
    wanted = {
        name: FoundColumn(columns[name], 1.0)
        for name in (*found, WEIGHT_COLUMN, STIFFNESS_COLUMN)
        if name in columns
    }
    values = values_of(cells, cells.first, wanted)
    for name in (found[0], STIFFNESS_COLUMN):
        for (line, _), one in zip(cells.lines, values.get(name, []), strict=False):
            if not one > 0:
                raise FileError(f"{path}: line {line}: the {name} must be positive (is {one:g})")
    for (line, _), one in zip(cells.lines, values.get(WEIGHT_COLUMN, []), strict=False):
        if one < 0:
            raise FileError(f"{path}: line {line}: the weight must not be negative (is {one:g})")
    keys = {"samples": found[0], "weights": WEIGHT_COLUMN, "stiffnesses": STIFFNESS_COLUMN}
    read = {key: values[column] for key, column in keys.items() if column in values}
    key, message = sample_problem(read["samples"], read.get("weights"), read.get("stiffnesses"))
    if key:
        raise FileError(f"{path}: the column {keys[key]} {message}")
    return read


def _columns(cells: Cells) -> dict[str, int]:
    """Positions of the columns by name. The size of a unit does not matter, only ratios do."""
    if not cells.has_header:
        raise FileError(f"{cells.source}: there is no header; {WANTED}")
    columns: dict[str, int] = {}
    for place, header in enumerate(cells.first):
        match = HEADER.fullmatch(header)
        name = "" if match is None else match["name"].strip().lower()
        if name in columns:
            raise FileError(f"{cells.source}: has two columns {name}")
        if name in {*SAMPLE_COLUMNS, WEIGHT_COLUMN, STIFFNESS_COLUMN}:
            columns[name] = place
        unit = "" if match is None else (match["unit"] or "").strip()
        if name == STIFFNESS_COLUMN and unit not in {"", "1", "-"}:
            try:
                to_si(f"1 {unit}", "N/m", "5 N/m")
            except ValueError as error:
                raise FileError(f"{cells.source}: the column stiffness: {error}") from None
    return columns
