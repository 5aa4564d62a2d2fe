"""Sweeps: many runs, and the measures of each."""
