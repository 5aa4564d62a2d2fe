"""Headers of columns: quantities and units."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import NamedTuple

from mesoslip.measured.units import is_unit, plain, size_of, unit_named

# SI units of the quantities that are used.
QUANTITIES = {
    "time": "s",
    "force": "N",
    "shear_stress": "Pa",
    "friction": "1",
    "normal_force": "N",
    "normal_stress": "Pa",
    "load_point": "m",
    "displacement": "m",
    "revolutions": "1",
    "rotation_speed": "1/s",
    "torque": "N*m",
    "radius": "m",
    "sliding_speed": "m/s",
    "viscosity": "Pa*s",
    "acoustic_emission": "V",
}
# A displacement, of the load point or of the slider.
EITHER = "either"

# Names of the field, in lower case, without punctuation.
NAMES = {
    "time": "time|t|elapsed|elapsed time|time elapsed|test time|run time|relative time"
    "|time stamp|timestamp|datetime|date time|zeit|temps|tiempo|tempo|time axis|x value|step time"
    "|pr fzeit|pruefzeit|time 1 default sample rate",
    "force": "force|spring force|shear force|shear load|friction force|frictional force"
    "|lateral force|tangential force|horizontal force|pulling force|traction force|drive force"
    "|driving force|kraft|reibkraft|standardkraft|ft|f t|ff|f f|fx|f x|f|fs|force x|force t"
    "|force tangential|horizontal load|force de frottement|force tangentielle",
    "shear_stress": "shear|shear stress|shearstress|tau|τ|shear strs|stress shear",
    "friction": "friction|friction coefficient|coefficient of friction|friction coeff"
    "|friction coef|coef of friction|coeff of friction|cof|mu|f mg|f over mg|f over n|f fn"
    "|f over fn|f w|ft fn|f t f n|apparent friction|tau sigma|tau over sigma|tau sigma n|tau sn"
    "|friction factor|reibwert|reibungskoeffizient|reibungszahl|mu app"
    "|shear stress normal stress|ff fn|traction|traction coefficient|traction coeff",
    "normal_force": "normal|normal force|normal load|normalforce|normalload|fn|f n|vertical force"
    "|vertical load|normalkraft|force normal|force n|fz|f z|nload|applied load|axial load"
    "|axial force|ball load|belastung|force normale|charge normale|fuerza normal|forza normale",
    "normal_stress": "normal stress|normalstress|sigma n|sigman|sigma|σ|σn|sn"
    "|effective normal stress|eff normal stress|norm stress|stress normal|sigma eff",
    "load_point": "load point|loadpoint|load point displacement|load point disp|load point displ"
    "|load point position|lp|lp disp|lp displacement|lp displ|lpdisp|loading point|drive"
    "|drive displacement|drive position|stage|stage position|stage displacement|actuator"
    "|actuator displacement|actuator position|motor position|motor displacement"
    "|ram displacement|piston displacement|crosshead|crosshead displacement|carriage position"
    "|translation stage|puller position|driver position|drive disp|shear actuator displacement"
    "|extension|standardweg",
    "displacement": "slider displacement|slider position|block displacement|block position"
    "|sample displacement|slider|fault slip|slip displacement|slip|slider disp",
    "revolutions": "revolutions|total revolutions|number of revolutions|revolution count|revs"
    "|turns",
    "rotation_speed": "rotation speed|rotational speed|speed of rotation|spindle speed"
    "|rotation frequency|rpm|drehzahl|angular velocity|angular speed",
    "viscosity": "viscosity|dynamic viscosity|viskosit t|viscosit|viscosidad|eta",
    "acoustic_emission": "acoustic emission|ae|ae rms|ae signal|acoustic|acoustic signal|trigger"
    "|piezo|hydrophone|microphone",
    "torque": "torque|friction torque|frictional torque|moment|drehmoment|reibmoment|mz|tz",
    "radius": "radius|track radius|wear track radius|disc radius|disk radius|mean radius",
    "sliding_speed": "sliding speed|sliding velocity|speed|velocity|linear speed|linear velocity"
    "|surface speed|surface velocity|entrainment speed|rolling speed|gleitgeschwindigkeit"
    "|geschwindigkeit|load point velocity|lp velocity|drive velocity|slip rate",
    EITHER: "displacement|displ|disp|position|pos|x|distance|travel|stroke|horizontal displacement"
    "|shear displacement|weg|deplacement|horizontal disp|shear disp|x position",
}  # fmt: skip
# Quantities of names by the dimension of their unit, which tells forces from stresses.
BY_UNIT = {
    "shear": {"N": "force", "Pa": "shear_stress"},
    "normal": {"N": "normal_force", "Pa": "normal_stress"},
    "speed": {"1/s": "rotation_speed", "m/s": "sliding_speed"},
}
LIKE = {
    "force": "shear",
    "shear_stress": "shear",
    "friction": "shear",
    "normal_force": "normal",
    "normal_stress": "normal",
    "rotation_speed": "speed",
    "sliding_speed": "speed",
}
MEANINGS = {name: quantity for quantity, names in NAMES.items() for name in names.split("|")}

BRACKETS = re.compile(r"\[([^\]]*)\]|\(([^)]*)\)|\{([^}]*)\}|<([^>]*)>")


class Heading(NamedTuple):
    """Meaning of a header."""

    quantity: str | None
    """One of `QUANTITIES` or `EITHER`; None if the name is not known."""
    unit: str | None
    """The unit as it is written."""
    guess: str = ""
    """Doubts about it."""


def name_of(text: str) -> str:
    """A name in lower case, without punctuation."""
    # A Greek mu alone is the friction coefficient, before a letter a prefix.
    text = re.sub(r"[µμ](?![A-Za-z])", "mu", text.replace("Âµ", "µ").replace("Î¼", "μ"))
    return re.sub(r"[^a-z0-9τσ]+", " ", text.lower()).strip()


def meaning_of(name: str) -> str | None:
    """The quantity of a name; None if it is not known."""
    bare = name_of(name)
    return MEANINGS.get(bare) or MEANINGS.get(re.sub(r" ?\d$", "", bare) if bare[:-1] else "")


def read_header(header: str, unit: str = "") -> Heading:
    """Meaning of a header; ``unit`` is that of a line of units below it.

    A name may follow that of a group, as in "DAQ.Fx (N)". The unit decides between a force, a
    stress and a coefficient.

    >>> read_header("Normal_stress(MPa)"), read_header("lp_disp_um")
    (Heading(quantity='normal_stress', unit='MPa', guess=''), \
Heading(quantity='load_point', unit='um', guess=''))
    """
    found = _by_unit(_read(header, unit))
    group = re.match(r"\s*[A-Za-z]\w*[.:](?=[A-Za-zµμτσ])", header)
    if found.quantity is None and group:
        inner = read_header(header[group.end() :], unit)
        found = found if inner.quantity is None else inner
    return found


def bare_name(header: str) -> str:
    """The name in a header without its unit, as `name_of`: "time" for "Time / s"."""
    divided = (name for name, unit in _divided(header.strip()) if unit and is_unit(unit))
    return name_of(next(divided, header))


def _by_unit(found: Heading) -> Heading:
    """A meaning that agrees with the unit."""
    if found.quantity not in LIKE or not found.unit:
        return found
    for si, quantity in BY_UNIT[LIKE[found.quantity]].items():
        if _has_dimension(found.unit, si):
            return found._replace(quantity=quantity)
    return found


def _read(header: str, unit: str) -> Heading:
    """Meaning of the name in a header, and the unit."""
    text = header.strip(" \"'")
    unit = unit.strip("[](){}<> ")
    if unit:
        return Heading(meaning_of(_without_brackets(text)) or meaning_of(text), unit)
    # Either a force in newtons, or a normal force without a unit.
    if re.fullmatch(r"(?i)f_?n", text):
        return Heading(None, None)
    whole = meaning_of(text)
    if whole == "friction" and not BRACKETS.search(text):
        guess = ""
        if name_of(text) == "f n" or re.fullmatch(r"(?i)f\s*/\s*n", text):
            guess = f"{text!r} taken as a coefficient, force over normal force, not as newton"
        return Heading(whole, None, guess)
    if re.fullmatch(r"(?i)f\s*/\s*n", text):
        return Heading(
            "friction", None, f"{text!r} taken as force over normal force, not as newtons"
        )
    for name, named in _divided(text):
        quantity = meaning_of(name)
        if quantity is not None and (named == "" or _fits(named, quantity)):
            return Heading(quantity, named or None)
    for name, named in _divided(text):
        if named and is_unit(named):
            return Heading(meaning_of(name), named)
    return Heading(whole, None)


def _without_brackets(text: str) -> str:
    return BRACKETS.sub(" ", text)


def _fits(unit: str, quantity: str) -> bool:
    return _has_dimension(unit, QUANTITIES.get(quantity, "m"))


def _has_dimension(unit: str, si: str) -> bool:
    """Whether a unit is one of the dimension of an SI unit."""
    try:
        return size_of(unit, si) is not None
    except ValueError:
        return False


def _divided(text: str) -> Iterator[tuple[str, str]]:
    """Divisions of a header into a name and a unit, the most explicit first."""
    for match in BRACKETS.finditer(text):
        inside = next(one for one in match.groups() if one is not None)
        outside = text[: match.start()] + " " + text[match.end() :]
        if unit_named(inside) is not None or not meaning_of(text):
            yield _without_brackets(outside), plain(inside)
    for pattern in (
        r"(?P<name>.+?)\s*/\s*(?P<unit>[^/]+(?:/[^/]+)?)",
        r"(?P<name>.+?)\s*,\s*(?P<unit>.+)",
        r"(?P<name>.+?)\s+in\s+(?P<unit>.+)",
        r"(?P<name>.+)[_\s.]+(?P<unit>[^_\s.]+)",
    ):
        found = re.fullmatch(pattern, text)
        if found:
            yield found["name"], plain(found["unit"])
