"""Names and symbols of keys and measures in pictures."""

from __future__ import annotations

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
    return key.rpartition(".")[2].replace("_", " ")
