"""Variables of an output, by group: units, long names, types."""

from __future__ import annotations

import math
from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from mesoslip.array_types import Dataset, Variable
from mesoslip.simulation import fronts


@dataclass(frozen=True)
class Meaning:
    """Unit and long name (as in CF), type, and further attributes of a variable.

    A fractional one is an integer of contacts one by one, and a real number in the master equation.
    A regular one has nearly equidistant values, which compress well.
    """

    units: str
    long_name: str
    dtype: DTypeLike = np.float64
    is_fractional: bool = False
    is_regular: bool = False
    further: Mapping[str, str] = field(default_factory=dict)

    @property
    def attributes(self) -> dict[str, Any]:
        found: dict[str, Any] = {"units": self.units, "long_name": self.long_name, **self.further}
        if "flag_meanings" in self.further:
            count = len(self.further["flag_meanings"].split())
            found["flag_values"] = np.arange(count, dtype=np.int8)
        return found


class Estimate(Meaning):
    """A variable with a standard error, which a `Group` adds as a variable of its own."""


def _flags(long_name: str, meanings: str) -> Meaning:
    """A variable of small integers with words as their meanings, as in CF."""
    return Meaning("1", long_name, np.int8, further={"flag_meanings": meanings})


class Group(dict[str, Meaning]):
    """The variables that a group of an output may have."""

    def __init__(self, base: Mapping[str, Meaning] | None = None, /, **meanings: Meaning) -> None:
        super().__init__()
        for name, meaning in {**(base or {}), **meanings}.items():
            self[name] = meaning
            if isinstance(meaning, Estimate):
                label = f"standard error of the {name.replace('_', ' ')}"
                self[f"{name}_error"] = Meaning(meaning.units, label)

    def subset(self, *names: str) -> Group:
        """Some of the variables, in this order."""
        return Group({name: self[name] for name in names})

    def variable(self, name: str, dimensions: Sequence[str], values: Any) -> Variable:
        """A variable of the group with its units and long name."""
        import xarray as xr

        return xr.Variable(dimensions, values, self[name].attributes)

    def dataset(
        self,
        dimensions: Sequence[str],
        columns: Mapping[str, Any],
        force_unit: str = "N",
        attrs: Mapping[str, Any] | None = None,
    ) -> Dataset:
        """Variables of the group along the same dimensions."""
        import xarray as xr

        data = {name: self.variable(name, dimensions, one) for name, one in columns.items()}
        for name, unit in self.units(force_unit).items():
            if name in data:
                data[name].attrs["units"] = unit
        return xr.Dataset(data, attrs=attrs)

    def units(self, force_unit: str = "N") -> dict[str, str]:
        """CF units of the variables; see `with_force_unit`."""
        return {name: with_force_unit(one.units, force_unit) for name, one in self.items()}

    def columns(self, rows: Sequence[Mapping[str, Any]]) -> dict[str, NDArray[Any]]:
        """Columns of rows; NaN for unknown values."""
        return {
            name: np.array([one.get(name, math.nan) for one in rows], dtype=meaning.dtype)
            for name, meaning in self.items()
        }

    @property
    def empty_row(self) -> dict[str, Any]:
        return {
            name: math.nan if one.dtype is np.float64 else "" if one.dtype is np.str_ else 0
            for name, one in self.items()
        }


def with_force_unit(unit: str, force_unit: str) -> str:
    """A unit with that of a force in newtons, in CF or for print; of friction coefficients if the
    force unit is "1"."""
    if force_unit != "1":
        return unit
    if unit == "J":
        return "m"
    first, _, others = unit.partition(" ")
    if first == "N":
        return others or "1"
    return f"1/{unit[2:]}" if unit.startswith("N/") else unit


# Rows of a catalogue have the index of their realization, as in CF's indexed ragged arrays.
REALIZATION_INDEX = Meaning(
    "1",
    "index of the row's realization along the dimension realization, from 0",
    np.int64,
    further={"instance_dimension": "realization"},
)

TRACE = Group(
    drive_displacement=Meaning("m", "displacement of the drive", is_regular=True),
    displacement=Meaning("m", "displacement of the slider"),
    velocity=Meaning("m s-1", "velocity of the slider"),
    spring_force=Meaning("N", "force of the drive on the slider"),
    contact_force=Meaning("N", "force of the slider on the contacts"),
    detached_contacts=Meaning("1", "number of detached contacts", np.int32, is_fractional=True),
    elastic_force=Meaning("N", "mean elastic force in the slider, K (X_d - X_1)"),
    base_displacement=Meaning("m", "displacement of the base"),
)

