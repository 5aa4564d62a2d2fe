"""Records that go back and forth: strokes, and slips between reversals."""

from __future__ import annotations

import mesoslip
import numpy as np
import pytest
from mesoslip.analysis.strokes import (
    find_slips_between_reversals,
    monotone_pieces,
    pieces_of_force,
    record_pieces,
    sliding_of,
)
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Cycles, samples of each, and the phases at which the drive turns [cycles].
CYCLES, SAMPLES = 6.4, 400
TURNS = np.arange(0.25, CYCLES, 0.5)


def phases() -> Array:
    """Phase of each sample of a record [cycles]."""
    return np.arange(round(CYCLES * SAMPLES)) / SAMPLES


def drive(shape: str, phase: Array) -> Array:
    """A drive between -1 and 1, from 0 on, that turns at `TURNS`."""
    sine = np.sin(2 * np.pi * phase)
    triangle = 2 / np.pi * np.arcsin(sine)
    return {
        "sine": sine,
        "triangle": triangle,
        "trapezoid": np.clip(1.25 * triangle, -1, 1),
    }[shape]


def elastic_sliding(x: Array, stiffness: float = 20.0) -> Array:
    """Force of a spring with a Coulomb slider of strength 1."""
    force, rows = 0.0, []
    for step in np.diff(x, prepend=x[0]):
        force = min(max(force + stiffness * step, -1.0), 1.0)
        rows.append(force)
    return np.array(rows)


def stick_slip(x: Array, stiffness: float = 8.0, drop: float = 0.4) -> Array:
    """Force of a spring with a slider that slips when it reaches 1 in either direction."""
    force, rows = 0.0, []
    for step in np.diff(x, prepend=x[0]):
        force += stiffness * step
        if abs(force) > 1:
            force -= np.sign(force) * drop
        rows.append(force)
    return np.array(rows)


@pytest.mark.parametrize("shape", ["sine", "triangle", "trapezoid"])
def test_pieces_end_at_reversals(shape: str) -> None:
    """Also with noise, an offset, and missing samples; at a rest, in its middle."""
    rng = np.random.default_rng(1)
    phase = phases()
    x = 3.0 + drive(shape, phase)
    x += 0.002 * rng.standard_normal(x.size)
    x[rng.integers(0, x.size, 50)] = np.nan
    pieces = monotone_pieces(x)
    assert pieces is not None
    assert [one.direction for one in pieces] == [(-1) ** n for n in range(len(TURNS) + 1)]
    found = phase[[one.first for one in pieces[1:]]]
    np.testing.assert_allclose(found, TURNS, atol=0.02)


def test_an_approach_is_no_measure_of_strokes() -> None:
    """The first motion may be far longer than the strokes, and the drive may tremble."""
    phase = phases()
    approach = np.linspace(-80, 0, 300)
    x = np.concatenate([approach, drive("triangle", phase)])
    x += 0.01 * np.sin(2 * np.pi * 37.3 * np.arange(x.size) / SAMPLES)
    pieces = monotone_pieces(x)
    assert pieces is not None
    assert len(pieces) == len(TURNS) + 1


def test_one_direction_has_no_pieces() -> None:
    """Steps, holds, noise, digital steps and play of the drive are no reversals."""
    rng = np.random.default_rng(2)
    time = np.linspace(0, 10, 3000)
    steps = np.interp(time, [0, 2, 4, 7, 10], [0, 1, 1, 9, 10])
    for x in (
        steps,
        steps + 0.01 * rng.standard_normal(time.size),
        np.round(steps, 1),
        steps - 0.1 * np.clip(time - 5, 0, 0.1),
        np.zeros(time.size),
    ):
        assert monotone_pieces(x) is None


def test_strokes_from_the_sign_of_a_force() -> None:
    """The guess has the reversals; stick-slip in one direction, also about 0, is none."""
    rng = np.random.default_rng(3)
    phase = phases()
    force = elastic_sliding(drive("triangle", phase)) + 0.3
    force += 0.05 * rng.standard_normal(force.size)
    pieces = pieces_of_force(phase, force)
    assert pieces is not None
    np.testing.assert_allclose(phase[[one.first for one in pieces[1:]]], TURNS, atol=0.03)
    for one in (stick_slip(phase), stick_slip(phase, drop=1.9), force[:500]):
        assert pieces_of_force(phase, one) is None
    # The load point is known to move in one direction.
    assert record_pieces(phase, force, phase)[0] is None


@pytest.mark.parametrize("shape", ["sine", "triangle", "trapezoid"])
@pytest.mark.parametrize("sensor", [1.0, -1.0])
def test_reversals_are_no_slips(shape: str, sensor: float) -> None:
    """Every slip of stick-slip in strokes is found, and none without it."""
    rng = np.random.default_rng(4)
    phase = np.arange(round(CYCLES * 1600)) / 1600
    x = drive(shape, phase)
    pieces, name = record_pieces(phase, x, x)
    assert name == "load point"
    smooth = sensor * elastic_sliding(x) + 0.2 + 0.005 * rng.standard_normal(x.size)
    assert len(find_slips_between_reversals(pieces, phase, smooth)) == 0
    exact = stick_slip(x)
    noisy = sensor * exact + 0.2 + 0.005 * rng.standard_normal(x.size)
    found = find_slips_between_reversals(pieces, phase, noisy)
    falls = np.flatnonzero(np.abs(np.diff(exact)) > 0.2)
    # One may be lost before each reversal.
    assert falls.size - len(TURNS) <= len(found) <= falls.size
    near = [np.min(np.abs(phase[falls] - one)) for one in found.start_time]
    assert max(near) < 2.5e-3
    along = sensor * np.sign(np.interp(found.start_time, phase, np.gradient(x)))
    np.testing.assert_allclose(along * (found.force_before - 0.2), 1.0, atol=0.05)
    np.testing.assert_allclose(along * (found.force_after - 0.2), 0.6, atol=0.05)


def test_sliding_parts_have_no_reversals() -> None:
    """Put one after the other, the sliding parts of friction in strokes are constant."""
    x = drive("sine", phases())
    pieces = monotone_pieces(x)
    assert pieces is not None
    sliding = sliding_of(elastic_sliding(x), pieces)
    assert sliding.samples.size > 0.7 * x.size
    whole = sliding.piece < len(pieces) - 1
    np.testing.assert_allclose(sliding.unfolded()[whole], 1.0, atol=1e-12)


@pytest.mark.parametrize("with_load_point", [True, False])
def test_a_reciprocating_file_is_smooth(tmp_path, with_load_point: bool) -> None:  # type: ignore[no-untyped-def]
    """Catalogue and regime of a measured trace without slips; the guess is reported."""
    rng = np.random.default_rng(6)
    time = 10 * phases()
    x = drive("triangle", phases())
    columns = [time, elastic_sliding(x) + 0.02 * rng.standard_normal(x.size)]
    columns += [x] if with_load_point else []
    file = tmp_path / "strokes.csv"
    header = "time [s],force [N]" + (",load point [mm]" if with_load_point else "")
    np.savetxt(file, np.transpose(columns), delimiter=",", header=header, comments="")
    tree = mesoslip.read_trace(file)
    assert mesoslip.slips(tree).sizes["slip"] == 0
    assert int(mesoslip.regime(tree)["regime"][0]) == 0
    guess = "" if with_load_point else "guess, by the sign of the force: "
    assert tree.attrs["comment"].startswith(f"{guess}goes back and forth, with 13 reversals")
