"""The catalogue of avalanches of an output, and its statistics."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mesoslip.analysis.avalanche_sizes import REJECTED, compare_laws, fit_power_law, local_exponents
from mesoslip.array_types import Dataset, DataTree
from mesoslip.configuration import arguments
from mesoslip.configuration.config import Config
from mesoslip.configuration.units import from_cf_units
from mesoslip.errors import FileError
from mesoslip.output.access import group_of
from mesoslip.output.inputs import OutputLike, as_run
from mesoslip.output.table_files import PrintedTable, write_table
from mesoslip.quantities import column

NO_AVALANCHES = (
    "the output has no avalanches: they are recorded with [interaction] or "
    'slider.kind = "quasistatic"'
)

# Statistics: unit, meaning.
SUMMARY = {
    "count": ("1", "avalanches in the catalogue"),
    "breaks": ("1", "breaks of contacts in them"),
    "breaks_outside": (
        "1",
        "breaks of the run outside them: in sliding without end, in an avalanche cut off by the "
        "end of an interrupted run, or in avalanches below output.avalanche_size",
    ),
    "mean_size": ("1", "mean size"),
    "max_size": ("1", "maximum size"),
    "max_size_ratio": ("1", "maximum size over the number of contacts"),
    "triggered_share": ("1", "share of the breaks that were triggered by others"),
    "slip_share": (
        "1",
        "share of the slider's displacement that happens in avalanches, for a drive "
        "in one direction",
    ),
    "spanning_count": ("1", "avalanches that span the lattice"),
    "bundle_strength": ("N", "maximum contact force before an avalanche"),
    "failure_size": ("1", "mean size of the avalanches that broke all remaining contacts"),
    "exponent": ("1", "exponent tau of P(s) ~ s^(-tau), averaged over forms of the law"),
    "exponent_error": ("1", "standard error of the exponent, with that of the form"),
    "cutoff_shape": ("1", "c of the best form's cutoff exp(-(s/s_c)^c); 0: no cutoff"),
    "correction_power": ("1", "b of the best form's correction exp(a s^(-b)); 0: no correction"),
    "cutoff": ("1", "cutoff s_c of the sizes, if it is resolved"),
    "cutoff_error": ("1", "standard error of the cutoff"),
    "min_fitted_size": ("1", "minimum size that the law is fitted to"),
    "fitted_count": ("1", "avalanches that the law is fitted to"),
    "fitted_share": ("1", "share of the avalanches that the law is fitted to"),
    "fit_distance": ("1", "maximum distance between the law's distribution and theirs"),
    "fit_p_value": ("1", "probability of a distance as large if the sizes follow the law"),
    "tested_count": ("1", "avalanches in this test"),
    "fit_rejected": (
        "1",
        f"1 if the p-value is below {REJECTED:g}: the sizes do not follow the law",
    ),
    "local_exponent": ("1", "exponent of the pure law nearest to sizes from s to 10 s, the first"),
    "local_exponent_error": ("1", "standard error of the first local exponent"),
    "last_local_exponent": ("1", "the same for the last factor of ten with 50 sizes or more"),
    "last_local_exponent_error": ("1", "standard error of the last local exponent"),
    "pure_exponent": ("1", "exponent of the law without cutoff, from the same size on"),
    "pure_exponent_error": ("1", "standard error of that exponent if there is no cutoff"),
    "pure_ratio": ("1", "log-likelihood of the law over that without cutoff"),
    "pure_p_value": ("1", "probability of such a ratio without cutoff"),
    "exponential_cutoff_ratio": ("1", "log-likelihood of the law over an exponential cutoff"),
    "exponential_cutoff_p_value": ("1", "probability of such a ratio if both are as good"),
    "gaussian_cutoff_ratio": ("1", "log-likelihood of the law over a Gaussian cutoff"),
    "gaussian_cutoff_p_value": ("1", "probability of such a ratio if both are as good"),
    "lognormal_ratio": ("1", "log-likelihood of the law over a lognormal one; > 0: likelier"),
    "lognormal_p_value": ("1", "probability of such a ratio, of any sign, if both are as good"),
    "stretched_exponential_ratio": ("1", "log-likelihood of the law over a stretched exponential"),
    "stretched_exponential_p_value": ("1", "probability of such a ratio if both are as good"),
}
# Minimum number of sizes in a window whose local exponent is reported.
MIN_LOCAL_COUNT = 50


@arguments.checked(after=arguments.number(), min_force_ratio=arguments.number(0, 1))
def avalanches(
    output: OutputLike, *, after: float = 0.0, min_force_ratio: float | None = None
) -> Dataset:
    """The catalogue of avalanches of an output, dimension ``avalanche``, in SI.

    See `mesoslip.avalanche_summary` for their statistics, and for fits and histograms of sizes
    `mesoslip.analysis.avalanche_sizes`.

    Parameters
    ----------
    output
        Output of a run.
    after
        Only avalanches that start after this time [s].
    min_force_ratio
        Only avalanches before the maximum of the contact force in their realization, at forces
        above this fraction of it: those near the failure of a bundle.

    Returns
    -------
    xarray.Dataset
        The group ``avalanches`` of the output, with the coordinate ``realization_index``.

    Raises
    ------
    FileError
        If the output cannot be read, or has no avalanches.

    Examples
    --------
    >>> import mesoslip
    >>> path, *_ = mesoslip.example("bundle")  # writes bundle.toml
    >>> tree = mesoslip.run(mesoslip.Config.load(path, ["contacts.count=2000"]))
    >>> near_failure = mesoslip.avalanches(tree, min_force_ratio=0.99)
    >>> 0 < near_failure.sizes["avalanche"] < mesoslip.avalanches(tree).sizes["avalanche"]
    True
    """
    tree = as_run(output)
    if "avalanches" not in tree.children:
        raise FileError(NO_AVALANCHES)
    data = group_of(tree, "avalanches").set_coords("realization_index")
    chosen = data["start_time"].values >= after
    if min_force_ratio is not None:
        force = np.abs(data["force_before"].values)
        owner = data["realization_index"].values
        for realization in np.unique(owner):
            mine = np.flatnonzero(owner == realization)
            peak = mine[np.argmax(force[mine])]
            chosen[mine] &= (force[mine] > min_force_ratio * force[peak]) & (mine < peak)
    return data.isel(avalanche=np.flatnonzero(chosen))


@arguments.checked(
    after=arguments.number(),
    min_force_ratio=arguments.number(0, 1),
    min_size=arguments.whole(1),
)
def avalanche_summary(
    output: OutputLike,
    *,
    after: float = 0.0,
    min_force_ratio: float | None = None,
    min_size: int | None = None,
) -> dict[str, float | None]:
    """Statistics of the avalanches of an output, in SI, with the names of ``mesoslip avalanches``.

    Parameters
    ----------
    output, after, min_force_ratio
        See `avalanches`.
    min_size
        Minimum size in the fit of the size distribution; chosen by default, see
        `mesoslip.analysis.avalanche_sizes.fit_power_law`.

    Returns
    -------
    dict
        Statistics that are not defined for the output are left out; a cutoff that the sizes do not
        resolve is None.

    Raises
    ------
    FileError
        If the output cannot be read, or has no avalanches.

    Examples
    --------
    >>> import mesoslip
    >>> path, *_ = mesoslip.example("bundle")  # writes bundle.toml
    >>> tree = mesoslip.run(mesoslip.Config.load(path, ["contacts.count=20000"]))
    >>> 2 < mesoslip.avalanche_summary(tree)["exponent"] < 3  # 5/2 for large bursts
    True
    """
    tree = as_run(output)
    data = avalanches(tree, after=after, min_force_ratio=min_force_ratio)
    config = Config.from_toml(tree.attrs["configuration"])
    sizes = data["size"].values
    result: dict[str, float | None] = {"count": float(sizes.size), "breaks": float(sizes.sum())}
    is_whole = after == 0 and min_force_ratio is None
    outside = float(tree.to_dataset()["breaks"].values.sum() - sizes.sum())
    if is_whole and outside > 0:
        result["breaks_outside"] = outside
    if sizes.size == 0:
        return result
    result["mean_size"] = float(sizes.mean())
    result["max_size"] = float(sizes.max())
    result["max_size_ratio"] = float(sizes.max() / config.contacts.count)
    result["triggered_share"] = float(1 - sizes.size / sizes.sum())
    directions = set[float]().union(*(part.directions for part in config.drive_parts))
    if "slip" in data and is_whole and len(directions) == 1:
        root = tree.to_dataset()
        moved = float(np.abs(root["end_displacement"]).sum())
        if moved > 0:
            result["slip_share"] = float(np.abs(root["avalanche_slip"]).sum()) / moved
    if "spans" in data:
        result["spanning_count"] = float(data["spans"].values.sum())
    result["bundle_strength"] = float(np.abs(data["force_before"].values).max())
    is_failure = failures(tree, data)
    if is_failure.any():
        result["failure_size"] = float(sizes[is_failure].mean())
    sizes = sizes[~is_failure]
    fit = fit_power_law(sizes, min_size=min_size)
    if fit is not None:
        result |= {
            "exponent": fit.exponent,
            "exponent_error": fit.exponent_error,
            "cutoff_shape": fit.form.cutoff_shape,
            "correction_power": fit.form.correction_power,
            "cutoff": fit.cutoff if fit.cutoff_is_resolved else None,
            "cutoff_error": fit.cutoff_error if fit.cutoff_is_resolved else None,
            "min_fitted_size": float(fit.min_size),
            "fitted_count": float(fit.count),
            "fitted_share": fit.count / sizes.size,
            "fit_distance": fit.distance,
            "fit_p_value": fit.p_value,
            "tested_count": float(fit.tested),
            "fit_rejected": float(fit.is_rejected),
            "pure_exponent": fit.pure_exponent,
            "pure_exponent_error": fit.pure_exponent_error,
        }
        windows = [
            one for one in local_exponents(sizes, fit.min_size) if one.count >= MIN_LOCAL_COUNT
        ]
        for prefix, window in zip(
            ("local", "last_local"), (windows[:1] + windows[-1:]), strict=False
        ):
            result[f"{prefix}_exponent"] = window.exponent
            result[f"{prefix}_exponent_error"] = window.exponent_error
        for one in compare_laws(sizes, fit):
            result[f"{one.law}_ratio"] = one.log_likelihood_ratio
            result[f"{one.law}_p_value"] = one.p_value
    return result


def warning(statistics: dict[str, float | None]) -> str | None:
    """Warning that the law is rejected; None if it is not."""
    p_value = statistics.get("fit_p_value")
    if not statistics.get("fit_rejected") or p_value is None:
        return None
    return (
        f"the sizes do not follow this law (p = {p_value:.2g}): its exponent and cutoff do not "
        "describe them"
    )


def failures(tree: DataTree, data: Dataset) -> NDArray[np.bool_]:
    """Whether each avalanche broke all remaining contacts; these follow no law of sizes."""
    config = Config.from_toml(tree.attrs["configuration"])
    if config.contacts.reattach:
        return np.zeros(data.sizes["avalanche"], dtype=bool)
    everything = group_of(tree, "avalanches")
    last = np.full(tree.sizes["realization"], np.inf)
    # Rows are in the order of time, so that the last one of each realization is kept.
    last[everything["realization_index"].values] = everything["start_time"].values
    is_last = data["start_time"].values == last[data["realization_index"].values]
    is_broken = tree.to_dataset()["breaks"].values == config.contacts.count
    failed: NDArray[np.bool_] = is_last & is_broken[data["realization_index"].values]
    return failed


def rows(data: Dataset) -> list[dict[str, Any]]:
    """The avalanches, a dictionary for each."""
    names = _columns(data)
    columns = [data[name].values.tolist() for name in names]
    return [dict(zip(names, row, strict=True)) for row in zip(*columns, strict=True)]


def write_csv(data: Dataset, path: Path) -> None:
    """Write avalanches as a table with the units in its header."""
    units = {name: data[name].attrs.get("units", "1") for name in _columns(data)}
    write_table(rows(data), units, path)


def printed(data: Dataset) -> PrintedTable:
    """Avalanches as a table for print, each column in one unit."""
    head, columns = [], []
    for name in _columns(data):
        values = data[name].values.tolist()
        shown = column(values, from_cf_units(data[name].attrs.get("units", "1")), 5)
        head.append(shown.head(name.replace("_", " ")))
        columns.append([shown.text(value) for value in values])
    return PrintedTable("Avalanches", tuple(head), tuple(zip(*columns, strict=True)))


def _columns(data: Dataset) -> list[str]:
    return [str(name) for name in data.variables]
