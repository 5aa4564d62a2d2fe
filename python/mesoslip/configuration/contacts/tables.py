"""The tables of the contacts: [contacts], [contacts.threshold], and [interaction]."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import Field, StrictBool, model_validator

from mesoslip.configuration.kernel_parameters import Parameters
from mesoslip.configuration.table import (
    Area,
    Complaint,
    Complaints,
    Density,
    Drag,
    Force,
    Length,
    Number,
    Rate,
    Stiffness,
    Table,
    Temperature,
    Text,
    Time,
    Whole,
    choice,
    problem,
)
from mesoslip.configuration.threshold_law import ThresholdLaw
from mesoslip.configuration.threshold_laws import LAWS
from mesoslip.configuration.threshold_laws.base import MIN_WIDTH, ThresholdLawKind
from mesoslip.configuration.threshold_laws.table import (
    StretchCells,
    law_cells,
    read_samples,
    sample_problem,
    stretch_cells,
)
from mesoslip.errors import ConfigError, FileError, Problem
from mesoslip.quantities import with_unit

Array = NDArray[np.float64]

# Choices, by the names that the kernels use.
COUPLINGS = ("scaled", "equal", "table")
SAMPLE_KEYS = ("samples", "weights", "stiffnesses")
DELAY_LAWS = ("fixed", "exponential")
AGEING_LAWS = ("relax", "log")
CORRELATIONS = ("gaussian", "exponential")
RENEWALS = ("redraw", "keep")
INITIAL_STATES = ("relaxed", "steady", "uniform")
LATTICES = ("triangular", "square")

# Neighbours of a contact on each lattice.
NEIGHBOURS = {"triangular": 6, "square": 4}

# Minimum fraction of thresholds above the back force; with less, drawing them takes too long.
MIN_ACCEPTED = 0.5

# Minimum factor of thresholds on a track, and probability of a threshold that can attach anywhere
# on it.
MIN_STRENGTH, STRONG_PART = 0.05, 0.01
# Part of a track with the minimum factor of which there is a message.
MIN_CUT_SHARE = 1e-4
# Minimum correlation length of a track over the mean breaking stretch: the contacts of a slider
# attached along a breaking stretch, over which shorter variations average out.
MIN_LENGTH_RATIO = 0.1

# Keys of [contacts.ageing] that belong to one law each.
AGEING_KEYS = {"relax": ("young_force_ratio", "young_relative_width"), "log": ("growth",)}
# Age of contacts that are fully aged [s].
INFINITE_AGE = 1e300

# Boltzmann's constant [J/K], exact in the SI.
BOLTZMANN = 1.380649e-23
# Maximum number of times that a contact breaks in a run without bearing more than the back force.
MAX_IDLE_BREAKS = 1e9
# Maximum delay relative to the mean life of such a contact.
MAX_IDLE_DELAY = 1e6

# Maximum stiffness of all bonds of a contact, relative to its own: beyond it the breaking force, a
# difference of its own force and its neighbours', has fewer than ten digits.
MAX_BOND_RATIO = 1e6


class Threshold(Table):
    """Law of the relative thresholds, f_si/f_s: its mean is 1."""

    law: Annotated[str, choice(LAWS)] = "gaussian"
    """Law of the relative thresholds, whose mean is 1; `table` is that of samples, such as measured
    areas of contacts."""
    relative_width: Annotated[Number, Field(ge=MIN_WIDTH)]
    """Standard deviation of the relative thresholds, Δf_s/f_s. That of a table follows from its
    samples; leave it out."""
    file: Text | None = None
    """With `table`: a CSV file with a column threshold or area, and maybe the columns weight and
    stiffness; relative to the configuration. Outputs keep the samples, not the name of the file."""
    samples: tuple[Number, ...] | None = None
    """With `table`: samples of the thresholds, instead of a file. Only their ratios matter."""
    weights: tuple[Number, ...] | None = None
    """Weights of the samples; by default they are equal."""
    stiffnesses: tuple[Number, ...] | None = None
    """Stiffnesses of the samples. Only their ratios matter: their mean is that of
    `contacts.stiffness`, which is N k. Contacts have them with `contacts.coupling` "table", the
    default then."""

    @model_validator(mode="before")
    @classmethod
    def _read(cls, values: Any) -> Any:
        if not isinstance(values, Mapping):
            return values
        table = {key: one for key, one in values.items() if one is not None}
        if table.get("law") != "table":
            return values
        if isinstance(table.get("file"), str):
            if table.keys() & set(SAMPLE_KEYS):
                raise problem("file", "give either a file, or samples and weights")
            try:
                table.update(read_samples(Path(table.pop("file"))))
            except FileError as error:
                raise problem("file", str(error)) from None
        # Where samples are wrong, their error is reported, not that of the width.
        table.setdefault("relative_width", _width_of(table.get("samples"), table.get("weights")))
        return table

    @model_validator(mode="after")
    def _samples_of_a_table(self) -> Self:
        if not self.kind.is_sampled:
            for key in ("file", *SAMPLE_KEYS):
                if getattr(self, key) is not None:
                    raise problem(key, f'is for law = "table", not "{self.law}"')
            return self
        if self.samples is None:
            raise problem("file", 'needed for law = "table", or samples')
        key, message = sample_problem(self.samples, self.weights, self.stiffnesses)
        if key:
            raise problem(key, message)
        width = law_cells(self.samples, self.weights).relative_width
        if not math.isclose(width, self.relative_width, rel_tol=1e-6):
            raise problem("relative_width", f"follows from the samples, {width:.6g}: leave it out")
        return self

    @model_validator(mode="after")
    def _width_that_is_possible(self) -> Self:
        wrong = self.kind.width_problem(self.relative_width)
        if wrong:
            raise problem("relative_width", wrong)
        return self

    @property
    def kind(self) -> ThresholdLawKind:
        """The limits of the law."""
        return LAWS[self.law]

    @property
    def kernel_parameters(self) -> Parameters:
        """Parameters of the law in the kernel."""
        cells = self.stretch_cells
        of_law = self.kind.kernel_parameters(self) if cells is None else cells.kernel_parameters
        return {"threshold_law": self.law, **of_law}

    @property
    def stretch_cells(self) -> StretchCells | None:
        """Cells of break stretches of samples with stiffnesses; None without those."""
        if self.samples is None or self.stiffnesses is None:
            return None
        return stretch_cells(self.samples, self.weights, self.stiffnesses)

    def probability_above(self, threshold: float) -> float:
        """Probability that a draw is above a relative threshold."""
        # Not a law cut off there, which does not exist if the probability is 0.
        law = self.above(0.0)
        return law.acceptance * float(law.survival(threshold))

    def above(self, minimum: float) -> ThresholdLaw:
        """The law, with thresholds at or below a minimum rejected."""
        return ThresholdLaw(self.law, self.relative_width, minimum, self.samples, self.weights)


def _width_of(samples: Any, weights: Any) -> float:
    """Relative width of samples that are still to be checked; 1 if they are wrong."""
    try:
        values = tuple(float(one) for one in samples)
        shares = None if weights is None else tuple(float(one) for one in weights)
        if sample_problem(values, shares)[0]:
            return 1.0
        return law_cells(values, shares).relative_width
    except (TypeError, ValueError, OverflowError):
        return 1.0


class Ageing(Table):
    """How the threshold of a contact changes with its age (model section 9).

    The static force and the relative width of [contacts] are those of old contacts with the law
    `relax`, and of new contacts with the law `log`. Contacts start a run with these thresholds,
    unless ``initial_age`` gives another age.
    """

    law: Annotated[str, choice(AGEING_LAWS)] = "relax"
    """`relax`: exponential approach to the old thresholds; `log`: logarithmic growth with age."""
    time: Annotated[Time, Field(gt=0)]
    """Time scale of ageing, τ_a."""
    young_force_ratio: Annotated[Number, Field(gt=0)] | None = None
    """With `relax`: mean threshold of young contacts, relative to that of old ones."""
    young_relative_width: Annotated[Number, Field(ge=MIN_WIDTH)] | None = None
    """With `relax`: relative standard deviation of the thresholds of young contacts."""
    growth: Annotated[Number, Field(ge=0)] | None = None
    """With `log`: growth β per e-fold of age, in f_s [1 + β ln(1 + age/time)]."""
    initial_age: Annotated[Time, Field(ge=0)] | None = None
    """Age of the contacts at the start; by default fully aged with `relax`, 0 with `log`."""

    @model_validator(mode="after")
    def _keys_of_the_law(self) -> Self:
        for law, keys in AGEING_KEYS.items():
            for key in keys:
                is_given = getattr(self, key) is not None
                if is_given and law != self.law:
                    raise problem(key, f'is for law = "{law}", not "{self.law}"')
                if not is_given and law == self.law:
                    raise problem(key, f'needed for law = "{law}"')
        return self

    @property
    def start_age(self) -> float:
        """Age of the contacts at the start of a run [s]."""
        if self.initial_age is not None:
            return self.initial_age
        return INFINITE_AGE if self.law == "relax" else 0.0

    def kernel_parameters(self) -> Parameters:
        """Parameters of the law in the kernel."""
        return {
            "ageing": self.law,
            "ageing_time": self.time,
            "initial_age": self.start_age,
            **{key: getattr(self, key) for key in AGEING_KEYS[self.law]},
        }

    def threshold(self, configured: ArrayLike, width: float, age: ArrayLike) -> Array:
        """Thresholds at an age [s], from the configured ones; both relative to the static force.

        ``width`` is the relative width of the configured thresholds.
        """
        old, relative_age = np.asarray(configured), np.asarray(age) / self.time
        if self.law == "log":
            return np.asarray(old * (1 + (self.growth or 0.0) * np.log1p(relative_age)))
        ratio, young_width = self.young_force_ratio or 1.0, self.young_relative_width or width
        young = ratio * (1 + young_width * (old - 1) / width)
        return np.asarray(old + (young - old) * np.exp(-relative_age))

    def configured(self, threshold: float, width: float, age: float) -> float:
        """Configured threshold of a contact, from its threshold at an age."""
        at_zero, at_one = self.threshold([0.0, 1.0], width, age)
        return float((threshold - at_zero) / (at_one - at_zero))


class Thermal(Table):
    """Thermally activated breaking (model section 13).

    A contact that bears the force f below its threshold f_s breaks at the rate
    ω_0 exp((|f| − f_s)/f_T), and at once at the threshold, which may change with age. The force f_T
    is given relative to the mean threshold, or as k_B T over an activation length.
    """

    rate: Annotated[Rate, Field(gt=0)]
    """Rate of breaking at the threshold, ω_0."""
    force_ratio: Annotated[Number, Field(gt=0)] | None = None
    """Force scale of activation relative to the mean threshold, f_T/f_s."""
    temperature: Annotated[Temperature, Field(gt=0)] | None = None
    """Temperature T, in place of `force_ratio`; f_T = k_B T/x_a."""
    activation_length: Annotated[Length, Field(gt=0)] | None = None
    """Activation length x_a, with `temperature`."""

    @model_validator(mode="before")
    @classmethod
    def _all_that_is_missing(cls, values: Any) -> Any:
        """Report keys that depend on one another together with the rate."""
        if not isinstance(values, Mapping):
            return values
        has = {key for key, value in values.items() if value is not None}
        if "rate" in has or "force_ratio" in has:
            return values
        pair = ("temperature", "activation_length")
        missing = [key for key in pair if key not in has]
        if len(missing) == 1:
            raise problem("rate", f"missing, and so is {missing[0]}: f_T = k_B T/x_a needs both")
        return values

    @model_validator(mode="after")
    def _one_force(self) -> Self:
        if self.force_ratio is not None:
            for key in ("temperature", "activation_length"):
                if getattr(self, key) is not None:
                    raise problem(
                        key,
                        "give either force_ratio, or temperature and activation_length: both "
                        "determine the force f_T = k_B T/x_a",
                    )
        elif self.temperature is None and self.activation_length is None:
            raise problem("force_ratio", "needed, or temperature and activation_length")
        else:
            for key in ("temperature", "activation_length"):
                if getattr(self, key) is None:
                    raise problem(key, "needed without force_ratio: f_T = k_B T/x_a")
        return self

    def ratio(self, contact_static_force: float) -> float:
        """f_T/f_s, from the mean threshold of a contact [N]."""
        if self.force_ratio is not None:
            return self.force_ratio
        assert self.temperature is not None
        assert self.activation_length is not None
        return BOLTZMANN * self.temperature / self.activation_length / contact_static_force

    def rate_under(self, force_ratio: float, contact_static_force: float) -> float:
        """Rate at which a contact of mean threshold breaks under a force relative to it [1/s]."""
        return self.rate * math.exp((force_ratio - 1) / self.ratio(contact_static_force))


class Track(Table):
    """Strength of the interface along the track of the slider (model section 18).

    The threshold of a contact that attaches while the slider is at X is multiplied by 1 + w g(X).
    g is Gaussian, with mean 0 and variance 1, and another function for each realization. The same X
    meets the same strength in each stroke. Contacts at the start have the strength of X = 0.
    """

    spread: Annotated[Number, Field(gt=0, le=1)]
    """Standard deviation of the strength relative to its mean, w. The factor is at least 0.05, and
    at least so high that a hundredth of the thresholds exceeds the back force."""
    length: Annotated[Length, Field(gt=0)]
    """Correlation length l, at least a tenth of the breaking stretch F_s/(N k)."""
    correlation: Annotated[str, choice(CORRELATIONS)] = "gaussian"
    """Correlation of the strength at two places ΔX apart: `gaussian`, exp(−(ΔX/l)²/2), which is
    smooth; `exponential`, exp(−|ΔX|/l), which is rough at all scales."""

    def kernel_parameters(self, floor: float) -> Parameters:
        """Parameters of the track in the kernel, with the minimum factor."""
        return {
            "track_spread": self.spread,
            "track_length": self.length,
            "track_floor": floor,
            "track_correlation": self.correlation,
        }


class Contacts(Table):
    """The contacts of the interface; forces, stiffness and area are totals of all contacts."""

    count: Annotated[Whole, Field(ge=1, lt=2**31)]
    """Number of contacts, N."""
    static_force: Annotated[Force, Field(gt=0)]
    """Sum of the mean static thresholds, F_s = N f_s. Contacts do not all break at once, so the
    maximum force of a run is less: `F_peak` of `mesoslip curve`."""
    stiffness: Annotated[Stiffness, Field(gt=0)]
    """Total stiffness of the contacts, N k."""
    area: Annotated[Area, Field(gt=0)] | None = None
    """Real area of contact, A, which the contacts fill: each has A/N. It enters the mass of a
    contact, ρ (A/N) h, with that its drag, and the distance between neighbours, (A/N)^(1/2)."""
    film_thickness: Annotated[Length, Field(gt=0)] | None = None
    """Thickness of the film between the surfaces, h; with area and density it gives the mass of
    the contacts."""
    film_density: Annotated[Density, Field(gt=0)] | None = None
    """Density of the film, ρ."""
    drag_rate: Annotated[Rate, Field(ge=0)] = 0.0
    """Rate η of the drag m η V of a detached contact; needs area, film_thickness and
    film_density."""
    drag: Annotated[Drag, Field(ge=0)] = 0.0
    """Drag of all contacts together over the velocity, if all were detached, N m η; in place of
    `drag_rate` where no film is known."""
    delay: Annotated[Time, Field(ge=0)] = 0.0
    """Time between detaching and attaching again, τ_d."""
    delay_law: Annotated[str, choice(DELAY_LAWS)] = "fixed"
    """`fixed`: all contacts wait for the same delay; `exponential`: each delay is drawn from the
    exponential law, whose mean is `delay`."""
    back_force_ratio: Annotated[Number, Field(ge=0, lt=1)] = 0.0
    """Force at which a contact attaches, relative to the mean threshold, f_b/f_s; with `renewal`
    "keep", relative to its own threshold."""
    newborn_width: Annotated[Number, Field(ge=0, le=0.25)] = 0.0
    """Standard deviation of the force at which contacts attach, relative to the mean threshold. The
    force is normal, and drawn again with the threshold where it is not below that."""
    coupling: Annotated[str, choice(COUPLINGS)] = "scaled"
    """`scaled`: stiffness is proportional to the square root of the threshold, mass to the
    threshold; `equal`: all contacts have the same stiffness and mass; `table`, the default where
    `contacts.threshold` has stiffnesses: they are those of the contacts, and the mass is
    proportional to their square."""
    initial: Annotated[str, choice(INITIAL_STATES)] = "relaxed"
    """State at the start. `relaxed`: no contact bears force; `steady`: as in slow sliding;
    `uniform`: stretches uniformly distributed up to breaking."""
    reattach: StrictBool = True
    """Whether broken contacts attach again; false gives a fibre bundle."""
    threshold: Threshold
    """Law of the thresholds."""
    ageing: Ageing | None = None
    """Change of the thresholds with age; none by default."""
    thermal: Thermal | None = None
    """Thermally activated breaking; none by default."""
    track: Track | None = None
    """Strength that varies along the track of the slider; none by default."""
    renewal: Annotated[str, choice(RENEWALS)] = "redraw"
    """`redraw`: a contact draws its threshold each time it attaches, as a junction does; `keep`: it
    keeps the first one in all its lives, as an asperity does, and attaches under the part
    `back_force_ratio` of it."""

    @model_validator(mode="after")
    def _stiffnesses_of_the_table(self) -> Self:
        has_table = self.threshold.stiffnesses is not None
        if has_table and "coupling" not in self.model_fields_set:
            object.__setattr__(self, "coupling", "table")
        if has_table and self.coupling != "table":
            raise problem(
                "coupling",
                f'must be "table" (is "{self.coupling}"): the table of thresholds has stiffnesses; '
                "leave the key out, or remove them from the table",
            )
        if self.coupling == "table" and not has_table:
            raise problem(
                "coupling",
                '"table" needs contacts.threshold with stiffnesses: a file with a column '
                'stiffness, or the key stiffnesses; otherwise "scaled" or "equal"',
            )
        return self

    @model_validator(mode="after")
    def _mass_for_drag(self) -> Self:
        if self.drag_rate > 0 and self.drag > 0:
            raise problem(
                "drag",
                "give either drag or drag_rate (0 or left out): both determine the drag of "
                "detached contacts",
            )
        if self.drag_rate > 0:
            for key in ("area", "film_thickness", "film_density"):
                if getattr(self, key) is None:
                    raise problem(key, "needed for the mass of the contacts, as drag_rate is given")
        return self

    @model_validator(mode="after")
    def _contacts_attach(self) -> Self:
        above = self.threshold.probability_above(self.min_threshold)
        if above < MIN_ACCEPTED:
            raise problem(
                "back_force_ratio",
                f"only {above:.3g} of the thresholds{self._of_the_young} are above the back force, "
                f"at least {MIN_ACCEPTED} must be: choose a lower back_force_ratio or a narrower "
                f"threshold law{', or stronger young contacts' if self._of_the_young else ''}",
            )
        return self

    @model_validator(mode="after")
    def _track_that_is_felt(self) -> Self:
        if self.track is not None and self.track.length < MIN_LENGTH_RATIO * self.break_stretch:
            raise problem(
                "track.length",
                f"must be at least {with_unit(MIN_LENGTH_RATIO * self.break_stretch, 'm')}, a "
                "tenth of the breaking stretch F_s/(N k): contacts that are pinned at one time "
                "attached along a breaking stretch, over which shorter variations average out",
            )
        return self

    @property
    def needed_track(self) -> Track:
        """The track; an error if there is none."""
        if self.track is None:
            message = "missing: the strength is the same everywhere"
            raise ConfigError([Problem("", "contacts.track", message)])
        return self.track

    @property
    def place_keys(self) -> tuple[str, ...]:
        """Keys by which contacts differ from place to place along the track."""
        return () if self.track is None else ("contacts.track",)

    @property
    def place_length(self) -> float:
        """Correlation length of the strength from place to place [m]; 0 where it is the same."""
        return 0.0 if self.track is None else self.track.length

    @property
    def strength_floor(self) -> float:
        """Minimum factor of the thresholds on a track: some contacts can attach anywhere."""
        if self.renewal == "keep":
            return MIN_STRENGTH
        strong = self.threshold.above(0.0).quantile([STRONG_PART])
        weakest = min(float(strong[0]), float(self.threshold_at(strong, 0.0)[0]))
        return max(MIN_STRENGTH, self.back_force_ratio / weakest)

    @property
    def weak_track(self) -> str | None:
        """A message if part of the track is so weak that its strength is cut off; else None."""
        if self.track is None:
            return None
        floor = self.strength_floor
        share = 0.5 * math.erfc((1 - floor) / (math.sqrt(2) * self.track.spread))
        if share < MIN_CUT_SHARE:
            return None
        return (
            f"contacts.track.spread = {self.track.spread:g}: on {100 * share:.2g} % of the track "
            f"the strength is cut off at {floor:.3g} of its mean"
        )

    @property
    def _of_the_young(self) -> str:
        """Part of a message: thresholds of young contacts, if those are what is too low."""
        return " of young contacts" if self.min_threshold > self.back_force_ratio else ""

    @property
    def min_threshold(self) -> float:
        """Configured relative threshold at or below which a contact cannot attach, or would detach
        by itself."""
        # The force at attaching is below a threshold of which it is a part.
        back = 0.0 if self.renewal == "keep" else self.back_force_ratio
        if self.ageing is None:
            return back
        young = self.ageing.configured(back, self.threshold.relative_width, 0.0)
        return max(back, young)

    def threshold_at(self, configured: Array, age: ArrayLike) -> Array:
        """Thresholds at an age [s], from the configured ones; both relative to the static force."""
        if self.ageing is None:
            return np.broadcast_to(configured, np.broadcast_shapes(configured.shape, np.shape(age)))
        return self.ageing.threshold(configured, self.threshold.relative_width, age)

    @property
    def relative_widths(self) -> dict[str, float]:
        """Keys of the relative widths of thresholds, and their values."""
        widths = {"contacts.threshold.relative_width": self.threshold.relative_width}
        if self.ageing is not None and self.ageing.young_relative_width is not None:
            widths["contacts.ageing.young_relative_width"] = self.ageing.young_relative_width
        return widths

    @property
    def contact_static_force(self) -> float:
        """f_s [N]."""
        return self.static_force / self.count

    @property
    def contact_stiffness(self) -> float:
        """k [N/m]."""
        return self.stiffness / self.count

    @property
    def contact_mass(self) -> float:
        """m = ρ (A/N) h [kg]; 0 without a described film."""
        if self.area is None or self.film_thickness is None or self.film_density is None:
            return 0.0
        return self.film_density * self.area / self.count * self.film_thickness

    @property
    def contact_drag(self) -> float:
        """m η [N s/m]."""
        return self.drag / self.count if self.drag > 0 else self.contact_mass * self.drag_rate

    @property
    def stretch_width(self) -> float:
        """Standard deviation of the break stretches, in f_s/k; to first order in that of the
        thresholds without a table of stiffnesses."""
        cells = self.threshold.stretch_cells
        if cells is not None:
            return cells.width
        return self.threshold.relative_width * (0.5 if self.coupling == "scaled" else 1.0)

    @property
    def break_stretch(self) -> float:
        """Mean stretch at which a contact breaks, f_s/k [m]."""
        return self.static_force / self.stiffness


class Interaction(Table):
    """Forces between neighbouring contacts on a lattice with periodic boundaries (S25 to S27)."""

    strength: Number
    """Dimensionless strength ξ = g/(f_s a⁴) of the repulsion g/r³ between neighbours at distance
    a."""
    lattice: Annotated[str, choice(LATTICES)] = "triangular"
    """Lattice of the contacts, with periodic boundaries."""
    columns: Annotated[Whole, Field(ge=2)]
    """Number of contacts in a row."""
    rows: Annotated[Whole, Field(ge=2)]
    """Number of rows, even on a triangular lattice; columns × rows = contacts.count."""

    @model_validator(mode="after")
    def _contacts_attach(self) -> Self:
        if self.strength < 0:
            raise problem(
                "strength",
                "must not be negative: with attracting neighbours k + G z may be negative, and no "
                f"stretch has the force at which a contact attaches (is {self.strength:g})",
            )
        return self

    @model_validator(mode="after")
    def _rows_match(self) -> Self:
        if self.lattice == "triangular" and self.rows % 2:
            raise problem(
                "rows",
                "must be even on a periodic triangular lattice, whose odd rows are shifted by half "
                f"a site (is {self.rows})",
            )
        return self

    @property
    def acts(self) -> bool:
        """Whether neighbours exert forces; without, contacts only have sites."""
        return self.strength > 0

    @property
    def sites(self) -> tuple[Array, Array]:
        """Sites of the contacts in units of their distance, each of shape (rows, columns)."""
        row, column = np.indices((self.rows, self.columns), dtype=float)
        if self.lattice == "square":
            return column, row
        return column + 0.5 * (row % 2), row * np.sqrt(0.75)

    @property
    def neighbours(self) -> int:
        """Number of neighbours of a contact."""
        return NEIGHBOURS[self.lattice]

    def bond_stiffness(self, contacts: Contacts) -> float:
        """Stiffness of the bond between neighbours, G = 3 xi f_s/a [N/m]; 0 without an area."""
        if contacts.area is None:
            return 0.0
        spacing = math.sqrt(contacts.area / contacts.count)
        return 3 * self.strength * contacts.contact_static_force / spacing

    def problems(self, contacts: Contacts) -> Complaints:
        """Conflicts between the lattice and its contacts."""
        sites = self.columns * self.rows
        if sites != contacts.count:
            yield Complaint(
                "interaction.columns",
                f"times rows must be contacts.count: {self.columns} x {self.rows} = "
                f"{sites}, not {contacts.count}",
                self.columns,
            )
        if contacts.area is None:
            yield Complaint(
                "contacts.area", "needed for the distance between neighbours, a = (A/N)^(1/2)"
            )
        relative = self.neighbours * self.bond_stiffness(contacts) / contacts.contact_stiffness
        if relative > MAX_BOND_RATIO:
            max_strength = self.strength * (MAX_BOND_RATIO / relative)
            yield Complaint(
                "interaction.strength",
                f"must be at most {max_strength:.3g}: the force at which a contact attaches is a "
                f"difference of forces {relative:.1g} times as large, which double precision does "
                "not resolve",
                self.strength,
            )
