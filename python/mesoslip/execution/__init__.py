"""Pieces of work: executors that run them, a store of those that are finished, a stop."""
