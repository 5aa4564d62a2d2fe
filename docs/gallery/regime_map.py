"""
A map of regimes
================

A sweep over two keys, with the regime of each run: 0 smooth, 1 stick-slip, 2 irregular,
3 transient. More realizations and finer axes take two numbers; see the page on campaigns.
"""

import mesoslip

data = mesoslip.sweep(
    {
        "base": "klein.toml",
        "run": {"duration": "15 s"},
        "contacts": {"count": 200, "threshold": {"relative_width": 0.05}},
        "output": {"interval": "5 ms", "slip_interval": "5 ms"},
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
print(data["regime"].isel(realization=0).to_pandas())

# %%
# The result is an xarray dataset, with xarray's methods for pictures.

_ = (
    data["mean_force"]
    .isel(realization=0)
    .plot.line(x="slider.stiffness", hue="contacts.delay", marker="o", xscale="log")
)
