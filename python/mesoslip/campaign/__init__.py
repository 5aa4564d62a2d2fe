"""Campaigns: many runs from one file, their measures in one dataset."""
