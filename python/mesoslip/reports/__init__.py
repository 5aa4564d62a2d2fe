"""Reports: pages about outputs."""

# Loads matplotlib without a file of the current folder.
import mesoslip.plots  # noqa: F401
