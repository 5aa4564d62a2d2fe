"""Measured traces: read from tables, with the slips found in them, as outputs."""
