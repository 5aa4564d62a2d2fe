"""Interaction as a mean field: break and birth stretches of a lattice for the master equation.

Contacts of a lattice break and attach at stretches that their neighbours shift. The densities of
both are measured in slow sliding and take the place of P_c(x) and R(x) in the master equation,
whose contacts are independent (model section 15): the thresholds as a table, the stretches of
newborns as a normal law.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mesoslip.array_types import Array
from mesoslip.configuration import arguments
from mesoslip.configuration.config import Config
from mesoslip.errors import ConfigError, FileError, RunError
from mesoslip.output.inputs import ConfigLike, as_config
from mesoslip.output.targets import written_whole
from mesoslip.simulation.realization import Realization

# Displacement of the slider over the mean breaking stretch: until sliding is steady, and in all.
SETTLED, LENGTH = 4.0, 10.0
# Contacts for each avalanche between two observations: meanwhile the slider moves by about a
# thousandth of the mean breaking stretch.
CONTACTS_AN_EVENT = 2000
# Samples of the contact force.
SAMPLES = 4000
# Width of the cells of the tables over the mean stretch at breaking.
CELL = 0.01
# Minimum number of lives.
MIN_LIVES = 1000

STEADY, FIRST = "steady", "first"


@dataclass(frozen=True)
class ContactLives:
    """Lives of contacts on a lattice, from attaching to breaking, one row each.

    Attributes
    ----------
    displacement
        Displacement of the slider at the break [m].
    birth_stretch, break_stretch
        Stretches at which the contact attached and broke [m].
    stiffness
        Stiffness of the contact [N/m].
    number
        Number of the life of its contact, from 0 for that of the start.
    """

    displacement: Array
    birth_stretch: Array
    break_stretch: Array
    stiffness: Array
    number: Array

    @classmethod
    def joined(cls, parts: Sequence[Sequence[Array]]) -> ContactLives:
        """Join the lives of several steps or realizations, each given as columns."""
        return cls(*(np.concatenate(column) for column in zip(*parts, strict=True)))

    @property
    def columns(self) -> tuple[Array, ...]:
        return (
            self.displacement,
            self.birth_stretch,
            self.break_stretch,
            self.stiffness,
            self.number,
        )

    def chosen(self, which: NDArray[np.bool_]) -> ContactLives:
        """Some of the lives."""
        return ContactLives(*(column[which] for column in self.columns))


@dataclass(frozen=True)
class MeanField:
    """The tables of a lattice, and the configuration of the master equation that they give.

    Attributes
    ----------
    lattice
        The configuration of the lattice.
    lives
        Lives of its contacts in slow sliding.
    settled_force
        Mean contact force in that sliding, after the transient [N].
    """

    lattice: Config
    lives: ContactLives
    settled_force: float

    @cached_property
    def _settled(self) -> ContactLives:
        start = SETTLED * self.lattice.contacts.break_stretch
        return self.lives.chosen(self.lives.displacement > start)

    def _breaks(self, generation: str) -> ContactLives:
        return self._settled if generation == STEADY else self.lives.chosen(self.lives.number == 0)

    def _births(self, generation: str) -> Array:
        if generation == STEADY:
            return self._settled.birth_stretch
        births: Array = self.lives.birth_stretch[self.lives.number == 1]
        return births

    @property
    def stiffness(self) -> float:
        """Stiffness N k of equal contacts that bear the same force in steady sliding [N/m]."""
        lives = self._settled
        weight = lives.break_stretch**2 - lives.birth_stretch**2
        mean = np.sum(weight * lives.stiffness) / np.sum(weight)
        return float(self.lattice.contacts.count * mean)

    @property
    def correlation(self) -> float:
        """Correlation of the stretches at birth and at break of a life; 0 in a mean field."""
        lives = self._settled
        return float(np.corrcoef(lives.birth_stretch, lives.break_stretch)[0, 1])

    @property
    def newborn_misfit(self) -> float:
        """Maximum difference of the distribution of birth stretches from a normal one, 0 to 1."""
        from scipy.special import ndtr

        births = np.sort(self._settled.birth_stretch)
        fitted = ndtr((births - births.mean()) / births.std())
        ranks = np.arange(births.size + 1) / births.size
        return float(max(np.max(ranks[1:] - fitted), np.max(fitted - ranks[:-1])))

    def table(self, generation: str = STEADY) -> tuple[Array, Array, Array]:
        """Middles of cells of the stretch, over the mean stretch at breaking, and the shares of
        breaks and of births in each.

        Parameters
        ----------
        generation
            "steady" for sliding after the transient, "first" for the first break of each contact
            after a relaxed start, and the birth that follows.
        """
        breaks = self._breaks(generation).break_stretch
        births = self._births(generation) / breaks.mean()
        breaks = breaks / breaks.mean()
        cells = math.ceil(max(breaks.max(), births.max()) / CELL)
        edges = CELL * np.arange(cells + 1)
        # The few newborns that are stretched backwards count with the first cell.
        shares = [
            np.histogram(np.maximum(one, 0.0), edges)[0] / one.size for one in (breaks, births)
        ]
        return edges[:-1] + CELL / 2, shares[0], shares[1]

    def config(self, generation: str = STEADY) -> Config:
        """The configuration of the master equation with the tables, see `table`.

        Its static force is that of contacts that break at the mean stretch; contacts are `equal`.

        Raises
        ------
        ConfigError
            If the master equation cannot have such newborns.
        """
        return Config.from_dict(self._tables(generation), "mean field")

    @property
    def summary(self) -> dict[str, tuple[float, str, str]]:
        """Values in SI with unit and meaning, for print."""
        breaks, births = self._settled.break_stretch, self._settled.birth_stretch
        first = self._breaks(FIRST).break_stretch
        renewal = 0.5 * (np.mean(breaks**2) - np.mean(births**2)) / (breaks.mean() - births.mean())
        return {
            "lives": (breaks.size, "1", "lives of contacts in steady sliding"),
            "mean_break_stretch": (breaks.mean(), "m", "mean stretch at breaking"),
            "break_stretch_width": (breaks.std() / breaks.mean(), "1", "its relative width"),
            "mean_birth_stretch": (births.mean(), "m", "mean stretch at attaching"),
            "birth_stretch_width": (births.std() / breaks.mean(), "1", "its width, over the mean "
                                    "stretch at breaking"),
            "newborn_misfit": (self.newborn_misfit, "1", "maximum difference of its distribution "
                               "from the normal one of the configuration"),
            "first_break_stretch": (first.mean(), "m", "mean stretch at the first break"),
            "first_break_width": (first.std() / first.mean(), "1", "its relative width"),
            "correlation": (self.correlation, "1", "correlation of both stretches of a life, 0 in "
                            "the master equation"),
            "mean_force": (self.settled_force, "N", "contact force of the lattice in steady "
                           "sliding"),
            "renewal_force": (self.stiffness * float(renewal), "N", "the same of independent "
                              "contacts with these stretches"),
        }  # fmt: skip

    def _tables(self, generation: str) -> dict[str, object]:
        breaks, births = self._breaks(generation).break_stretch, self._births(generation)
        middle, share, _ = self.table(generation)
        used = share > 0
        tables = self.lattice.to_dict()
        tables["title"] = f"{tables.get('title', '')}, mean field of {generation} breaks".lstrip(
            ", "
        )
        del tables["interaction"]
        tables["run"] |= {"engine": "me", "realizations": 1}
        for key in ("avalanche_size", "snapshots", "snapshot_size"):
            tables["output"].pop(key, None)
        tables["contacts"] |= {
            "coupling": "equal",
            "initial": "relaxed",
            "stiffness": self.stiffness,
            "static_force": self.stiffness * float(breaks.mean()),
            "back_force_ratio": float(births.mean() / breaks.mean()),
            "newborn_width": float(births.std() / breaks.mean()),
            "threshold": {
                "law": "table",
                "samples": tuple(middle[used].tolist()),
                "weights": tuple(share[used].tolist()),
            },
        }
        return tables

    def write(self, path: Path, generation: str = STEADY) -> tuple[Path, Path]:
        """Write the configuration, and beside it a CSV file of the tables, which it names.

        Parameters
        ----------
        path
            The configuration, a TOML file.
        generation
            See `table`.

        Returns
        -------
        tuple of Path
            The configuration and the CSV file, with columns ``threshold``, ``weight`` of breaks and
            ``newborn_weight`` of births at the same stretch.

        Raises
        ------
        FileError
            If the name does not end in ``.toml``, or a file cannot be written.
        """
        import tomli_w

        if path.suffix != ".toml":
            raise FileError(f"{path}: a configuration must end in .toml, as {path.stem}.toml does")
        self.config(generation)
        tables = self._tables(generation)
        beside = path.with_suffix(".csv")
        contacts = tables["contacts"]
        assert isinstance(contacts, dict)
        contacts["threshold"] = {"law": "table", "file": beside.name}
        with (
            written_whole(beside) as part,
            part.open("w", newline="", encoding="utf-8") as file,
        ):
            writer = csv.writer(file)
            writer.writerow(["threshold", "weight", "newborn_weight"])
            writer.writerows(zip(*(one.tolist() for one in self.table(generation)), strict=True))
        with written_whole(path) as part:
            part.write_text(tomli_w.dumps(tables), encoding="utf-8")
        return path, beside


@arguments.checked(progress=arguments.function)
def mean_field(config: ConfigLike, *, progress: Callable[[float], None] | None = None) -> MeanField:
    """Measure the stretches at which contacts of a lattice break and attach in slow sliding.

    Parameters
    ----------
    config
        A run of contacts with interaction: a TOML file, an output, nested tables, or a `Config`.
        Its slider and drive do not matter here: the slider is moved slowly over ten mean breaking
        stretches from a relaxed start, without delay, in as many realizations as the run has.
    progress
        Called with the completed fraction, 0 to 1.

    Returns
    -------
    MeanField
        The lives of the contacts, their tables, and the configuration for the master equation:
        that of the run otherwise.

    Raises
    ------
    ConfigError
        If the configuration is wrong, or has no interaction.
    RunError
        If a cascade of contacts does not end, or there are too few lives for a table.

    Examples
    --------
    >>> import mesoslip
    >>> path, *_ = mesoslip.example("avalanche")  # writes avalanche.toml
    >>> changes = ["contacts.count=100", "interaction.columns=10", "interaction.rows=10"]
    >>> config = mesoslip.Config.load(path, [*changes, "interaction.strength=0.1"])
    >>> mesoslip.mean_field(config).config("steady").run.engine
    'me'
    """
    checked = as_config(config)
    if not checked.contact_kind.on_lattice:
        message = "needed: without neighbours the master equation is exact for many contacts"
        raise ConfigError.of("interaction", message)
    if not checked.contacts.reattach:
        message = "must be true: contacts that do not attach again have no steady sliding"
        raise ConfigError.of("contacts.reattach", message, False)
    sliding = _sliding(checked)
    parts, forces = [], []
    count = checked.run.realizations
    for number in range(count):
        with Realization(sliding, number) as one:
            parts.append(_lives(one, progress, number, count))
            trace = one.records("trace")
        start = SETTLED * checked.contacts.break_stretch
        forces.append(trace["contact_force"][trace["displacement"] > start].mean())
    lives = ContactLives.joined([one.columns for one in parts])
    if len(lives.displacement) < MIN_LIVES:
        raise RunError(
            f"contacts broke {len(lives.displacement)} times: a table needs {MIN_LIVES} of them; "
            "a larger lattice or more realizations (run.realizations) would have them"
        )
    return MeanField(checked, lives, float(np.mean(forces)))


def _sliding(config: Config) -> Config:
    """Slow sliding of the lattice; without delay and drag its velocity does not matter."""
    length = LENGTH * config.contacts.break_stretch
    tables = config.to_dict()
    tables["run"] = {"seed": config.run.seed, "duration": 1.0}
    tables["drive"] = {"velocity": length}
    tables["slider"] = {"kind": "prescribed"}
    tables["contacts"] |= {"delay": 0.0, "drag": 0.0, "drag_rate": 0.0, "initial": "relaxed"}
    tables["output"] = {"interval": 1 / SAMPLES}
    return Config.from_dict(tables, "slow sliding")


def _lives(
    one: Realization, progress: Callable[[float], None] | None, number: int, count: int
) -> ContactLives:
    """Lives of the contacts of a realization, observed after each avalanche or a few of them.

    Breaks are placed at the mean displacement of these avalanches, exact with one at a time. Of a
    contact that breaks twice between two observations one life is recorded.
    """
    before, displacement = one.contacts, 0.0
    birth = -before["origin"]
    events = max(1, one.config.contacts.count // CONTACTS_AN_EVENT)
    parts: list[tuple[Array, ...]] = []
    while not one.ending:
        one.advance(events)
        if progress is not None:
            progress((number + one.part_done) / count)
        now = one.contacts
        mean = displacement + (one.displacement - displacement) * (events + 1) / (2 * events)
        broken = np.flatnonzero(now["renewals"] > before["renewals"])
        old = {name: values[broken] for name, values in before.items()}
        parts.append(
            (
                np.full(broken.size, mean),
                birth[broken],
                mean - old["origin"],
                old["stiffness"],
                old["renewals"],
            )
        )
        birth[broken] = mean - now["origin"][broken]
        before, displacement = now, one.displacement
    return ContactLives.joined(parts)
