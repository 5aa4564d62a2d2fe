"""Keys and measures in pictures: names, symbols, and values of keys as legends have them."""

from __future__ import annotations

import re

from mesoslip.configuration.config import Config
from mesoslip.configuration.differences import MISSING, changes, is_bookkeeping

# Symbols of keys.
SYMBOLS = {
    "contacts.static_force": "$F_s$",
    "contacts.threshold.relative_width": r"$\Delta f_s/f_s$",
    "contacts.delay": r"$\tau_d$",
    "contacts.stiffness": "$Nk$",
    "contacts.back_force_ratio": "$f_b/f_s$",
    "contacts.count": "$N$",
    "contacts.drag": r"$Nm\eta$",
    "contacts.drag_rate": r"$\eta$",
    "contacts.thermal.force_ratio": "$f_T/f_s$",
    "contacts.thermal.rate": r"$\omega_0$",
    "contacts.track.length": r"$\ell$",
    "contacts.track.spread": "$w$",
    "drive.velocity": "$v_d$",
    "interaction.strength": r"$\xi$",
    "slider.damping": r"$\eta_S$",
    "slider.damping_ratio": r"$\eta_S/\Omega_S$",
    "slider.bar_stiffness": "$K_b$",
    "slider.blocks": "$N_b$",
    "slider.layers": "$N_l$",
    "slider.mass": "$M$",
    "slider.stiffness": "$K$",
    # Parameters of rate-and-state laws.
    "a": "$a$",
    "b": "$b$",
    "b2": "$b_2$",
    "reference_force": "$F_0$",
    "slip_distance": "$D_c$",
    "slip_distance2": "$D_{c,2}$",
    "noise_share": "correlated share",
    "noise_time": "correlation time",
}
# Names of keys whose last part is ambiguous, and of a measure.
NAMES = {
    "contacts.stiffness": "stiffness of the contacts",
    "contacts.count": "number of contacts",
    "contacts.threshold.relative_width": "width of the thresholds",
    "contacts.thermal.rate": "rate of breaking",
    "contacts.thermal.force_ratio": "thermal force",
    "drive.velocity": "drive velocity",
    "interaction.strength": "interaction strength",
    "slider.damping": "damping",
    "slider.damping_ratio": "damping ratio",
    "slider.bar_stiffness": "stiffness of the row of blocks",
    "slider.blocks": "number of blocks",
    "slider.layers": "number of layers",
    "slider.mass": "mass of the slider",
    "slider.stiffness": "stiffness of the spring",
    "smooth_time_share": "share of smooth sliding",
}


# Keys of words, with the word.
WORDS = {
    "contacts.coupling": "{} coupling",
    "contacts.delay_law": "{} delays",
    "contacts.initial": "{} contacts at the start",
    "contacts.renewal": "thresholds: {}",
    "contacts.threshold.law": "{} thresholds",
    "contacts.ageing.law": "ageing: {}",
    "contacts.track.correlation": "{} correlation",
    "interaction.lattice": "{} lattice",
    "slider.kind": "{} slider",
    "slider.loading": "loading: {}",
}


def setting(key: str, value: str, config: Config, *, is_alone: bool) -> str:
    """A key with its value, as legends and titles have it: with its symbol, or in words."""
    if key == "run.engine":
        is_infinite = value == "me"
        return r"$N\to\infty$" if is_infinite else f"{config.contacts.count} contacts"
    if key in WORDS:
        return WORDS[key].format(plain(value))
    return f"{name_of(key) if is_alone else symbol_or_name(key)} = {plain(value)}"


def changes_in_a_line(config: Config, base: Config, room: int) -> str:
    """The changes of a configuration, without lists and lengths, that fit into a number of
    characters; none of them beside an own title if not all fit."""
    found = [
        one
        for one in changes(config, base)
        if not is_bookkeeping(one.key) and not one.values[0].startswith("[")
    ]
    texts = []
    for key, (value, before) in found:
        text = setting(key, value, config, is_alone=len(found) == 1)
        was = setting(key, before, base, is_alone=False) if key == "run.engine" else plain(before)
        texts.append(text if before == MISSING else f"{text} (was {was})")
    for count in range(len(texts), 0, -1):
        rest = len(texts) - count
        more = f"{rest} more change{'s' if rest > 1 else ''}"
        line = ", ".join([*texts[:count], *([more] if rest else [])])
        if shown_length(line) <= room:
            return line
        if config.title != base.title:
            break
    return ""


def plain(text: str) -> str:
    """A text on one line, with dollars as they are and not as formulas."""
    return " ".join(text.split()).replace("$", r"\$")


def shown_length(text: str) -> int:
    """Approximate number of characters of a text with formulas."""
    return len(re.sub(r"[${}_^]", "", re.sub(r"\\[a-zA-Z]+", "x", text)))


def symbol_or_name(key: str) -> str:
    """The symbol of a key, or its last part."""
    return SYMBOLS.get(key, _plain(key))


def name_of(key: str) -> str:
    """The name of a key or a measure, with its symbol if it has one."""
    name = NAMES.get(key, _plain(key))
    return f"{name} {SYMBOLS[key]}" if key in SYMBOLS else name


def _plain(key: str) -> str:
    if key.startswith("fit."):
        return key.removeprefix("fit.").replace(".", " ")
    # The last part alone would be ambiguous: the time of ageing, the rate of breaking.
    return " ".join(key.split(".")[1 if key.count(".") > 1 else -1 :]).replace("_", " ")
