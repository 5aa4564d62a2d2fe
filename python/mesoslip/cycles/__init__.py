"""Settled cycles of the master equation, and their branches over a parameter."""
