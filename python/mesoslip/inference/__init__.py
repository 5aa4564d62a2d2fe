"""Parameters from a trace, with their uncertainty."""
