"""Output files, and the same in memory."""
