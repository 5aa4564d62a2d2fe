"""A settled cycle: its numbers, in words, and as an output."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from mesoslip.cycles.section import Level, Trace
from mesoslip.cycles.settling import MIN_AMPLITUDE
from mesoslip.output.provenance import program_attributes
from mesoslip.output.variables import CYCLE, CYCLE_TRACE
from mesoslip.quantities import with_unit
from mesoslip.simulation.kernel import Words

if TYPE_CHECKING:
    import xarray as xr

    from mesoslip.configuration.config import Config

# Number of passages from which oscillations that end in smooth sliding are mentioned.
MANY_CYCLES = 40

# Units and meanings of printed numbers.
SUMMARY = {
    "period": ("s", "period"),
    "peak_force": ("N", "maximum of the spring force"),
    "low_force": ("N", "minimum of the spring force"),
    "amplitude": ("N", "maximum less minimum"),
    "amplitude_ratio": ("", "amplitude over the static force"),
    "spread": ("", "variation of periods, maxima and minima between passages, the largest one"),
    "slip_share": ("", "part of the time in slips"),
    "peak_velocity": ("m/s", "maximum of the velocity"),
    "multiplier": ("", "factor of changes from cycle to cycle after a disturbance, the modulus"),
    "is_stable": ("", "whether period and peaks return after a disturbance"),
    "smooth_stable": ("", "whether smooth sliding is linearly stable"),
}


@dataclass(frozen=True)
class Cycle:
    """The motion that a configuration settles to, by the master equation.

    Attributes
    ----------
    config
        The configuration, of engine "me".
    motion
        "periodic"; "smooth" sliding; or "irregular", if it does not settle.
    period
        Period [s], over all slips of a cycle; the mean time between slips of an irregular motion;
        NaN for smooth sliding.
    multiple
        Passages of the force through the section in a cycle: 2 after a period doubling.
    peak_force, low_force
        Maximum and minimum of the spring force [N]; for an irregular motion the means of those
        between passages.
    peaks, lows, durations
        Maximum and minimum of the spring force [N] and duration [s] of each passage.
    amplitude
        Maximum minus minimum of the spring force [N]; 0 for smooth sliding.
    spread
        Variation between passages: the largest standard deviation of their periods, over the mean,
        and of their maxima, minima and amplitudes, over the mean amplitude.
    peak_velocity
        Maximum velocity of the slider [m/s].
    slips
        Slips in a cycle, by the criteria of the catalogue of a run.
    slip_share
        Part of the time that is spent in slips.
    multipliers
        Leading multipliers of the cycle, by modulus: factors by which changes of the state grow
        from cycle to cycle, as it returns after a disturbance; the modulus has an error of some
        0.1. Empty if it was not disturbed.
    is_stable
        Whether period and peaks return after a disturbance of the contacts; None if it was not
        disturbed.
    smooth_stable
        Whether smooth sliding is linearly stable; None without a theory.
    followed
        Simulated time [s].
    error
        Estimated relative error of period and peaks by the iteration; NaN if not periodic.
    cycles
        Number of computed passages, with those after disturbances.
    solver
        Method by which the cycle was found.
    state
        State of the kernel at the section, or at the end.
    section
        Levels of the spring force at which the cycle is cut; None without a section.
    """

    config: Config
    motion: str
    period: float
    multiple: int
    peak_force: float
    low_force: float
    peaks: tuple[float, ...]
    lows: tuple[float, ...]
    durations: tuple[float, ...]
    amplitude: float
    spread: float
    peak_velocity: float
    slips: int
    slip_share: float
    multipliers: tuple[complex, ...]
    is_stable: bool | None
    smooth_stable: bool | None
    followed: float
    error: float
    cycles: int
    solver: str
    state: Words = field(repr=False)
    section: Level | None = field(repr=False)
    _trace: Trace = field(repr=False)
    coarse_cycles: int = 0
    """Number of passages computed before at a coarse resolution, from whose end the motion starts.
    It is decided there that a motion is irregular, and confirmed in ``cycles`` passages."""
    is_continued: bool = False
    """Whether it started from the state of an earlier cycle."""

    @property
    def amplitude_ratio(self) -> float:
        """Amplitude over the static force F_s."""
        return self.amplitude / self.config.contacts.static_force

    @property
    def exists(self) -> bool:
        """Whether the motion oscillates."""
        return self.motion != "smooth"

    def trace(self) -> xr.Dataset:
        """Samples of one cycle over the time from the section, or of the last passages of an
        irregular motion: forces, velocity, displacements, detached contacts."""
        import xarray as xr

        samples = self._trace
        time = samples["time"] - (samples["time"][0] if len(samples) else 0.0)
        return xr.Dataset(
            {
                name: CYCLE_TRACE.variable(name, ("time",), samples[name].copy())
                for name in CYCLE_TRACE
                if name != "time"
            },
            coords={"time": CYCLE_TRACE.variable("time", ("time",), time)},
        )

    def to_tree(self) -> xr.DataTree:
        """The cycle as an output: passages and multipliers; groups ``trace`` and ``state``."""
        import xarray as xr

        leading = np.array(self.multipliers, dtype=complex)
        columns = {
            "duration": ("passage", np.array(self.durations)),
            "peak_force": ("passage", np.array(self.peaks)),
            "low_force": ("passage", np.array(self.lows)),
            "multiplier_real": ("multiplier", leading.real),
            "multiplier_imaginary": ("multiplier", leading.imag),
        }
        attributes = program_attributes(self.config, "cycle")
        summary = self.summary()
        attributes["settled_motion"] = summary.pop("motion")
        for name, value in summary.items():
            if value is not None:
                attributes[name] = str(value).lower() if isinstance(value, bool) else value
        attributes["comment"] = self.verdict
        if self.is_continued:
            attributes["continued"] = "true"
        if self.section is not None:
            attributes["section_force"] = self.section.force
            attributes["section_reset"] = self.section.reset
        variables = {
            name: CYCLE.variable(name, (dimension,), values)
            for name, (dimension, values) in columns.items()
        }
        words = (("word",), self.state, {"long_name": "state at the section"})
        return xr.DataTree(
            xr.Dataset(variables, attrs=attributes),
            children={
                "trace": xr.DataTree(self.trace()),
                "state": xr.DataTree(xr.Dataset({"words": words})),
            },
        )

    def summary(self) -> dict[str, Any]:
        """Numbers of the cycle in SI, by name."""
        leading = self.multipliers[0] if self.multipliers else complex(math.nan, math.nan)
        first = (
            *("motion", "period", "multiple", "peak_force", "low_force", "amplitude"),
            *("amplitude_ratio", "spread", "slips", "slip_share", "peak_velocity"),
        )
        last = ("is_stable", "smooth_stable", "followed", "error", "cycles", "solver")
        return {
            **{name: getattr(self, name) for name in first},
            "multiplier": abs(leading),
            "multiplier_real": leading.real,
            "multiplier_imaginary": leading.imag,
            **{name: getattr(self, name) for name in last},
        }

    @property
    def verdict(self) -> str:
        """Possible motions, in words."""
        smooth = {
            True: "smooth sliding is linearly stable",
            False: "smooth sliding is linearly unstable",
            None: "linear theory does not say whether smooth sliding is stable",
        }[self.smooth_stable]
        duration = with_unit(self.followed, "s", 2)
        if self.motion == "smooth":
            if self.smooth_stable is False:
                limit = f"{100 * MIN_AMPLITUDE:g} % of F_s"
                return f"from this start no oscillation above {limit} is found; {smooth}"
            before = ""
            if self.cycles > MANY_CYCLES:
                before = f" after oscillations of {self.cycles} passages or more in {duration}"
            return f"from this start the motion settles to smooth sliding{before}; {smooth}"
        percent = f"{100 * self.amplitude_ratio:.3g} % of F_s"
        if self.motion == "irregular":
            oscillation = (
                f"the motion stays irregular for {duration}, with a mean amplitude of {percent}"
            )
            if self.coarse_cycles:
                oscillation += (
                    f" ({self.coarse_cycles} passages with long steps, confirmed in {self.cycles} "
                    f"at resolution {self.config.run.resolution:g})"
                )
        else:
            passages = f" of {self.multiple} passages" if self.multiple > 1 else ""
            oscillation = f"the motion settles to a cycle{passages} with an amplitude of {percent}"
            if self.coarse_cycles:
                oscillation += f", after {self.coarse_cycles} passages with long steps"
        if self.is_stable is False:
            oscillation += "; a disturbance of the contacts leads away from it"
        both = "; both motions are possible" if self.smooth_stable else ""
        if both and self.motion == "irregular":
            both += ", the irregular one perhaps for a limited time"
        return f"from this start {oscillation}; {smooth}{both}"
