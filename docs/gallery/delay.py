"""
The effect of the delay
=======================

Without a delay before a broken contact attaches again, slips decay and sliding becomes smooth;
with a delay the slider sticks and slips, and the slips grow with the delay. Stiffness and
thresholds are the same.
"""

import matplotlib.pyplot as plt
import mesoslip

klein = mesoslip.Config.load("klein.toml").replace(
    "run.duration=20 s", "contacts.count=1000", "contacts.threshold.relative_width=0.05"
)
figure, panels = plt.subplots(3, 1, sharex=True, figsize=(6.4, 6.4), layout="constrained")
for panel, delay in zip(panels, ["0 s", "0.5 ms", "5 ms"], strict=True):
    tree = mesoslip.run(klein.replace({"contacts.delay": delay}))
    verdict = mesoslip.regime(tree)["regime"]
    meanings = verdict.flag_meanings.replace("_", "-").split()
    names = dict(zip(verdict.flag_values, meanings, strict=True))
    force = tree["spring_force"].isel(realization=0)
    panel.plot(force["time"], 1e6 * force)
    panel.set(ylabel="spring force (µN)", title=f"delay {delay}: {names[int(verdict[0])]}")
panels[-1].set_xlabel("time (s)")
