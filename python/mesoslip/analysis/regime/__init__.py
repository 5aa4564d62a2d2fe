"""The regime of motion in an output: smooth, stick-slip, irregular or transient.

It is determined from the spring force in the evaluated window: the second half of the last stage in
which the drive moves; the first half counts as transient. ``docs/regimes.md`` explains the rules
and reports their validation.
"""