# Variables of runs with a load and of measured traces.
LOADED = Group(
    friction_coefficient=Meaning("1", "friction coefficient"),
    normal_force=Meaning("N", "normal force"),
)

# The force of a measured trace is the spring force, or the friction coefficient if the normal force
# is not known.
MEASURED = Group(
    LOADED,
    normal_stress=Meaning("Pa", "normal stress"),
    revolutions=Meaning("1", "number of revolutions of the disc"),
    rotation_speed=Meaning("s-1", "revolutions of the disc per time"),
    sliding_speed=Meaning("m s-1", "speed of sliding"),
    viscosity=Meaning("Pa s", "viscosity of the lubricant"),
    acoustic_emission=Meaning("V", "acoustic emission, or another second channel"),
)
# Variables with the force of a run or of a measured trace, and their units.
FORCES = {"spring_force": "N", "friction_coefficient": "1"}


def has_force(names: Container[Any]) -> bool:
    """Whether variables are those of a run or of a measured trace."""
    return any(one in names for one in FORCES)


def force_among(names: Container[Any]) -> str:
    """The force at the drive, or the friction coefficient of a measured trace without forces."""
    return "spring_force" if "spring_force" in names else "friction_coefficient"


ROOT = Group(
    TRACE,
    **MEASURED,
    realization=Meaning("1", "number of the realization", np.int64),
    time=Meaning("s", "time", is_regular=True),
    layer=Meaning("1", "number of the layer, 1 at the contacts", np.int64),
    layer_displacement=Meaning("m", "displacement of a layer"),
    breaks=Meaning("1", "breaks of contacts in the run", np.int64, is_fractional=True),
    force_error=Meaning(
        "N",
        "estimated error of the contact force, before the first slip if there is one",
    ),
    slip_time_error=Meaning(
        "s", "estimated error of the time at which a slip starts, maximum over all slips"
    ),
    resolution=Meaning("1", "resolution of the master equation"),
    energy_residual=Meaning(
        "1", "residual of the energy balance over the work of the drive, forth and back"
    ),
    kernel_seconds=Meaning("s", "computing time of the kernel"),
    avalanche_count=Meaning("1", "number of avalanches in the run", np.int64),
    avalanche_slip=Meaning(
        "m", "displacement of the slider in avalanches, during which the drive stands still"
    ),
    end_displacement=Meaning("m", "displacement of the slider at the end of the run"),
)

SLIPS = Group(
    realization_index=REALIZATION_INDEX,
    start_time=Meaning("s", "time of the maximum spring force before the slip"),
    end_time=Meaning("s", "time of the minimum spring force after the slip"),
    force_before=Meaning("N", "spring force at the start of the slip"),
    force_after=Meaning("N", "spring force at the end of the slip"),
    force_drop=Meaning("N", "drop of the spring force in the slip"),
    peak_velocity=Meaning("m s-1", "maximum velocity of the slider in the slip"),
    contacts_broken=Meaning(
        "1",
        "breaks in the slip; a contact that attaches again may break again",
        np.int64,
        is_fractional=True,
    ),
)

# Slips of runs with a load.
LOADED_SLIPS = Group(
    SLIPS,
    normal_force=Meaning("N", "normal force at the start of the slip"),
    friction_coefficient=Meaning("1", "friction coefficient at the start of the slip"),
)

MEASURED_SLIPS = Group(
    SLIPS,
    peak_fall_rate=Meaning("N s-1", "maximum rate at which the spring force fell in the slip"),
)

# Noise of a measured trace; forces are friction coefficients if the trace has only these.
NOISE = Group(
    deviation=Meaning("N", "standard deviation of the white noise"),
    correlated_deviation=Meaning("N", "standard deviation of correlated noise, 0 for none"),
    correlation_time=Meaning("s", "time in which the autocorrelation of that noise decays"),
    digital_step=Meaning("N", "digital step of the force, 0 for none"),
    impulse_share=Meaning("1", "share of the samples that are in impulses"),
    impulse_size=Meaning("N", "median size of impulses, 0 for none"),
    drift=Meaning("N s-1", "slow drift of the force, 0 for none"),
    impulse_time=Meaning("s", "time of a sample in an impulse"),
    hum_frequency=Meaning("s-1", "frequency of a line of hum"),
    hum_amplitude=Meaning("N", "amplitude of a line of hum"),
)

