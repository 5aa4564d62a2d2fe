"""What is in the state of a run, as the kernels put it away (fortran/numerics/archive.f90)."""

import dataclasses

import numpy as np
from mesoslip import Config
from mesoslip.simulation.realization import Realization, Saved

NAME_WORDS = 4
SECTION, REAL, INTEGER = range(3)


def entries(words: np.ndarray) -> dict[str, tuple[slice, tuple[int, int]]]:
    """Places and shapes of the entries by name; of entries with one name, the last."""
    found = {}
    place = 0
    while place < len(words):
        name = words[place : place + NAME_WORDS].tobytes().decode().strip()
        kind, *shape = words[place + NAME_WORDS : place + NAME_WORDS + 3]
        place += NAME_WORDS + 3
        length = 0 if kind == SECTION else int(shape[0] * shape[1])
        found[name] = (slice(place, place + length), (int(shape[0]), int(shape[1])))
        place += length
    return found


def saved(realization: Realization) -> Saved:
    """The state of a realization, to be changed or taken up."""
    state = realization.save()
    assert state.words is not None
    return dataclasses.replace(state, words=state.words.copy())


def reals(state: Saved, name: str) -> np.ndarray:
    """An array of a state, shape (columns, rows) of the one in Fortran, to be changed in place."""
    assert state.words is not None
    place, shape = entries(state.words)[name]
    return state.words[place].view(np.float64).reshape(shape[::-1])


def taken_up(config: Config, state: Saved, before: Realization) -> Realization:
    """A realization that goes on from a state, with what was recorded before."""
    next_one = Realization(config, before.number)
    next_one.restore(state, dict(before.waiting))
    return next_one
