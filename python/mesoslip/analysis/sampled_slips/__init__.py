"""Slips in sampled, noisy traces of a force, by a rule without a model.

A slip is a fall of the force that noise does not make, and that is faster than loading. The rule,
explained in `docs/traces.md`:

- Impulses and hum are removed. Running medians of several widths remove noise and keep steps; that
  is used whose number of slips, times the length of its plateau, is largest.
- A **fall** leads from a maximum to a minimum of alternating extremes that differ by more than a
  threshold. What rises just before it beyond loading is a rebound of the slip before, ringing, or
  an impulse: the fall has to exceed twice the rebound by the threshold. Falls at less than 0.02 of
  the rate of the deepest are creep, and those slower than half the rise before them are the
  response of smooth sliding: neither is a slip.
- The **noise** is measured by the trace mirrored in its line of loading, where noise makes as many
  steep falls as in the trace, and slips make none. The threshold is the smallest one at which the
  mirrored ones are less than 0.02 of the others. Those that are left at the end of a plateau of the
  number are no noise.
- The **record** has slips only if its falls, with those after rebounds, are faster than its rises,
  by the logarithm of the ratio of their durations, of mean 0 and standard deviation 0.85 in noise
  of any spectrum; or, in an oscillation, if its falls are more equal than those of noise. Both at
  three standard errors; the first at more for few falls.
  An oscillation that keeps the phase of a clock is hum.
- A minimum fall that is given is obeyed: all falls above it count but for rebounds.

A slip starts where the force is last near its maximum and ends at its minimum. A fall from the
first sample on has no start and does not count. The catalogues of runs follow a similar rule, with
two more criteria that only a simulation has: breaks of contacts, and the velocity of the slider.
"""

from mesoslip.analysis.sampled_slips.choice import SlipCounts
from mesoslip.analysis.sampled_slips.find import FoundSlips, estimated_period, find_slips
from mesoslip.analysis.sampled_slips.levels import Parts

__all__ = ["FoundSlips", "Parts", "SlipCounts", "estimated_period", "find_slips"]
