"""
A map of regimes
================

A sweep over two keys, and what each run shows: 0 smooth, 1 stick-slip, 2 irregular, 3 transient.
More realizations and finer axes are a matter of two numbers; see the page on campaigns.
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
# The dataset is xarray's, and so are its pictures.

_ = (
    data["mean_force"]
    .isel(realization=0)
    .plot.line(x="slider.stiffness", hue="contacts.delay", marker="o", xscale="log")
)
