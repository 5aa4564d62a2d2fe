"""
The force curve and its instability
===================================

For infinitely many contacts the force as a function of the displacement is the solution of a
renewal equation. Where it falls faster than the spring unloads, the slider is unstable.
"""

import matplotlib.pyplot as plt
import mesoslip
import numpy as np
from mesoslip.theory.force_curve import ForceCurve

config = mesoslip.Config.load("klein.toml").replace(
    "contacts.coupling=equal",
    "contacts.back_force_ratio=0",
    "contacts.threshold.relative_width=0.2",
)
curve = ForceCurve(config)
stretch = config.contacts.break_stretch
x = np.linspace(0, 6 * stretch, 600)

figure, axes = plt.subplots(layout="constrained")
axes.plot(1e9 * x, 1e6 * curve.force(x), label="F(X)")
for point in curve.critical_points[:1]:
    here = point.displacement
    line = curve.force(here) - config.spring_stiffness * (x - here)
    axes.plot(1e9 * x, 1e6 * line, "--", label="slope −K of the spring")
    axes.plot(1e9 * here, 1e6 * curve.force(here), "o", label="X_c")
axes.set(xlabel="displacement (nm)", ylabel="force (µN)", ylim=(0, None))
axes.legend()

# %%
# With a stiffer spring there is no instability.

print(f"K* = {curve.K_star[0]:.4g} N/m; the spring has {config.spring_stiffness:g} N/m")
