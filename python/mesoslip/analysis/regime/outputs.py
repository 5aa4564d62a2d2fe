"""Regimes of the realizations of an output, from the evaluated window of each."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from mesoslip.analysis.apparatus import Apparatus, apparatus_of
from mesoslip.analysis.even_traces import INTERVAL_TOLERANCE
from mesoslip.analysis.noise import noise_level, without_impulses
from mesoslip.analysis.regime.events import MIN_CYCLES, NO_SLIPS, Slips
from mesoslip.analysis.regime.result import NAMES, REGIME, SMOOTH, TRANSIENT, RegimeResult
from mesoslip.analysis.regime.rules import classify
from mesoslip.analysis.regime.scales import Scales, Stage, measured_stage, stage_of
from mesoslip.analysis.strokes.segments import Piece, output_pieces
from mesoslip.analysis.strokes.sliding import sliding_of
from mesoslip.array_types import Array, Dataset, DataTree
from mesoslip.output.access import group_of, is_measured
from mesoslip.output.arrays import Tree
from mesoslip.output.inputs import OutputLike, opened_run
from mesoslip.simulation.recorded_tables import SLIP_COLUMNS, TRACE_COLUMNS

if TYPE_CHECKING:
    from mesoslip.simulation.run_realizations import Results


# Maximum number of evaluated samples; longer traces are thinned out.
MAX_SAMPLES = 400_000
# Columns of the slips of an output.
SLIP_NAMES = ("start_time", "end_time", "force_before", "force_drop")


def regimes(tree: DataTree, name: str = "the output") -> Dataset:
    """The variables `REGIME` of each realization of an output; ``name`` is that in messages.

    A slider under a force is smooth if it creeps steadily in the last stage, otherwise transient,
    and the attribute ``motion`` describes its motion.
    """
    import xarray as xr

    results, motion = judge(tree, name)
    variables = {
        name: REGIME.variable(
            name,
            ("realization",),
            np.array([getattr(one, name) for one in results], dtype=meaning.dtype),
        )
        for name, meaning in REGIME.items()
    }
    for name, variable in variables.items():
        variable.attrs["long_name"] = results[0].long_name(name)
    variables["regime"].attrs["flag_values"] = np.arange(len(NAMES), dtype=np.int8)
    attributes = {"force_scale": results[0].force_scale}
    if motion is not None:
        attributes["motion"] = motion
    return xr.Dataset(variables, {"realization": tree["realization"]}, attributes)


def judge(tree: Tree, name: str = "the output") -> tuple[list[RegimeResult], str | None]:
    """The regime of each realization of an output, and the motion of a slider under a force."""
    root = tree.to_dataset()
    apparatus = apparatus_of(tree, name)
    owner, slips = _slips(tree)
    results = []
    for number in range(root.sizes["realization"]):
        mine = owner == number
        own = slips.of(mine)
        pieces = output_pieces(tree, number)[0] if is_measured(tree) else None
        if pieces is None:
            results.append(classify(*_window(tree, number, apparatus), own))
        else:
            results.append(_in_strokes(tree, number, apparatus, own, pieces))
    config = apparatus.config
    if config is None or not config.drive.is_force or config.slider.jumps:
        return results, None
    # With xarray.
    from mesoslip.analysis.experiment_stages import Experiment
    from mesoslip.analysis.response.forces import motion_under_force

    motion, is_creep = motion_under_force(Experiment(tree, name))
    return [RegimeResult(SMOOTH if is_creep else TRANSIENT)] * len(results), motion


def _slips(tree: Tree) -> tuple[Array, Slips]:
    """Realization of each slip, and all slips."""
    if "slips" not in tree.children:
        return np.empty(0), NO_SLIPS
    data = group_of(tree, "slips")
    columns = (data[name].values for name in SLIP_NAMES)
    return data["realization_index"].values, Slips(*columns)


def _window(tree: Tree, number: int, apparatus: Apparatus) -> tuple[Scales, Array, Array, Array]:
    """Scales of a realization; time, force and velocity in its evaluated window."""
    root = tree.to_dataset()
    # The catalogue of an elastic slider is that of its mean force.
    name = "elastic_force" if "elastic_force" in root else apparatus.force_name
    time, force = root["time"].values, root[name][number].values
    # Samples after the end of an interrupted run are missing.
    reached = int(np.sum(np.isfinite(force)))
    last_time = float(time[reached - 1]) if reached else 0.0
    config = apparatus.config
    stage = stage_of(config, last_time) if config else measured_stage(tree, apparatus, last_time)
    first = int(np.searchsorted(time[:reached], stage.middle))
    last = int(np.searchsorted(time[:reached], stage.end, side="right"))
    inside = slice(first, last, _step(last - first))
    velocity = np.full(len(time[inside]), np.nan)
    if "velocity" in root:
        velocity = root["velocity"][number, inside].values
    time, force = time[inside], force[inside]
    if config is not None:
        return Scales.of_config(config, last_time), time, force, velocity
    if "noise" in tree.children:
        impulses = group_of(tree, "noise")["impulse_time"].values
        force = without_impulses(time, force, impulses)
    time, force, velocity = _even(time, force, velocity)
    scales = Scales.of_measurement(apparatus, stage, force, noise_level(force))
    return scales, time, force, velocity


def _in_strokes(
    tree: Tree, number: int, apparatus: Apparatus, slips: Slips, pieces: Sequence[Piece]
) -> RegimeResult:
    """The regime of a measured trace in strokes, from the sliding in its second half.

    The parts between reversals are put one after the other, in time too, with forces along the
    motion. Without slips they are smooth, however the friction depends on the position.
    """
    root = tree.to_dataset()
    time, force = root["time"].values, root[apparatus.force_name][number].values
    sliding = sliding_of(force, pieces)
    inside = time[sliding.samples] >= (time[0] + time[-1]) / 2
    samples, along = sliding.samples[inside], sliding.aligned()[inside]
    if samples.size < 2 * MIN_CYCLES:
        return RegimeResult()
    # Joints are as long as an interval.
    steps = np.diff(time[samples], prepend=time[samples[0]])
    steps[1:][np.diff(samples) > 1] = float(np.median(np.diff(time)))
    glued = time[samples[0]] + np.cumsum(steps)
    at = np.searchsorted(time[samples], slips.start)
    kept = np.isin(slips.start, time[samples])
    sign = sliding.sign[inside][at[kept]]
    ends = np.searchsorted(time[samples], slips.end[kept]).clip(max=glued.size - 1)
    before, stroke = sign * slips.before[kept], sliding.piece[inside][at[kept]]
    own = Slips(glued[at[kept]], glued[ends], before, slips.drop[kept], stroke)
    stage = Stage(float(glued[0]), float(glued[-1]), 1.0)
    glued, along = _even(glued, along)
    scales = Scales.of_measurement(apparatus, stage, along, noise_level(along))
    # The velocity is not that of one motion.
    scales = replace(scales, has_velocity=False)
    found = classify(scales, glued, along, np.full(along.size, np.nan), own)
    return found if len(own) else replace(found, regime=SMOOTH)


def _even(time: Array, *values: Array) -> tuple[Array, ...]:
    """Times and values at equal intervals: statistics must not depend on the sampling rates."""
    if len(time) < 2 * MIN_CYCLES:
        return time, *values
    steps = np.diff(time)
    count = min(MAX_SAMPLES, 1 + round((time[-1] - time[0]) / float(np.median(steps))))
    if np.ptp(steps) <= INTERVAL_TOLERANCE * steps.max():
        return time, *values
    even = np.linspace(time[0], time[-1], count)
    return even, *(np.interp(even, time, one) for one in values)


def regime(output: OutputLike) -> Dataset:
    """The regime of each realization of an output: smooth, stick-slip, irregular, or transient.

    Parameters
    ----------
    output
        Output of a run, or a measured trace.

    Returns
    -------
    xarray.Dataset
        Dimension ``realization``; ``regime`` is 0 smooth, 1 stick-slip, 2 irregular, 3 transient.
        The other variables are the statistics that determine it.

    Raises
    ------
    FileError
        If the output cannot be read, or is neither of a run nor a measured trace.

    Examples
    --------
    >>> import mesoslip
    >>> path, *_ = mesoslip.example("klein")  # writes klein.toml
    >>> config = mesoslip.Config.load(path, ["contacts.delay=0", "contacts.initial=steady"])
    >>> mesoslip.regime(mesoslip.run(config))["regime"].values  # smooth
    array([0], dtype=int8)
    """
    with opened_run(output) as (tree, name):
        return regimes(tree, name)


def regimes_of_results(results: Results) -> Iterator[RegimeResult]:
    """The regimes of the realizations of a run; only the evaluated samples are held in memory."""
    index = {name: number for number, name in enumerate(TRACE_COLUMNS)}
    wanted = [index[name] for name in ("time", "elastic_force", "velocity")]
    slip_index = {name: number for number, name in enumerate(SLIP_COLUMNS)}
    for one in results.realizations:
        rows = one.rows("trace")
        if len(rows) < 2 * MIN_CYCLES:
            yield RegimeResult()
            continue
        scales = Scales.of_config(results.config, one.time)
        stage = scales.stage
        step = _step(len(rows))
        blocks, start = [np.empty((0, len(wanted)))], 0
        for block in rows.blocks(MAX_SAMPLES):
            chosen = block[-start % step :: step][:, wanted]
            inside = (chosen[:, 0] >= stage.middle) & (chosen[:, 0] <= stage.end)
            blocks.append(chosen[inside])
            start += len(block)
        time, force, velocity = np.concatenate(blocks).T
        slips = np.concatenate(
            [np.empty((0, len(SLIP_COLUMNS))), *one.rows("slips").blocks(MAX_SAMPLES)]
        )
        columns = ("start_time", "end_time", "force_before", "force_after")
        began, ended, before, after = (slips[:, slip_index[name]] for name in columns)
        yield classify(scales, time, force, velocity, Slips(began, ended, before, before - after))


def _step(count: int) -> int:
    return max(1, -(-count // MAX_SAMPLES))