SLIP_COUNTS = Group(
    min_fall=Meaning("N", "minimum fall of the force in a slip"),
    slip_count=Meaning("1", "number of slips with that minimum fall", np.int64),
    mirrored_count=Meaning(
        "1", "steep falls of the trace mirrored in its loading, as many as noise makes", np.int64
    ),
)

STAGES = Group(
    realization_index=REALIZATION_INDEX,
    stage_number=Meaning("1", "number of the stage of the drive, from 0", np.int64),
    stage_start_time=Meaning("s", "start of the stage"),
    stage_end_time=Meaning("s", "end of the stage"),
    drive_start_velocity=Meaning("m s-1", "velocity of the drive at the start of the stage"),
    drive_end_velocity=Meaning("m s-1", "velocity of the drive at the end of the stage"),
    start_force=Meaning("N", "spring force at the start of the stage"),
    end_force=Meaning("N", "spring force at the end of the stage"),
    start_displacement=Meaning("m", "displacement of the slider at the start of the stage"),
    end_displacement=Meaning("m", "displacement of the slider at the end of the stage"),
    drive_start_displacement=Meaning("m", "displacement of the drive at the start of the stage"),
    max_force=Meaning("N", "maximum spring force in the stage"),
    max_force_time=Meaning("s", "time of the maximum spring force"),
    max_force_displacement=Meaning("m", "displacement of the slider at the maximum spring force"),
    min_force=Meaning("N", "minimum spring force in the stage"),
    min_force_time=Meaning("s", "time of the minimum spring force"),
    min_force_displacement=Meaning("m", "displacement of the slider at the minimum spring force"),
    mean_force=Meaning("N", "mean of the spring force over the time of the stage"),
)

# Stages found in a measured load point.
MEASURED_STAGES = Group(
    STAGES.subset(
        *("realization_index", "stage_number", "stage_start_time", "stage_end_time"),
        *("drive_start_velocity", "drive_end_velocity"),
    ),
    drive_velocity_error=Meaning("m s-1", "standard error of the mean velocity of the stage"),
)

SLIP_TRACES = Group(
    TRACE,
    **LOADED,
    realization_index=REALIZATION_INDEX,
    slip=Meaning("1", "number of the slip within its realization, from 0", np.int32),
    sample_time=Meaning("s", "time of the sample", is_regular=True),
)

AVALANCHES = Group(
    realization_index=REALIZATION_INDEX,
    start_time=Meaning("s", "time at which the first contact broke"),
    displacement=Meaning("m", "displacement of the slider at which the first contact broke"),
    size=Meaning("1", "breaks of contacts in the avalanche", np.int64),
    force_before=Meaning("N", "force of the pinned contacts before the avalanche, without drag"),
    force_drop=Meaning("N", "drop of the force of the pinned contacts in the avalanche"),
    slip=Meaning("m", "displacement of the slider in the avalanche"),
    area=Meaning("1", "contacts that broke in the avalanche, each counted once", np.int64),
    width=Meaning("1", "columns of the smallest rectangle around the avalanche", np.int64),
    height=Meaning("1", "rows of the smallest rectangle around the avalanche", np.int64),
    generations=Meaning("1", "steps in which contacts of the avalanche triggered others", np.int64),
    spans=Meaning(
        "1", "whether the avalanche breaks contacts in every column or every row", np.int8
    ),
)

BLOCKS = Group(
    block=Meaning("1", "number of the block, 1 at the edge", np.int64),
    position=Meaning("m", "position of the middle of the block along the interface"),
    block_displacement=Meaning("m", "displacement of the block"),
    block_velocity=Meaning("m s-1", "velocity of the block"),
    block_contact_force=Meaning("N", "force of the block on its contacts"),
    block_detached_contacts=Meaning(
        "1", "number of detached contacts of the block", np.int32, is_fractional=True
    ),
    block_normal_force=Meaning("N", "normal force on the block"),
)

