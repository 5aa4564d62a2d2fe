"""Rate-and-state friction: laws fitted to records of runs and to measured traces."""
