"""The table [contacts.threshold]: the law of the thresholds."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import Field, model_validator

from mesoslip.configuration.kernel_parameters import Parameters
from mesoslip.configuration.table import Number, Table, Text, choice, problem
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
from mesoslip.errors import FileError

SAMPLE_KEYS = ("samples", "weights", "stiffnesses")


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
