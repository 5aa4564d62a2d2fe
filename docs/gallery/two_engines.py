"""
From N contacts to infinitely many
==================================

With one key the same run is solved by the master equation, N → ∞. Under a prescribed slider N
contacts differ from it by about 0.2 N\\ :sup:`-1/2` of the static force.
"""

import matplotlib.pyplot as plt
import mesoslip
import numpy as np

klein = mesoslip.Config.load("klein.toml").replace(
    "slider.kind=prescribed",
    "contacts.threshold.relative_width=0.1",
    "run.duration=0.6 s",
    "output.interval=0.2 ms",
)
limit = mesoslip.run(klein.replace("run.engine=me"))["spring_force"].isel(realization=0)

figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.6), layout="constrained")
counts, errors = [30, 100, 1000, 10_000], []
for count in counts:
    tree = mesoslip.run(klein.replace({"contacts.count": count}, "run.realizations=4"))
    force = tree["spring_force"]
    errors.append(float(np.sqrt(((force - limit) ** 2).mean())) / klein.contacts.static_force)
    left.plot(force["time"], 1e6 * force.isel(realization=0), label=f"N = {count}", lw=1)
left.plot(limit["time"], 1e6 * limit, "k", label="N → ∞")
left.set(xlabel="time (s)", ylabel="force (µN)")
left.legend()
right.loglog(counts, errors, "o-", label="root mean square")
right.loglog(counts, 0.2 / np.sqrt(counts), "k--", label="0.2 N$^{-1/2}$")
right.set(xlabel="number of contacts", ylabel="difference over the static force")
right.legend()
