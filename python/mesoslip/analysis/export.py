"""Outputs in the formats of other programs: Zarr, and slips as events of QuakeML."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

from mesoslip.analysis.slips import slips
from mesoslip.array_types import DataTree
from mesoslip.configuration.reading import PathLike, as_path
from mesoslip.errors import FileError
from mesoslip.output.inputs import OutputLike, as_output
from mesoslip.output.targets import written_whole
from mesoslip.output.zarr import write_zarr

# Amplitudes of a slip: variable, type, category of QuakeML, and its unit.
AMPLITUDES = (
    ("force_drop", "force drop", "other", "other"),
    ("peak_velocity", "peak velocity", "other", "m/s"),
    ("duration", "duration", "duration", "s"),
)
# A laboratory has no place on the Earth and no date.
START = "1970-01-01T00:00:00"
PLACE = (
    "A slip in a laboratory or in a simulation: latitude and longitude are 0, times count from "
    f"{START}."
)


def export(output: OutputLike, file: PathLike) -> None:
    """Write an output in the format of another program, by the ending of the file.

    Parameters
    ----------
    output
        An output of any command for Zarr; of a run, or a measured trace, for QuakeML.
    file
        ``.zarr``: the whole output as a Zarr store, a folder, which xarray reads; needs zarr.
        ``.xml``: the slips as events of QuakeML, which ObsPy reads; needs ObsPy.

    Raises
    ------
    FileError
        If the output cannot be read, the package of the format is not installed, or the file
        cannot be written.

    Examples
    --------
    >>> import mesoslip
    >>> path, *_ = mesoslip.example("klein")  # writes klein.toml
    >>> tree = mesoslip.run(mesoslip.Config.load(path, ["contacts.count=200"]))
    >>> mesoslip.export(tree, "klein.zarr")  # doctest: +SKIP
    """
    path = as_path(file)
    write = FORMATS.get(path.suffix.lower())
    if write is None:
        raise FileError(
            f"{path}: the ending of its name is not that of a format: .zarr (Zarr) or .xml "
            "(slips as QuakeML)"
        )
    write(as_output(output), path)


def write_quakeml(tree: DataTree, path: Path) -> None:
    """Write the slips of an output as QuakeML."""
    catalogue = event_catalogue(tree)
    with written_whole(path) as part:
        catalogue.write(str(part), format="QUAKEML")


def event_catalogue(tree: DataTree) -> Any:
    """The slips of an output as an ``obspy.core.event.Catalog``: origin times and amplitudes."""
    try:
        from obspy import UTCDateTime
        from obspy.core import event
    except ImportError:
        raise FileError(
            "QuakeML needs ObsPy, which is not installed: python -m pip install "
            "'mesoslip[quakeml]', or python -m pip install obspy"
        ) from None
    data = slips(tree)
    made = event.CreationInfo(
        author=str(tree.attrs.get("source", "mesoslip")), version=tree.attrs.get("commit")
    )

    def name(*parts: object) -> Any:
        return event.ResourceIdentifier("smi:local/mesoslip/" + "/".join(map(str, parts)))

    events = []
    for number in range(data.sizes["slip"]):
        one = data.isel(slip=number)
        start = one["start_time"].item()
        origin = event.Origin(
            resource_id=name("origin", number),
            time=UTCDateTime(START) + start,
            latitude=0.0,
            longitude=0.0,
            creation_info=made,
        )
        amplitudes = [
            event.Amplitude(
                resource_id=name("amplitude", number, variable),
                generic_amplitude=one[variable].item(),
                type=kind,
                category=category,
                unit=_unit(data[variable].attrs["units"], unit),
                comments=[
                    event.Comment(
                        text=f"{kind}, {data[variable].attrs['units']}",
                        resource_id=name("comment", number, variable),
                    )
                ],
            )
            for variable, kind, category, unit in AMPLITUDES
            if variable in data and math.isfinite(one[variable].item())
        ]
        realization = one["realization_index"].item()
        text = f"slip {number} (realization {realization})"
        events.append(
            event.Event(
                resource_id=name("event", number),
                event_type="other event",
                event_descriptions=[event.EventDescription(text=text)],
                comments=[event.Comment(text=PLACE, resource_id=name("comment", number))],
                origins=[origin],
                amplitudes=amplitudes,
                preferred_origin_id=origin.resource_id,
                creation_info=made,
            )
        )
    return event.Catalog(
        events, resource_id=name("catalogue"), description=tree.attrs.get("title", "")
    )


def _unit(units: str, known: str) -> str:
    """Unit of an amplitude: friction coefficients have none."""
    return "dimensionless" if units == "1" else known


FORMATS: dict[str, Callable[[DataTree, Path], None]] = {
    ".zarr": write_zarr,
    ".xml": write_quakeml,
}
