"""The controls of the page: keys of the configuration, with ranges and choices."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from mesoslip.configuration.config import Config
from mesoslip.configuration.contacts.tables.contacts import COUPLINGS, INITIAL_STATES, RENEWALS
from mesoslip.configuration.contacts.tables.interaction import LATTICES
from mesoslip.configuration.contacts.tables.thermal import BOLTZMANN
from mesoslip.configuration.contacts.tables.track import CORRELATIONS
from mesoslip.configuration.differences import flat
from mesoslip.configuration.keys import key_kind, meaning
from mesoslip.configuration.sliders import SLIDERS
from mesoslip.configuration.sliders.interface import LOADINGS
from mesoslip.configuration.threshold_laws import LAWS
from mesoslip.quantities import with_unit

# Positions of a slider on the page.
STEPS = 200
# Name of the choice that omits a table.
NONE = "none"
# Headings on the page of the keys of tables.
GROUPS = {
    "drive": "Drive and run",
    "run": "Drive and run",
    "slider": "Slider",
    "contacts": "Contacts",
    "contacts.threshold": "Thresholds",
    "contacts.ageing": "Ageing",
    "contacts.thermal": "Temperature",
    "contacts.track": "Track",
    "load": "Normal load",
    "interaction": "Interaction",
}
# Threshold laws that need no more than a width.
WIDTH_LAWS = tuple(name for name, law in LAWS.items() if not law.is_sampled)
# Couplings that need no table of stiffnesses.
RULES = tuple(name for name in COUPLINGS if name != "table")


@dataclass(frozen=True)
class Control:
    """A key with a control on the page; values are in SI."""

    key: str
    label: str
    decades: float = 0.0
    """Range to each side of the value at the start, in powers of ten; 0 for a linear range."""
    range: tuple[float, float] = (0.0, math.inf)
    """Ends of a linear range, or bounds of a logarithmic one."""
    usual: float = 1.0
    """Center of a logarithmic range if the value at the start is zero."""
    choices: tuple[str, ...] = ()
    choice_labels: Mapping[str, str] = field(default_factory=dict)
    """Names of choices on the page, if other than in a file."""
    required: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    """Keys that a choice requires, with their default values."""
    is_text: bool = False
    """Whether it is a list, which is written in words."""
    is_switch: bool = False
    """Whether it is a table, of which a choice gives the keys."""
    own_meaning: str = ""
    """The meaning of the key here, if other than in the reference of keys."""

    @property
    def meaning(self) -> str:
        return self.own_meaning or meaning(self.key)

    @property
    def group(self) -> str:
        """Heading of the table of the key."""
        tables = [table for table in GROUPS if f"{self.key}.".startswith(f"{table}.")]
        return GROUPS[max(tables, key=len)]

    @property
    def unit(self) -> str:
        """The SI unit; "1" for plain numbers."""
        kind = key_kind(self.key)
        return kind.unit if kind is not None and kind.unit else "1"

    @property
    def is_whole(self) -> bool:
        """Whether values are whole numbers."""
        kind = key_kind(self.key)
        return kind is not None and kind.is_whole

    def scale(self, start: object) -> Scale:
        """The scale of its slider, given the value at the start; a `TypeError` if it has none."""
        if self.choices or self.is_text:
            raise TypeError(f"{self.key} has no range")
        given = float(start) if isinstance(start, int | float) and start else self.usual
        low, high = self.range
        if self.decades:
            factor = 10**self.decades
            low, high = max(low, given / factor), min(high, given * factor)
        # The value in the file is always in the range.
        return Scale(min(low, given), max(high, given), bool(self.decades), self.is_whole)

    def text(self, value: float) -> str:
        """A value in SI as text, such as "0.5 ms"."""
        if self.is_whole:
            return str(round(value))
        return with_unit(value, self.unit, 3)


@dataclass(frozen=True)
class Scale:
    """Values at the positions 0 to `STEPS` of a slider on the page."""

    low: float
    high: float
    is_logarithmic: bool
    is_whole: bool

    def value(self, position: float) -> float:
        part = min(max(position / STEPS, 0.0), 1.0)
        if part == 1:
            value = self.high
        elif self.is_logarithmic:
            value = self.low * (self.high / self.low) ** part
        else:
            value = self.low + part * (self.high - self.low)
        return float(round(value)) if self.is_whole else value

    def position(self, value: float) -> int:
        """The position nearest to a value; the nearer end for values out of range."""
        if self.high <= self.low:
            return 0
        value = min(max(value, self.low), self.high)
        if self.is_logarithmic:
            part = math.log(value / self.low) / math.log(self.high / self.low)
        else:
            part = (value - self.low) / (self.high - self.low)
        return round(STEPS * part)


# Keys that the size of a lattice determines, or that determine it.
LATTICE_SIZE = ("interaction.columns", "interaction.rows", "contacts.count")
# Height of a row of a lattice over the distance of its columns.
ROW_HEIGHTS = {"triangular": math.sqrt(0.75), "square": 1.0}
# Maximum ratio of the sides of a lattice that keeps N, and of one that changes it.
MAX_RATIO_KEPT, MAX_RATIO = 2.0, 1.2


def lattice_size(count: int, lattice: str) -> tuple[int, int]:
    """Columns and rows of a lattice of N contacts whose sides differ by a factor of 2 at most, or
    else of nearly N, nearly square."""
    height = ROW_HEIGHTS[lattice]
    step = 2 if lattice == "triangular" else 1

    def ratio(columns: int, rows: int) -> float:
        return abs(math.log(columns / (rows * height)))

    middle = math.sqrt(count / height)
    all_rows = [one for one in range(2, int(2 * middle) + 4) if one % step == 0]
    pairs = [(count // rows, rows) for rows in all_rows if count % rows == 0 and count // rows > 1]
    kept = [one for one in pairs if ratio(*one) <= math.log(MAX_RATIO_KEPT)]
    if kept:
        return min(kept, key=lambda pair: (round(ratio(*pair), 9), pair[0]))
    others = [(max(2, round(count / rows)), rows) for rows in all_rows]
    nearly = [one for one in others if ratio(*one) <= math.log(MAX_RATIO)] or others
    return min(nearly, key=lambda pair: (abs(pair[0] * pair[1] - count), ratio(*pair)))


# Amplitude of strokes over the distance that loads contacts and spring, and their speed where the
# drive has none [m/s].
STROKES_OVER_LOADING = 2.0
USUAL_SPEED = 1e-7
# Activation of contacts that are switched to it: f_T/f_s at a temperature [K].
ACTIVATION_RATIO = 0.04
ROOM_TEMPERATURE = 300.0


def derived_value(key: str, config: Config) -> str:
    """Value of a key that a switch needs and that follows from the others."""
    if key == "contacts.track.length":
        return f"{config.contacts.break_stretch}"
    if key.startswith("drive."):
        return _of_strokes(key, config)
    if key.startswith("slider."):
        return with_unit(config.spring_stiffness, "N/m", 4)
    return activation_length(config)


def _of_strokes(key: str, config: Config) -> str:
    """Speed of the drive, and an amplitude with which contacts break in each stroke."""
    if key != "drive.cycle.amplitude":
        return with_unit(config.drive_speed or USUAL_SPEED, "m/s", 4)
    loading = config.contacts.break_stretch + config.contacts.static_force / config.spring_stiffness
    return with_unit(STROKES_OVER_LOADING * loading, "m", 2)


def activation_length(config: Config) -> str:
    """The activation length with which f_T/f_s is `ACTIVATION_RATIO` at room temperature."""
    force = ACTIVATION_RATIO * config.contacts.contact_static_force
    return with_unit(BOLTZMANN * ROOM_TEMPERATURE / force, "m", 2)


CONTROLS = (
    Control("drive.velocity", "drive velocity", 3),
    Control("drive.stage", "stages of the drive", is_text=True),
    Control(
        "drive.cycle",
        "direction",
        choices=(NONE, "amplitude"),
        choice_labels={NONE: "one, or that of stages", "amplitude": "strokes, back and forth"},
        # Amplitude and speed follow from the other keys, see `derived_value`.
        required={
            NONE: {"drive.velocity": ""},
            "amplitude": {
                "drive.velocity": NONE,
                "drive.stage": NONE,
                "drive.cycle.amplitude": "",
                "drive.cycle.velocity": "",
                "drive.cycle.cycles": "3",
            },
        },
        is_switch=True,
        own_meaning="Strokes between plus and minus an amplitude, instead of one velocity.",
    ),
    Control("drive.cycle.amplitude", "amplitude of the strokes", 1.5, usual=4e-7),
    Control("drive.cycle.velocity", "speed of the strokes", 3, usual=USUAL_SPEED),
    Control("drive.cycle.frequency", "frequency of the strokes", 2, usual=0.1),
    Control("drive.cycle.cycles", "cycles", range=(1, 50)),
    Control("run.duration", "duration", 1),
    Control("run.drive_displacement", "displacement of the drive", 1, usual=1e-6),
    Control("run.seed", "seed", range=(1, 100)),
    Control(
        "run.engine",
        "engine",
        choices=("eq", "me"),
        choice_labels={"eq": "finite N", "me": "N → ∞, master equation"},
    ),
    Control(
        "slider.kind",
        "kind of slider",
        own_meaning="What moves on the contacts, and how the drive pulls it.",
        # A slider under a force needs another drive, which has no knob.
        choices=tuple(name for name, slider in SLIDERS.items() if not slider.takes_forces),
        required={
            "layered": {"slider.layers": "8"},
            "interface": {
                "slider.blocks": "8",
                "slider.length": "10 cm",
                "slider.bar_stiffness": "2000 N/m",
                "slider.neighbour_damping": "1000 1/s",
            },
        },
    ),
    Control(
        "slider.loading",
        "springs of the drive",
        choices=LOADINGS,
        choice_labels={"edge": "at the first block", "top": "from above", "both": "both"},
        # Each stiffness is that of the other spring, see `derived_value`.
        required={
            "edge": {"slider.stiffness": "", "slider.top_stiffness": NONE},
            "top": {"slider.stiffness": NONE, "slider.top_stiffness": ""},
            "both": {"slider.stiffness": "", "slider.top_stiffness": ""},
        },
    ),
    Control("slider.stiffness", "spring K", 2),
    Control("slider.top_stiffness", "springs from above K_t", 2, usual=100.0),
    Control("slider.mass", "mass M", 2),
    Control("slider.damping_ratio", "damping η_S/Ω_S", range=(0, 2)),
    Control("slider.damping", "damping rate η_S", 2, usual=10.0),
    Control("slider.layer_damping", "damping of layers", 2, usual=10.0),
    Control("slider.layers", "layers", range=(1, 64)),
    Control("slider.blocks", "blocks N_b", 1, (1, 1000), 8),
    Control("slider.length", "length", 1, usual=0.1),
    Control("slider.bar_stiffness", "stiffness of the row K_b", 2, usual=1000.0),
    Control("slider.neighbour_damping", "damping of neighbours γ", 2, usual=1000.0),
    Control("contacts.count", "number N", 2, (10, 1e6)),
    Control("contacts.static_force", "static force F_s", 1),
    Control("contacts.stiffness", "stiffness Nk", 1.5),
    Control("contacts.delay", "delay τ_d", 2, usual=1e-3),
    Control("contacts.back_force_ratio", "back force f_b/f_s", range=(0, 0.9)),
    Control("contacts.drag_rate", "drag rate η", 5, usual=1e11),
    Control("contacts.drag", "drag Nmη", 5, usual=1e-4),
    Control("contacts.coupling", "coupling", choices=RULES),
    Control("contacts.initial", "initial state", choices=tuple(INITIAL_STATES)),
    Control("contacts.renewal", "thresholds of later lives", choices=tuple(RENEWALS)),
    Control(
        "contacts.threshold.law",
        "threshold law",
        choices=WIDTH_LAWS,
        choice_labels={
            "exponential": "exponential",
            "gaussian": "normal (Gaussian)",
            "lognormal": "log-normal",
            "uniform": "uniform",
            "weibull": "Weibull",
        },
    ),
    Control("contacts.threshold.relative_width", "width Δf_s/f_s", 2, (1e-3, 1), 0.01),
    Control(
        "contacts.ageing.law",
        "ageing law",
        choices=(NONE, "log", "relax"),
        choice_labels={
            NONE: "no ageing",
            "log": "logarithmic growth",
            "relax": "exponential approach",
        },
        required={
            "log": {
                "contacts.ageing.time": "1 ms",
                "contacts.ageing.growth": "0.05",
                "contacts.coupling": "equal",
            },
            "relax": {
                "contacts.ageing.time": "1 ms",
                "contacts.ageing.young_force_ratio": "0.5",
                "contacts.ageing.young_relative_width": "0.1",
                "contacts.coupling": "equal",
            },
        },
    ),
    Control("contacts.ageing.time", "time τ_a", 3, usual=1e-3),
    Control("contacts.ageing.growth", "growth β", 1.5, usual=0.05),
    Control("contacts.ageing.young_force_ratio", "young force over old", range=(0.05, 1)),
    Control(
        "contacts.ageing.young_relative_width",
        "spread of young contacts",
        1,
        (1e-3, 1),
        0.1,
    ),
    Control(
        "contacts.thermal",
        "contacts break",
        choices=(NONE, "force_ratio", "temperature"),
        choice_labels={
            NONE: "at their thresholds",
            "force_ratio": "by activation, force f_T",
            "temperature": "by activation, temperature T",
        },
        required={
            "force_ratio": {
                "contacts.thermal.rate": "1e4 1/s",
                "contacts.thermal.force_ratio": f"{ACTIVATION_RATIO}",
                "contacts.coupling": "equal",
            },
            # The activation length follows from the thresholds, see `activation_length`.
            "temperature": {
                "contacts.thermal.rate": "1e4 1/s",
                "contacts.thermal.temperature": f"{ROOM_TEMPERATURE} K",
                "contacts.thermal.activation_length": "",
                "contacts.coupling": "equal",
            },
        },
        is_switch=True,
    ),
    Control("contacts.thermal.rate", "rate at the threshold ω_0", 3, usual=1e4),
    Control("contacts.thermal.force_ratio", "force f_T/f_s", 1.5, (1e-3, 1), ACTIVATION_RATIO),
    Control("contacts.thermal.temperature", "temperature T", 1, usual=ROOM_TEMPERATURE),
    Control("contacts.thermal.activation_length", "activation length x_a", 1.5, usual=1e-10),
    Control(
        "load.cycle",
        "normal load",
        choices=(NONE, "amplitude"),
        choice_labels={NONE: "constant", "amplitude": "vibrates"},
        required={
            "amplitude": {
                "load.normal_force": "1 N",
                "load.cycle.amplitude": "0.4 N",
                "load.cycle.frequency": "10 1/s",
            }
        },
        is_switch=True,
    ),
    Control("load.normal_force", "normal force L_0", 1.5),
    Control("load.cycle.amplitude", "amplitude of the load", 0.35, usual=0.4),
    Control("load.cycle.frequency", "frequency of the load", 2),
    Control(
        "contacts.track",
        "strength along the track",
        choices=(NONE, "spread"),
        choice_labels={NONE: "uniform", "spread": "varies"},
        # The length is the breaking stretch, see `derived_value`.
        required={
            "spread": {
                "contacts.track.spread": "0.1",
                "contacts.track.length": "",
                "contacts.track.correlation": "gaussian",
            }
        },
        is_switch=True,
    ),
    Control("contacts.track.spread", "spread w", range=(0.01, 0.5)),
    Control("contacts.track.length", "correlation length l", 1.5, usual=1e-7),
    Control("contacts.track.correlation", "correlation", choices=tuple(CORRELATIONS)),
    Control(
        "interaction.lattice",
        "lattice",
        choices=(NONE, *LATTICES),
        # Columns, rows and N follow from the number of contacts, see `lattice_size`.
        required={
            name: dict.fromkeys(LATTICE_SIZE, "") | {"interaction.strength": "0.1"}
            for name in LATTICES
        },
    ),
    Control("interaction.strength", "strength ξ", range=(0, 1)),
    Control("interaction.columns", "columns", range=(4, 200)),
    Control("interaction.rows", "rows", range=(4, 200)),
)
BY_KEY = {control.key: control for control in CONTROLS}

# Controls of whole tables, which are shown without the table too.
TABLE_CONTROLS = ("contacts.ageing.law", "interaction.lattice")
SWITCHES = tuple(control.key for control in CONTROLS if control.is_switch)


def values(config: Config) -> dict[str, object]:
    """Values of the controls that apply to a configuration, in SI, by key."""
    given = flat(config)
    for key in TABLE_CONTROLS:
        given.setdefault(key, NONE)
    for key in SWITCHES:
        there = (one for one in BY_KEY[key].required if f"{key}.{one}" in given)
        given[key] = next(there, NONE)
    if config.drive.velocity is not None:
        given["drive.stage"] = ()
    if "damping_ratio" in type(config.slider).model_fields and "slider.damping" not in given:
        given.setdefault("slider.damping_ratio", 0.0)
    if config.contact_kind.on_lattice:
        given.pop("contacts.count")
    # One of two keys for the drag of detached contacts.
    given.pop("contacts.drag_rate" if config.contacts.drag > 0 else "contacts.drag")
    return {control.key: given[control.key] for control in CONTROLS if control.key in given}
