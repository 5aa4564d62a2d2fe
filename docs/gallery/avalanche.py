"""
An avalanche through a lattice of contacts
==========================================

Interacting contacts on a lattice. With strong interaction the first avalanche breaks nearly all of
them at one instant. On the left the lattice after it, nearly all grey: detached. On the right the
generations of the avalanche: it starts in the bright spot.
"""

import mesoslip

config = mesoslip.Config.load("klein.toml").replace(
    {
        "run.duration": "1.6 s",
        "contacts.stiffness": "200 N/m",
        "contacts.threshold.relative_width": 0.3,
        "interaction": {"strength": 0.3, "columns": 60, "rows": 68},
        "output.snapshot_size": 3000,
    }
)
tree = mesoslip.run(config)
mesoslip.plot(tree, view="lattice")

# %%
# The largest avalanche.

avalanches = mesoslip.avalanches(tree)
largest = avalanches.isel(avalanche=int(avalanches["size"].argmax("avalanche")))
print(f"{int(largest['size'])} breaks, {int(largest['generations'])} generations")
