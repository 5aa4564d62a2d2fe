"""Simulations: realizations of a configuration, advanced side by side."""
