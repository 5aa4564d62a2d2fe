"""The configuration of a run: what may stand in it, and whether it can be run."""
