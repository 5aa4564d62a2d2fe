"""Catalogues as seismologists read them: b-value, Omori's decay, and a second channel."""

from mesoslip.analysis.events.channel import Emissions, emissions_of
from mesoslip.analysis.events.laws import BValue, Omori, b_value, omori
from mesoslip.analysis.events.summary import CATALOGUES, EventSummary, events, events_of

__all__ = [
    "CATALOGUES",
    "BValue",
    "Emissions",
    "EventSummary",
    "Omori",
    "b_value",
    "emissions_of",
    "events",
    "events_of",
    "omori",
]
