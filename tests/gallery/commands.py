"""Outputs of the gallery: the arguments of commands, without their program and their output.

They are small: the pictures matter here, not the physics.
"""

Arguments = tuple[str, ...]


def _changed(command: str, file: str, *changes: str) -> Arguments:
    return command, file, *(one for change in changes for one in ("--set", change))


KLEIN = "runs/klein.toml"
SHORT = ("run.duration=4 s", "output.slip_interval=0.2 ms")
FEW = ("contacts.count=300", *SHORT)
# The configuration of regular stick-slip in tests/python/test_cycle.py.
REGULAR = (
    *("run.engine=me", "contacts.delay=2 ms", "contacts.threshold.relative_width=0.1"),
    *("slider.damping_ratio=1", "drive.velocity=3 um/s"),
)
LATTICE = "interaction={strength=0.3, lattice='triangular', columns=24, rows=26}"
SMALL_LATTICE = ("contacts.count=624", LATTICE)

RUNS: dict[str, Arguments] = {
    "klein": _changed("run", KLEIN, "run.duration=4 s"),
    "long-delay": _changed("run", KLEIN, "run.duration=4 s", "contacts.delay=2 ms"),
    "stiff": _changed("run", KLEIN, "run.duration=4 s", "slider.stiffness=400 N/m"),
    "several": _changed("run", KLEIN, *FEW, "run.realizations=5"),
    "coarse": _changed("run", KLEIN, *FEW, "output.interval=4 ms", "output.slip_interval=0"),
    "no-slip": _changed("run", KLEIN, *FEW, "run.duration=0.5 s"),
    "infinite": _changed(
        "run",
        KLEIN,
        "run.engine=me",
        "run.duration=4 s",
        "run.resolution=1",
        "output.interval=1 ms",
    ),
    "layered": _changed(
        *("run", KLEIN, *FEW, "run.duration=2.2 s", "slider.kind=layered", "slider.layers=12"),
        *("output.layers=true", "output.interval=0.2 ms"),
    ),
    "quasistatic": _changed("run", KLEIN, *FEW, "slider.kind=quasistatic"),
    "prescribed": _changed("run", KLEIN, *FEW, "slider.kind=prescribed", "run.duration=1 s"),
    "lattice": _changed(
        "run", "runs/avalanche.toml", *SMALL_LATTICE, "output.snapshot_size=200", "run.duration=3 s"
    ),
    "sizes": _changed(
        "run", "runs/source/sizes-200.toml", "contacts.count=3000", "run.avalanches=20000"
    ),
    "sizes-soft": _changed(
        "run", "runs/source/sizes-20.toml", "contacts.count=3000", "run.avalanches=20000"
    ),
    "bundle": _changed("run", "runs/bundle.toml", "contacts.count=20000", "run.realizations=2"),
    "stretches": _changed(
        "run", KLEIN, *FEW, "run.duration=1.95 s", "output.snapshots=['1.7 s', '1.85 s', '1.93 s']"
    ),
    "irregular": _changed(
        "run", KLEIN, *FEW, "run.duration=20 s", "contacts.delay=2 ms", "drive.velocity=2 um/s"
    ),
    "velocity-step": _changed("run", "runs/velocity-step.toml", "contacts.count=4000"),
    "steady-force": _changed("run", "runs/steady-force.toml", "contacts.count=500"),
    "holds": _changed("run", "runs/slide-hold-slide.toml", "contacts.count=2000"),
    "creep": _changed("run", "runs/creep-force.toml", "contacts.count=1000"),
    "ramps": _changed(
        "run", "runs/static-friction-rate.toml", "contacts.count=200", "run.realizations=2"
    ),
    "load-step": _changed("run", "runs/load-step.toml", "contacts.count=1000"),
    "vibrating": _changed("run", "runs/vibrating-load.toml", "contacts.count=500"),
    "track": _changed("run", "runs/track.toml", "contacts.count=200", "output.slip_interval=1 ms"),
    "loops": _changed("run", "runs/pre-sliding.toml", "contacts.count=500"),
    "precursors": _changed("run", "runs/precursors.toml", "contacts.count=480"),
    "paper": ("trace", "runs/measured/paper-k1002-v42.toml"),
    "basalt": ("trace", "runs/measured/basalt-step.toml"),
    "disc": ("trace", "runs/measured/pin-on-disc.toml"),
    "reciprocating": ("trace", "runs/measured/reciprocating.toml"),
    "stribeck": ("trace", "runs/measured/stribeck.toml"),
    "rates": ("response", "{folder}/basalt.nc", "--posterior", "--law", "slip"),
    "curve": ("curve", "runs/source/S18.toml"),
    "curve-narrow": _changed(
        "curve", "runs/source/S18.toml", "contacts.threshold.relative_width=0.05"
    ),
    "steady": ("curve", "runs/velocity-step.toml"),
    "onset": ("onset", "runs/source/S19a.toml"),
    "onset-wide": ("onset", "runs/source/S19b.toml"),
    "no-onset": _changed("onset", KLEIN, "slider.stiffness=1e6 N/m"),
    "cycle": _changed("cycle", KLEIN, *REGULAR),
    "cycle-slow": _changed("cycle", KLEIN, *REGULAR, "contacts.delay=4 ms"),
    "branches": (
        *_changed("cycle", KLEIN, *REGULAR, "run.resolution=1"),
        *("--continue", "drive.velocity=3 um/s:30 um/s:4"),
    ),
    "lyapunov": (
        *_changed("lyapunov", KLEIN, *FEW, "drive.velocity=2 um/s", "contacts.delay=2 ms"),
        *("--follow", "2 s", "--twins", "4"),
    ),
    "experiment": _changed(
        *("run", "runs/fit/experiment.toml", "contacts.count=150", "run.duration=4 s"),
        *("output.interval=2 ms", "output.slip_interval=0"),
    ),
}
RUNS |= {
    f"velocity-{speed}": _changed("run", KLEIN, *FEW, f"drive.velocity={speed} um/s")
    for speed in (1, 2, 5)
}

