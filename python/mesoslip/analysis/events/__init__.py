"""Catalogues as seismologists read them: b-value, Omori's decay, and a second channel."""

from mesoslip.analysis.events.channel import Emissions, emissions_of
from mesoslip.analysis.events.laws import BValue, Omori, b_value, omori
from mesoslip.analysis.events.summary import EventSummary, check_catalogue, events, events_of

__all__ = [
    "BValue",
    "Emissions",
    "EventSummary",
    "Omori",
    "b_value",
    "check_catalogue",
    "emissions_of",
    "events",
    "events_of",
    "omori",
]
