"""Speeds of fronts over prestress and drag, of runs and of steady fronts: docs/front-speeds.png.

Needs out/docs/front-types.nc, the sweep of runs/maps/front-types.toml.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import mesoslip
import numpy as np
import xarray as xr

ROOT = Path(__file__).parents[2]
# Drag of a whole row at its impedance, blocks (k_b m_b)^(1/2) [N s/m].
IMPEDANCE = 1e4

data = xr.open_dataset(ROOT / "out/docs/front-types.nc").isel(realization=0)
base = mesoslip.Config.load(ROOT / "runs/front-types.toml")
ratios = np.concatenate([np.geomspace(4e-3, 0.4, 12), 1 - np.geomspace(0.5, 0.02, 8)])
figure, axes = plt.subplots(figsize=(6.4, 4.4), layout="constrained")
for number, (drag, runs) in enumerate(data.groupby("contacts.drag")):
    color = plt.get_cmap("viridis")(number / data.sizes["contacts.drag"])
    front = mesoslip.SteadyFront(base.replace({"contacts.drag": drag}))
    axes.loglog(ratios, front.speed(ratios) / front.sound_velocity, color=color)
    is_arrested = runs["front_type"] == 0
    for which, marker in ((is_arrested, "x"), (~is_arrested, "o")):
        axes.plot(
            runs["front_prestress"].where(which),
            runs["front_speed_ratio"].where(which),
            marker,
            markersize=4,
            color=color,
            label=f"{drag / IMPEDANCE:.2g}" if marker == "o" else None,
        )
axes.plot(ratios, (1 - ratios**2) ** -0.5, "k--", label="no drag, stiff")
axes.set(xlabel="stress over strength ahead", ylabel="speed over that of sound", ylim=(1e-4, 8))
axes.legend(title="drag over impedance", fontsize="small", ncols=2)
figure.savefig(ROOT / "docs/front-speeds.png", dpi=150)
