"""Analysis of outputs: slips, avalanches, and their statistics."""
