"""
Velocity steps and holds
========================

The tests of rate-and-state friction on a smooth slider: what the force does after a step of the
velocity, and after a hold.
"""

import mesoslip

config = mesoslip.Config.load("klein.toml").replace(
    {
        "slider.kind": "prescribed",
        "contacts.count": 2000,
        "contacts.delay": "50 ms",
        "contacts.threshold.relative_width": 0.3,
        "contacts.initial": "steady",
        "run.engine": "me",
        "run.duration": None,
        "output.interval": "5 ms",
        "drive": {
            "stage": [
                {"velocity": "0.1 um/s", "duration": "1 s"},
                {"velocity": "1 um/s", "duration": "0.5 s"},
                {"velocity": "0.1 um/s", "duration": "1 s"},
                {"hold": True, "duration": "1 s"},
                {"velocity": "0.1 um/s", "duration": "1 s"},
            ]
        },
    }
)
tree = mesoslip.run(config)
mesoslip.plot(tree, view="response")

# %%
# What each stage came to.

steady = mesoslip.response(tree, fit=False)["steady"].to_dataset()
columns = ["stage_number", "velocity", "steady_force", "steady_force_error", "is_steady"]
steady[columns].to_dataframe()
