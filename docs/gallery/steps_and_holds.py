"""
Velocity steps and holds
========================

Contacts that strengthen with the logarithm of their age: the force is lower at a higher velocity,
and peaks after a hold, the more the longer the hold. The red line is the rate-and-state law that
fits best: it describes the steps, but not holds of all durations.
"""

import mesoslip

config = mesoslip.Config.load("klein.toml").replace(
    {
        "slider.kind": "prescribed",
        "contacts.coupling": "equal",
        "contacts.back_force_ratio": 0.0,
        "contacts.initial": "steady",
        "contacts.threshold": {"law": "weibull", "relative_width": 0.7},
        "contacts.ageing": {"law": "log", "time": "1 ms", "growth": 0.1},
        "run.engine": "me",
        "run.duration": None,
        "output.interval": "5 ms",
        "drive": {
            "stage": [
                {"velocity": "0.1 um/s", "duration": "2 s"},
                {"velocity": "1 um/s", "duration": "0.2 s"},
                {"velocity": "0.1 um/s", "duration": "2 s"},
                {"hold": True, "duration": "0.2 s"},
                {"velocity": "0.1 um/s", "duration": "2 s"},
                {"hold": True, "duration": "2 s"},
                {"velocity": "0.1 um/s", "duration": "2 s"},
                {"hold": True, "duration": "20 s"},
                {"velocity": "0.1 um/s", "duration": "2 s"},
            ]
        },
    }
)
tree = mesoslip.run(config)
mesoslip.plot(tree, view="response")

# %%
# Steady forces of the stages that move.

steady = mesoslip.response(tree, fit=False)["steady"].to_dataset()
columns = ["stage_number", "velocity", "steady_force", "steady_force_error", "is_steady"]
steady[columns].to_dataframe()
