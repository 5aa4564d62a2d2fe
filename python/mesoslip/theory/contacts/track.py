"""Theory of contacts whose strength varies along the track: that of its mean, and linear in w."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, ClassVar

from mesoslip.array_types import DataTree
from mesoslip.errors import ConfigError
from mesoslip.theory.contacts.base import ContactTheory
from mesoslip.theory.contacts.plain import PlainTheory
from mesoslip.theory.quantity import Quantity, named_quantities

if TYPE_CHECKING:
    from mesoslip.theory.linear_stability import LinearStability

# Units and meanings of derived quantities.
quantity = named_quantities("""
track_force_deviation | N | standard deviation of the force of slow sliding along the track, linear
    in its spread
""")


class TrackTheory(PlainTheory):
    """Plain contacts on a track (model section 18)."""

    features: ClassVar[frozenset[str]] = frozenset({"contacts.track"})
    kind_caveat: ClassVar[str] = "computed for the mean strength of contacts.track"

    def sliding(self, velocity: float | None = None) -> LinearStability:
        return ContactTheory.sliding(self, velocity)

    def check_steady_front(self) -> None:
        ContactTheory.check_steady_front(self)

    def curve_groups(self) -> dict[str, DataTree]:
        import xarray as xr

        from mesoslip.theory.track_response import TrackResponse, track_dataset

        try:
            return {"track": xr.DataTree(track_dataset(TrackResponse(self.config)))}
        except ConfigError:
            return {}

    def quantities(self) -> Iterator[Quantity]:
        from mesoslip.theory.track_response import TrackResponse

        yield from super().quantities()
        try:
            deviation = TrackResponse(self.config).force_deviation
        except ConfigError:
            return
        if math.isfinite(deviation):
            yield quantity("track_force_deviation", deviation)
