"""Reports: pages about outputs."""
