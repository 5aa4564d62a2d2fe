"""
Stick-slip in Klein's experiment
================================

A surface force balance: the spring is loaded until all contacts break, and the slider slips.
"""

import mesoslip

config = mesoslip.Config.load("klein.toml").replace("run.duration=6 s")
tree = mesoslip.run(config)
mesoslip.plot(tree)

# %%
# The first spike is the largest, as all contacts have the same age. The catalogue has the
# numbers of each slip.

slips = mesoslip.slips(tree)
columns = ["start_time", "force_before", "force_drop", "contacts_broken"]
slips[columns].to_dataframe().head()

# %%
# The third slip in close-up.

start = float(slips["start_time"][2])
mesoslip.plot(tree, start=start - 0.02, end=start + 0.1)
