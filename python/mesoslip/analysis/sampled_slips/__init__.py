"""Slips in sampled, noisy traces of a force, by a rule without a model.

The rule, explained in `docs/fit.md`:

- Impulses and hum are removed, and noise by a running median, which keeps steps. It is as wide as
  the noise demands, and at most half as wide as the deep falls of the trace are long.
- A **fall** leads from a maximum to a minimum of alternating extremes that differ by more than a
  threshold. The threshold is the start of the first range of thresholds above the white noise in
  which the number of slips hardly changes; without one, it is above the range of all the noise.
- A fall that begins within half a period after the end of another, and reaches a lower force,
  belongs to it. The period is twice the duration of deep falls.
- A fall is a **slip** if it is more than twice as deep as the rise by ringing before it. A rise
  within three quarters of a period is ringing if it is faster than loading. Of a rise by loading a
  quarter counts. Oscillations that only decay are ringing too.
- A slip is steep: for its depth not much slower than the others, and not slower than the rise to
  its maximum. After a velocity step the force rises fast and decays slowly.
- Where slips are not much faster than the rises before them, as falls of correlated noise are, the
  threshold is above the range of all the noise, and slips must be many and most of the deep falls.
- A slip starts where the force is last near its maximum and ends at its minimum. A fall from the
  first sample on has no start and does not count.

The catalogues of runs follow a similar rule, with two more criteria that only a simulation has:
breaks of contacts, and the velocity of the slider.
"""

from mesoslip.analysis.sampled_slips.find import (
    FoundSlips,
    SlipCounts,
    estimated_period,
    find_slips,
)

__all__ = ["FoundSlips", "SlipCounts", "estimated_period", "find_slips"]
