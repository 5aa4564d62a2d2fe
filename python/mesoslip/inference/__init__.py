"""Bayesian estimates of parameters from a trace."""
