"""Plateaus of a record: between steps of the speed, of the load, or of the force itself."""
