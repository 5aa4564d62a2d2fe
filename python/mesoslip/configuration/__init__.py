"""The configuration of a run: its keys, and checks of their values."""