# Sweeps and a fit: files that are written beside their outputs.
QUICK = """
base = "{root}/runs/klein.toml"
title = "{title}"
[run]
duration = "{duration}"
[contacts]
count = 200
[output]
interval = "2 ms"
slip_interval = "2 ms"
[sweep]
"""
FILES: dict[str, tuple[str, str]] = {
    "sweep-line": (
        "sweep",
        QUICK.format(title="Period and forces over the velocity", duration="6 s", root="{root}")
        + """
realizations = 4
measures = ["regime", "period", "mean_force", "mean_peak_force", "relative_amplitude"]
[sweep.grid]
"drive.velocity" = { from = "0.1 um/s", to = "5 um/s", points = 6, spacing = "logarithmic" }
""",
    ),
    "sweep-one": (
        "sweep",
        QUICK.format(title="One realization over the delay", duration="6 s", root="{root}")
        + """
measures = ["period", "mean_peak_force", "mean_slip_duration"]
[sweep.grid]
"contacts.delay" = ["0.1 ms", "0.5 ms", "2 ms", "10 ms"]
""",
    ),
    "sweep-map": (
        "sweep",
        QUICK.format(title="Delay and stiffness", duration="8 s", root="{root}")
        + """
measures = ["regime", "period", "relative_amplitude", "growth_rate", "critical_stiffness_ratio"]
[sweep.grid]
"contacts.delay" = { from = "0.05 ms", to = "5 ms", points = 6, spacing = "logarithmic" }
"slider.stiffness" = { from = "50 N/m", to = "20 kN/m", points = 6, spacing = "logarithmic" }
""",
    ),
    "sweep-three": (
        "sweep",
        QUICK.format(title="Three keys", duration="3 s", root="{root}")
        + """
measures = ["mean_peak_force"]
[sweep.grid]
"contacts.threshold.relative_width" = [0.01, 0.1]
"contacts.delay" = ["0.1 ms", "0.5 ms", "2 ms"]
"slider.stiffness" = ["60 N/m", "97 N/m", "150 N/m"]
""",
    ),
    "sweep-up-down": (
        "sweep",
        QUICK.format(title="Up and down the velocity", duration="0.5 s", root="{root}")
        + """
measures = ["regime", "force_amplitude", "mean_waiting_time"]
continue = "drive.velocity"
order = "up and down"
[sweep.grid]
"drive.velocity" = { from = "2 um/s", to = "60 um/s", points = 7, spacing = "logarithmic" }
""",
    ),
    "sweep-hypercube": (
        "sweep",
        QUICK.format(title="Points all over two keys", duration="6 s", root="{root}")
        + """
measures = ["regime", "mean_peak_force"]
[sweep.latin_hypercube]
points = 12
"contacts.delay" = { from = "0.1 ms", to = "10 ms", spacing = "logarithmic" }
"contacts.static_force" = { from = "10 uN", to = "30 uN" }
""",
    ),
    "fit": (
        "fit {folder}/experiment.nc",
        """
base = "{root}/runs/klein.toml"
title = "A fit of three parameters"
[run]
duration = "4 s"
[contacts]
count = 150
[output]
interval = "2 ms"
slip_interval = 0
[fit]
simulations = 300
[fit.free]
"contacts.static_force" = { from = "10 uN", to = "50 uN", prior = "logarithmic" }
"contacts.delay" = { from = "0.2 ms", to = "4 ms", prior = "logarithmic" }
"slider.stiffness" = { from = "60 N/m", to = "300 N/m", prior = "logarithmic" }
""",
    ),
}

# Runs of the source's figures: fewer contacts, shorter where figures need not be long.
SOURCE: dict[str, tuple[str, ...]] = {
    "S20": ("contacts.count=300",),
    "S21": ("contacts.count=300",),
    **{f"S19{one}": ("contacts.count=300",) for one in "ab"},
    **{f"S19{one}-me": ("run.resolution=1",) for one in "ab"},
    **{
        f"S22{one}": ("contacts.count=100", "run.duration=40 s", "output.slip_interval=5 ms")
        for one in "abcd"
    },
    **{f"S23{one}": ("contacts.count=300",) for one in "abc"},
    **{f"S24{one}": ("contacts.count=300", "run.duration=2.2 s") for one in "ab"},
    **{
        f"S25{one}": ("contacts.count=320", "interaction.columns=20", "interaction.rows=16")
        for one in "abcd"
    },
    **{f"S28{one}": ("contacts.count=300",) for one in "abc"},
    "limit-me": ("run.resolution=1",),
    **{f"limit-{power}": (f"contacts.count={10 ** (power - 1)}",) for power in range(2, 7)},
    **{f"sizes-{one}": ("contacts.count=3000", "run.avalanches=20000") for one in (20, 200, 2000)},
}
