"""What is read off outputs: slips, avalanches, and their statistics."""