RUPTURES = Group(
    realization_index=REALIZATION_INDEX,
    block_number=Meaning("1", "number of the block, 1 at the edge", np.int64),
    start_time=Meaning(
        "s", "time at which the block got faster than the slip velocity, or ruptured before"
    ),
    rupture_time=Meaning(
        "s", "time at which half of the contacts that were pinned before the slip had broken"
    ),
    end_time=Meaning(
        "s", "last time at which the block was faster than the slip velocity, or ruptured after it"
    ),
    force_before=Meaning("N", "force of the block on its contacts just before the slip"),
    force_after=Meaning("N", "force of the block on its contacts at the end"),
    slip=Meaning("m", "displacement of the block in its slip"),
    peak_velocity=Meaning("m s-1", "maximum velocity of the block relative to the drive"),
    breaks=Meaning("1", "breaks of contacts of the block", np.int64, is_fractional=True),
)

FRONTS = Group(
    realization_index=REALIZATION_INDEX,
    event=Meaning("1", "number of the event within its realization, from 0", np.int64),
    start_time=Meaning("s", "time of the first rupture of a block in the front"),
    end_time=Meaning("s", "time of the last rupture of a block in the front"),
    start_position=Meaning("m", "position at which the front started"),
    end_position=Meaning("m", "position at which the front ended"),
    length=Meaning("m", "length of the interface that the front detached"),
    speed=Meaning(
        "m s-1", "speed of the front, negative towards the edge; missing if it is not resolved"
    ),
    force_drop=Meaning("N", "drop of the force on the contacts of its blocks"),
    kind=_flags("whether its event reached both ends", " ".join(fronts.KINDS)),
    passage=Meaning(
        "1",
        "passage over its blocks in the event, 0 where they rupture for the first time",
        np.int64,
    ),
    arrest=_flags("where the front ended", " ".join(fronts.ARRESTS)),
    stress_ratio_before=Meaning(
        "1", "force on the contacts just before the slips of its blocks over their static force"
    ),
)

SNAPSHOTS = Group(
    realization_index=REALIZATION_INDEX,
    snapshot_time=Meaning("s", "time of the snapshot"),
    displacement=Meaning("m", "displacement of the slider"),
    avalanche_size=Meaning(
        "1", "breaks in the avalanche before the snapshot, 0 at a chosen time", np.int64
    ),
    stretch=Meaning("m", "stretch of the contact, missing if it is detached"),
    load=Meaning("1", "force that breaks the contact over its threshold"),
    pinned=Meaning("1", "whether the contact is pinned", np.int8),
    contact=Meaning("1", "number of the contact", np.int64),
    generation=Meaning(
        "1", "step of the avalanche in which the contact broke, 0 if it did not", np.int32
    ),
    x=Meaning("m", "position of the contact along a row"),
    y=Meaning("m", "position of the contact across the rows"),
)

ENERGY = Group(
    drive_work=Meaning("J", "work done by the drive"),
    slider_energy=Meaning("J", "energy of the slider and its spring at the end"),
    contact_energy=Meaning("J", "elastic energy of the contacts at the end"),
    damping_loss=Meaning("J", "energy lost to the damping of the setup"),
    drag_loss=Meaning("J", "energy lost to the drag of detached contacts"),
    break_loss=Meaning("J", "elastic energy lost by breaking contacts"),
    birth_gain=Meaning("J", "elastic energy of contacts at their attaching"),
    step_work=Meaning(
        "J", "work on the contact force in steps beyond that on the contacts: the error of steps"
    ),
    separation_loss=Meaning(
        "J", "elastic energy lost by contacts that separate as the normal load falls"
    ),
)

CURVE = Group(
    displacement=Meaning("m", "displacement of the slider"),
    contact_force=Meaning("N", "force of the slider on the contacts"),
    slope=Meaning("N m-1", "derivative of the contact force by the displacement"),
    contact_stiffness=Meaning("N m-1", "stiffness of the pinned contacts"),
    break_rate=Meaning("m-1", "breaks of a contact over displacement"),
    potential=Meaning("J", "effective potential of the slider"),
)

CRITICAL = Group(
    critical_displacement=Meaning("m", "displacement of the slider where F' = -K"),
    contact_force=Meaning("N", "force of the slider on the contacts"),
    curvature=Meaning("N m-2", "second derivative of the contact force by the displacement"),
    third_derivative=Meaning("N m-3", "third derivative of the contact force by the displacement"),
    D0=Meaning("1", "contact force at the onset of slip over the static force"),
    D2=Meaning("1", "second-order coefficient of the onset of slip, Eq. S46"),
    D3=Meaning("1", "third-order coefficient of the onset of slip, Eq. S46"),
)

