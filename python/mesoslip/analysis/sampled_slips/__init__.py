"""Slips in sampled, noisy traces of a force, by a rule without a model.
"""

from mesoslip.analysis.sampled_slips.choice import SlipCounts
from mesoslip.analysis.sampled_slips.find import FoundSlips, estimated_period, find_slips

__all__ = ["FoundSlips", "SlipCounts", "estimated_period", "find_slips"]
