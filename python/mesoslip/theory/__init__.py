"""Predictions for a configuration that need no simulation."""