STRETCHES = Group(
    density_displacement=Meaning("m", "displacement of the slider"),
    stretch=Meaning("m", "stretch of a contact"),
    stretch_density=Meaning(
        "m-1", "density of stretches, without contacts that have not broken yet"
    ),
    unbroken_part=Meaning("1", "part of the contacts that bear the stretch of a relaxed start"),
)

LYAPUNOV = Group(
    distance=Meaning(
        "1", "distance of the twin, in units of F_s and of the slip velocity, less a time shift"
    ),
    growth_time=Meaning("s", "time since the start of the twin"),
    start=Meaning("s", "time at which the twin starts"),
    twin_exponent=Meaning("1/s", "rate at which the distance of the twin grows while it is small"),
    lyapunov_exponent=Meaning("1/s", "largest Lyapunov exponent"),
    lyapunov_error=Meaning("1/s", "standard error of the largest Lyapunov exponent"),
    min_distance=Meaning("1", "distance from which growth is fitted"),
    max_distance=Meaning("1", "distance up to which growth is fitted"),
    peak_force=Meaning("N", "spring force at the start of a slip"),
    waiting_time=Meaning("s", "time since the start of the slip before"),
)


ONSET = Group(
    onset_time=Meaning("1", "time since the onset of slip times the setup frequency"),
    onset_displacement=Meaning(
        "1", "displacement since the onset times the spring over static force"
    ),
    onset_velocity=Meaning("1", "derivative of the displacement since the onset by the time"),
    onset_mean_velocity=Meaning("1", "running mean of that velocity"),
    relative_force_drop=Meaning(
        "1", "change of the spring force since the onset over static force"
    ),
    asymptote=Meaning("1", "change of the spring force at short times over static force"),
)

CYCLE = Group(
    duration=Meaning("s", "time from a passage of the section to the next"),
    peak_force=Meaning("N", "maximum of the spring force between two passages"),
    low_force=Meaning("N", "minimum of the spring force between two passages"),
    multiplier_real=Meaning("1", "real part of the multipliers of the cycle"),
    multiplier_imaginary=Meaning("1", "imaginary part of the multipliers of the cycle"),
)

MOTIONS = "smooth periodic irregular"

BRANCHES = Group(
    amplitude=Meaning("N", "maximum less minimum of the spring force in the settled motion"),
    amplitude_ratio=Meaning("1", "amplitude over the static force"),
    spread=Meaning(
        "1", "variation of periods, maxima and minima between passages, the largest one"
    ),
    period=Meaning("s", "period, or mean time between passages of an irregular motion"),
    peak_force=Meaning("N", "maximum of the spring force"),
    low_force=Meaning("N", "minimum of the spring force"),
    multiplier=Meaning("1", "modulus of the leading multiplier of the cycle"),
    motion=_flags("settled motion", MOTIONS),
    multiple=Meaning("1", "passages of the section in a cycle", np.int8),
    steady_force=Meaning("N", "force of steady sliding"),
    growth_rate=Meaning("s-1", "growth rate of small perturbations of steady sliding"),
    end_value=Meaning("1", "last value with an oscillation that ends in smooth sliding"),
    end_beyond=Meaning("1", "first value without it"),
    end_amplitude_ratio=Meaning("1", "amplitude at the last value over the static force"),
    end_direction=_flags("direction of the values", "up down"),
    end_motion=_flags("motion at the last value", MOTIONS),
)

STEADY = Group(
    velocity=Meaning("m s-1", "velocity of steady sliding"),
    steady_force=Meaning("N", "force of steady sliding"),
    steady_slope=Meaning("N", "derivative of the force by the logarithm of the velocity"),
    critical_stiffness=Meaning(
        "N m-1", "stiffness of the spring above which sliding is linearly stable; 0: with any"
    ),
)

TRACK_RESPONSE = Group(
    wavenumber=Meaning("m-1", "wavenumber of the strength along the track"),
    response=Meaning("N", "modulus of the response of the force to the relative strength"),
    phase=Meaning("rad", "phase of that response"),
    strength_spectrum=Meaning("m", "spectral density of the strength along the track over w^2"),
    force_spectrum=Meaning("N2 m", "spectral density of the force along the track"),
)

CYCLE_TRACE = Group(
    time=Meaning("s", "time since the first passage of the section"),
    **TRACE.subset(
        *("spring_force", "contact_force", "velocity", "drive_displacement", "displacement"),
        "detached_contacts",
    ),
)
