"""Claims of numbers that follow from the parameters: C1, C15, C16."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from mesoslip.quantities import with_unit
from mesoslip.theory.derived import derived
from mesoslip.theory.force_curve import ForceCurve
from outputs import configuration

from claims.base import Finding, claim, measured, verdict

if TYPE_CHECKING:
    import xarray as xr
    from mesoslip.configuration.config import Config

# The source has three digits.
ROUNDING = 5e-3


@claim(
    "C1",
    "Omega_S = 257 1/s, tau_S = 0.0245 s, Omega_L = 1170 1/s, D1 = 2.1e-3",
    "each within half a percent of the source's number",
    ("claims/klein",),
)
def derived_numbers(trees: Sequence[xr.DataTree]) -> Finding:
    quantities = derived(configuration(trees[0]))
    source = {
        "omega_s": (257.0, "1/s"),
        "setup_period": (0.0245, "s"),
        "omega_l": (1.17e3, "1/s"),
        "D1": (2.1e-3, "1"),
    }
    found = {name: quantities[name].value for name in source}
    alpha = quantities["alpha"].value
    return Finding(
        (
            *(
                measured(name, found[name], unit, with_unit(value, unit))
                for name, (value, unit) in source.items()
            ),
            measured("alpha", alpha, "1", "2.21"),
        ),
        verdict(
            all(abs(found[name] / value - 1) < ROUNDING for name, (value, _) in source.items()),
            abs(alpha / 2.21 - 1) > ROUNDING,
        ),
        "all four agree to the given digits; alpha = (6 F_s Omega_S/(K v_d))^(1/3) differs from "
        "the source's number by its own formula",
    )


@claim(
    "C15",
    "a cantilever's lowest bending frequency is 2.03 (K/M)^(1/2)",
    "by the formulas and by the beam's equation within half a percent of 2.03",
    ("claims/cantilever",),
)
def cantilever(trees: Sequence[xr.DataTree]) -> Finding:
    from scipy.optimize import brentq

    ratio = derived(configuration(trees[0]))["bending_ratio"].value
    # A beam with one free end: cos z cosh z = -1, frequency z^2 (E I/(rho S))^(1/2)/L^2.
    root = brentq(lambda z: math.cos(z) + 1 / math.cosh(z), 1.5, 2.5, xtol=1e-15)
    exact = root**2 / math.sqrt(3)
    return Finding(
        (
            measured("ratio by the formula with 3.52", ratio, "1", "2.03"),
            measured("ratio from the beam's equation", exact, "1", "2.03"),
        ),
        verdict(abs(ratio / 2.03 - 1) < ROUNDING and abs(exact / 2.03 - 1) < ROUNDING),
        "the beam's own equation, cos z cosh z = -1, gives the same",
    )


@claim(
    "C16",
    "K* is about Nk (f_s - f_b)/Delta f_s (S48)",
    "within a factor 3 at four widths from 0.003 to 0.1, exponent -1 within 0.1",
    ("claims/klein",),
)
def instability(trees: Sequence[xr.DataTree]) -> Finding:
    config = configuration(trees[0])
    widths = np.array([0.003, 0.01, 0.03, 0.1])
    exact = np.array([_critical_stiffness(config, width) for width in widths])
    contacts = config.contacts
    estimate = contacts.stiffness * (1 - contacts.back_force_ratio) / widths
    ratio = exact / estimate
    # F' = Nk [1 - (x - x_b) P_c(x)], steepest near the mean of a Gaussian law.
    closed = contacts.stiffness * (
        (1 - contacts.back_force_ratio) / (np.sqrt(2 * np.pi) * widths) - 1
    )
    # Delta f_s K* must be the same for all widths for the estimate's form to hold.
    slope = np.polyfit(np.log(widths), np.log(exact), 1)[0]
    return Finding(
        (
            measured("K* at Delta f_s/f_s = 0.01", exact[1], "N/m", "43.4 kN/m"),
            *(
                measured(f"K* over S48 at {width:g}", one, "1", "about 1")
                for width, one in zip(widths, ratio, strict=True)
            ),
            *(
                measured(f"K* over Nk [(f_s - f_b)/((2 pi)^(1/2) Delta f_s) - 1] at {width:g}",
                         one, "1", "")
                for width, one in zip(widths, exact / closed, strict=True)
            ),
            measured("exponent of K* in Delta f_s", slope, "1", "-1"),
        ),
        verdict(abs(slope + 1) < 0.1 and bool(np.all((ratio > 1 / 3) & (ratio < 3))), True),
        f"the claim is false as a number: S48 is {1 / ratio[0]:.1f} to {1 / ratio[-1]:.1f} times "
        "K*, as the maximum density of a Gaussian law is 0.4/Delta f_s, not 1/Delta f_s, and as "
        "contacts that attach again add Nk. With both the closed form agrees within "
        f"{100 * np.abs(exact / closed - 1).max():.1f} %; K* is nearly proportional to "
        "1/Delta f_s, as claimed. The source's number for 0.01 is neither",
    )  # fmt: skip


def _critical_stiffness(config: Config, width: float) -> float:
    """K* of the master equation at a relative width of the thresholds [N/m]."""
    changed = config.replace(
        {"contacts.coupling": "equal", "contacts.threshold.relative_width": float(width)},
        {"curve.length": 3 * config.contacts.break_stretch},
    )
    return ForceCurve(changed).K_star[0]
