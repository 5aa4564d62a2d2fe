"""
A map of regimes
================

A sweep over two keys, and the regime of each run. More realizations and finer axes take two
numbers; see the page on campaigns.
"""

import mesoslip

data = mesoslip.sweep(
    {
        "base": "klein.toml",
        "run": {"duration": "30 s"},
        "contacts": {"count": 200, "threshold": {"relative_width": 0.05}},
        "output": {"interval": "5 ms", "slip_interval": 0},
        "sweep": {
            "measures": ["regime", "mean_force"],
            "grid": {
                "contacts.delay": ["0.1 ms", "0.5 ms", "2 ms"],
                "slider.stiffness": {
                    "from": "50 N/m",
                    "to": "800 N/m",
                    "points": 4,
                    "spacing": "logarithmic",
                },
            },
        },
    }
)
mesoslip.plot(data, view="regime")

# %%
# The mean force falls where the slider sticks and slips.

mesoslip.plot(data, view="mean_force")

# %%
# The result is an xarray dataset, here as a table: 0 smooth, 1 stick-slip, 2 irregular,
# 3 transient.

data["regime"].isel(realization=0).to_pandas()
