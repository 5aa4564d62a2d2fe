"""Kinds of sliders: each is a `SliderTable` in a file of its own, named in `KINDS`."""

from __future__ import annotations

from collections.abc import Mapping
from functools import reduce
from operator import or_
from typing import TYPE_CHECKING, Annotated, Any, TypeAlias

from pydantic import Discriminator, Tag

from mesoslip.configuration.sliders.base import SliderTable
from mesoslip.configuration.sliders.force import ForceSlider
from mesoslip.configuration.sliders.interface import InterfaceSlider
from mesoslip.configuration.sliders.layered import LayeredSlider
from mesoslip.configuration.sliders.prescribed import PrescribedSlider
from mesoslip.configuration.sliders.quasistatic import QuasistaticSlider
from mesoslip.configuration.sliders.rigid import RigidSlider

KINDS: tuple[type[SliderTable], ...] = (
    RigidSlider,
    LayeredSlider,
    PrescribedSlider,
    QuasistaticSlider,
    ForceSlider,
    InterfaceSlider,
)

# By name; the first kind is the default.
SLIDERS: dict[str, type[SliderTable]] = {kind.model_fields["kind"].default: kind for kind in KINDS}
DEFAULT = next(iter(SLIDERS))


def _kind_of(table: Any) -> Any:
    """Name of the kind of a slider, or of a table of a file."""
    if isinstance(table, Mapping):
        return table.get("kind", DEFAULT)
    return getattr(table, "kind", DEFAULT)


# For type checkers a slider has the interface of all kinds.
if TYPE_CHECKING:
    Slider: TypeAlias = SliderTable
else:
    Slider = Annotated[
        reduce(or_, (Annotated[kind, Tag(name)] for name, kind in SLIDERS.items())),
        Discriminator(_kind_of),
    ]
