"""A run in Python, whose tables have units."""

from __future__ import annotations

from mesoslip.array_packages import import_xarray
from mesoslip.array_types import Dataset
from mesoslip.output import variables
from mesoslip.output.layout import DIMENSIONS
from mesoslip.output.variables import Group
from mesoslip.simulation import realization

# What the columns of a table mean, and the names in files of those that have others there.
MEANINGS: dict[str, Group] = {
    "trace": variables.ROOT,
    "slip_trace": variables.SLIP_TRACES,
    "slips": Group(variables.SLIPS, slip=variables.SLIP_TRACES["slip"]),
    "stages": variables.STAGES,
    "avalanches": variables.AVALANCHES,
    "snapshot_events": variables.SNAPSHOTS,
    "ruptures": variables.RUPTURES,
    "fronts": variables.FRONTS,
}
NAMES_IN_FILES: dict[str, dict[str, str]] = {
    "slip_trace": {"time": "sample_time"},
    "avalanches": {"time": "start_time"},
    "snapshot_events": {"time": "snapshot_time", "size": "avalanche_size"},
    "ruptures": {"block": "block_number"},
}


class Realization(realization.Realization):
    """One run of a configuration, advanced step by step.

    Its results do not depend on how far it advances at a time. Recorded rows stay in memory. The
    memory of the kernel is freed by `close`, at the end of a ``with`` block, or with this object.
    Realizations are independent of each other and release the interpreter's lock while they
    advance, so several can run in threads; each is to be used by one thread at a time.

    Parameters
    ----------
    config
        The configuration.
    number
        Number of the realization, from 0; each has its own random numbers.
    estimates_errors
        Whether a run of the master equation is repeated with steps twice as long, which estimates
        the errors due to its steps.
    resolution
        Resolution of the master equation; by default that of the configuration, or one with which
        the error of the force is within ``run.force_tolerance``.
    after
        The end of another run, which this one continues, see `end`; its errors are then not
        estimated, and its time and displacement start at 0. By default the run starts with
        ``contacts.initial``.

    Raises
    ------
    RunError
        By the methods, if the motion makes no progress or a solver fails.

    Examples
    --------
    >>> import mesoslip
    >>> path, *_ = mesoslip.example("klein")  # writes klein.toml
    >>> config = mesoslip.Config.load(path, overrides=["contacts.count=200"])
    >>> with mesoslip.Realization(config) as one:
    ...     one.advance_to(1.0)
    ...     force = one.table("trace")["spring_force"]
    ...     stretched = one.contacts["break_stretch"]
    >>> one.time >= 1.0, one.finished, len(stretched)
    (True, False, 200)

    Attributes
    ----------
    config, number
        The configuration, and the number of the realization, from 0.
    time, displacement
        Time reached [s], and displacement of the slider [m].
    ending
        The reason why the run is over; empty before.
    breaks, detached, advances
        Breaks so far, number of detached contacts, advances of the slider so far.
    kernel_seconds
        Computing time [s].
    avalanche_count, avalanche_slip
        Avalanches so far, and the displacement of the slider in them [m].
    force_error
        Estimated error of the contact force [N], before the first slip if there is one; 0 where
        contacts are kept one by one, NaN before it is known.
    slip_time_error
        Estimated error of the time at which a slip starts [s], maximum over the slips; 0 or NaN as
        ``force_error``.
    resolution
        Resolution of the master equation.
    integrator_counts
        Steps, evaluations and failed steps of the slider's integrator, if it has one.
    """

    def table(self, name: str) -> Dataset:
        """Rows recorded in a table up to now, with units.

        Parameters
        ----------
        name
            "trace" (samples at fixed intervals), "slips", "slip_trace" (finer samples around
            slips), "stages" (completed stages of the drive), "avalanches", "snapshot_events",
            "ruptures" and "fronts" (of an interface with a length).

        Returns
        -------
        xarray.Dataset
            A variable for each column, in SI units, with the attributes ``units`` and
            ``long_name``. Its dimension is ``time`` for the trace, and else one of ``slip``,
            ``sample``, ``stage``, ``avalanche``, ``snapshot``, ``rupture`` and ``front``.

        Raises
        ------
        RunError
            If there is no such table, or its columns have no names.
        """
        rows = self.records(name)
        import_xarray()
        import xarray as xr

        dimension = DIMENSIONS.get(name, "time")
        names = NAMES_IN_FILES.get(name, {})
        found = {}
        for column in rows.dtype.names or ():
            meaning = MEANINGS[name][names.get(column, column)]
            is_real = meaning.is_fractional and not self.config.contact_kind.is_discrete
            values = rows[column] if is_real else rows[column].astype(meaning.dtype)
            found[column] = (dimension, values, meaning.attributes)
        return xr.Dataset(found)
