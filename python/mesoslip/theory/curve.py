"""The force curve, or steady sliding over velocity, in the layout of an output file."""

from __future__ import annotations

import math

import numpy as np

from mesoslip.array_types import Dataset, DataTree
from mesoslip.output.inputs import ConfigLike, as_config
from mesoslip.output.provenance import program_attributes
from mesoslip.output.variables import CRITICAL, CURVE, STRETCHES
from mesoslip.text_rows import named_meanings
from mesoslip.theory.contacts import contact_theory
from mesoslip.theory.force_curve import ForceCurve

# Units and meanings of the summary of a curve.
SUMMARY = named_meanings("""
K_star | N/m | K* = max(-F'(X)): without delay, slow sliding from this start has no instability with
    a stiffer spring; 0 if the force does not fall
K_star_error | N/m | estimated error of K*; for samples of thresholds two standard deviations, and
    the correction for the bandwidth
K_star_displacement | m | displacement at K*
K_star_estimate | N/m | estimate of K*, Nk (f_s - f_b)/Delta f_s (S48)
stable | 1 | whether K >= K*, so that without delay slow sliding from this start has no instability
X_c | m | displacement at which the slider becomes unstable, smallest X with F'(X) = -K
F_c | N | force at X_c
F_peak | N | maximum force; none if the force does not fall
X_peak | m | displacement at the maximum force
F_steady | N | force of stationary slow sliding
D0 | 1 | F(X_c)/F_s
D1 | 1 | v_d (K M)^(1/2)/F_s
D2 | 1 | -(1/2) F''(X_c) F_s/K^2
D3 | 1 | -(1/6) F'''(X_c) F_s^2/K^3
bandwidth | 1 | bandwidth with which the density of samples of thresholds is estimated, relative to
    the breaking stretch
error | 1 | estimated error of the force over F_s, with that of samples of thresholds
slope_error | 1 | estimated error of the slope over Nk
digits | 1 | reliable digits of the force
conservation_error | 1 | maximum relative error of the number of contacts
""")
# Points of a density over the stretch, and widths of the newborn stretches below their mean.
DENSITY_POINTS, WIDTHS_BELOW = 2001, 6


def curve(config: ConfigLike) -> DataTree:
    """The force curve F(X) of the master equation, and its elastic instability.

    Parameters
    ----------
    config
        A TOML file, an output, nested tables, or a `Config`.

    Returns
    -------
    xarray.DataTree
        Root: force, slope, stiffness and rate of breaks over ``displacement``; ``K_star``, ``X_c``,
        ``F_peak``, ``F_steady``, ``D0`` to ``D3``, ``stable`` as attributes, in SI. Group
        ``critical``: all X_c; ``stretch_density``: the densities that ``curve.density_at`` asks
        for. Of contacts that age or break by thermal activation: steady sliding over ``velocity``.

    Raises
    ------
    FileError, ConfigError
        If the configuration cannot be read or is wrong.

    Examples
    --------
    >>> import mesoslip
    >>> path, *_ = mesoslip.example("klein")  # writes klein.toml
    >>> curve = mesoslip.curve(path)
    >>> round(curve.attrs["K_star"] / 1e3)  # kN/m
    142
    >>> curve["contact_force"].attrs["units"]
    'N'
    """
    checked = as_config(config)
    if contact_theory(checked).depends_on_velocity:
        # Few curves need it.
        from mesoslip.theory.steady_curve import SteadyCurve

        return SteadyCurve(checked).to_tree()
    return curve_tree(ForceCurve(checked))


def curve_tree(curve: ForceCurve) -> DataTree:
    """A force curve as an output.

    Root: F, F', K_c and Γ over ``displacement``, with V_eff if a drive displacement is given;
    derived quantities as attributes. Groups: ``critical`` (all X_c), ``stretch_density``
    (Q at the displacements asked for).
    """
    # It takes longer to import than a curve to compute.
    import xarray as xr

    config, x = curve.config, curve.samples
    curves = {
        "contact_force": curve.force(x),
        "slope": curve.slope(x),
        "contact_stiffness": curve.stiffness(x),
        "break_rate": curve.breaks(x),
    }
    if config.curve.drive_displacement is not None and math.isfinite(curve.spring_stiffness):
        curves["potential"] = curve.potential(x, config.curve.drive_displacement)
    dimension = ("displacement",)
    root = xr.Dataset(
        {name: CURVE.variable(name, dimension, values) for name, values in curves.items()},
        coords={"displacement": CURVE.variable("displacement", dimension, x)},
        attrs=program_attributes(config, "curve")
        | {name: value for name, value in curve.summary().items() if value is not None}
        | {"solver": curve.solver, "kernel_seconds": curve.kernel_seconds},
    )
    root.attrs["stable"] = str(curve.stable).lower()
    root.attrs["comment"] = curve.verdict
    points = np.array(curve.critical_points).reshape(-1, len(CRITICAL))
    critical = xr.Dataset(
        {
            name: CRITICAL.variable(name, ("point",), column)
            for name, column in zip(CRITICAL, points.T, strict=True)
        }
    )
    children = {"critical": xr.DataTree(critical)}
    if config.curve.density_at:
        children["stretch_density"] = xr.DataTree(_densities(curve))
    children |= contact_theory(config).curve_groups()
    return xr.DataTree(root, children=children)


def _densities(curve: ForceCurve) -> Dataset:
    """Q(x; X) at the displacements that the configuration asks for."""
    import xarray as xr

    unit, back = curve.stretch_unit, curve.config.contacts.back_force_ratio
    low = min(0.0, back - WIDTHS_BELOW * curve.newborn_width / unit)
    x = unit * np.linspace(low, curve.scales.longest + back, DENSITY_POINTS)
    at = np.array(curve.config.curve.density_at)
    densities, atoms = zip(*(curve.stretch_density(x, one) for one in at), strict=True)
    dimensions = ("density_displacement", "stretch")
    return xr.Dataset(
        {
            name: STRETCHES.variable(name, where, values)
            for name, where, values in (
                ("stretch_density", dimensions, np.array(densities)),
                ("unbroken_part", dimensions[:1], np.array(atoms)),
            )
        },
        coords={
            name: STRETCHES.variable(name, (name,), values)
            for name, values in zip(dimensions, (at, x), strict=True)
        },
    )
