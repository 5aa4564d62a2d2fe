"""Measured traces as outputs: tables of measurements, and the slips in them."""
