"""The table [contacts]."""

from __future__ import annotations

import math
from typing import Annotated, Self

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field, StrictBool, model_validator

from mesoslip.array_types import Array
from mesoslip.configuration.contacts.tables.ageing import Ageing
from mesoslip.configuration.contacts.tables.thermal import Thermal
from mesoslip.configuration.contacts.tables.threshold import Threshold
from mesoslip.configuration.contacts.tables.track import Track
from mesoslip.configuration.table import (
    Area,
    Density,
    Drag,
    Force,
    Length,
    Number,
    Rate,
    Stiffness,
    Table,
    Time,
    Whole,
    choice,
    problem,
)
from mesoslip.errors import ConfigError
from mesoslip.quantities import with_unit

# Choices, by the names that the kernels use.
COUPLINGS = ("scaled", "equal", "table")
DELAY_LAWS = ("fixed", "exponential")
RENEWALS = ("redraw", "keep")
INITIAL_STATES = ("relaxed", "steady", "uniform")

# Minimum fraction of thresholds above the back force; with less, drawing them takes too long.
MIN_ACCEPTED = 0.5

# Minimum factor of thresholds on a track, and probability of a threshold that can attach anywhere
# on it.
MIN_STRENGTH, STRONG_PART = 0.05, 0.01
# Part of a track with the minimum factor of which there is a message.
MIN_CUT_SHARE = 1e-4
# Change of the mean threshold by those that are drawn again of which there is a message.
MIN_SHIFT = 0.02
# Minimum correlation length of a track over the mean breaking stretch: the contacts of a slider
# attached along a breaking stretch, over which shorter variations average out.
MIN_LENGTH_RATIO = 0.1


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
            raise ConfigError.of("contacts.track", "missing: the strength is the same everywhere")
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
    def cut_thresholds(self) -> str | None:
        """A message if so many thresholds are drawn again that their mean is another one."""
        law = self.threshold.above(self.min_threshold)
        mean = law.accepted_mean
        if self.ageing is not None or abs(mean - 1) < MIN_SHIFT:
            return None
        drawn_again = 1 - self.threshold.probability_above(self.min_threshold)
        return (
            f"{100 * drawn_again:.2g} % of the thresholds are not above the back force and are "
            f"drawn again: the mean of the others is {mean:.3g} f_s, "
            f"{with_unit(mean * self.static_force, 'N', 3)} of all contacts"
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
