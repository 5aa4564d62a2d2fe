"""
Slips in a measurement
======================

Paper on paper: a slider of 30.7 g on a spring of 1002 N/m, pulled at 42 µm/s. The trace is
digitized, and has impulses, which are removed for the slips and marked here. The file describes
columns, weight, spring and drive; ``mesoslip example measured/paper-k1002-v42`` writes it with
the data.

Data: Colas, Pustelnik, Oliver, Abry, Géminard, Vidal, *Nonlinear denoising for solid friction
dynamics characterization*, Physical Review E (2019); repository npusteln/stickslip, CeCILL-B.
"""

import mesoslip

tree = mesoslip.read_trace("paper-k1002-v42.toml", end="205 s")
mesoslip.plot(tree)

# %%
# The slips, and how the force grew before each.

columns = ["start_time", "force_drop", "duration", "loading_stiffness", "creep_share"]
mesoslip.slips(tree)[columns].to_dataframe()
