"""Catalogues as seismologists read them: b-value, Omori's decay, and a second channel."""
