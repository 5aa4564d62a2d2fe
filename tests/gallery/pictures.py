"""Pictures of the gallery: the outputs that each shows, and options of ``mesoslip plot``."""


def _view(name: str, *options: str) -> tuple[str, ...]:
    return "--view", name, *options


VELOCITIES = ("velocity-1", "velocity-2", "velocity-5")
NARROW = ("--width", "aps-1", "--letters")

PICTURES: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "run": (("klein",), ()),
    "run-part": (("klein",), ("--from", "1.5 s", "--to", "2.5 s", "--x", "drive")),
    "run-several": (("several",), ()),
    "run-coarse": (("coarse",), ()),
    "run-no-slip": (("no-slip",), ()),
    "run-layered": (("layered",), ()),
    "run-quasistatic": (("quasistatic",), ()),
    "run-prescribed": (("prescribed",), ()),
    "run-load": (("load-step",), ()),
    "run-vibrating": (("vibrating",), ()),
    "run-track": (("track",), ()),
    "run-stages": (("velocity-step",), ()),
    "run-interface": (("precursors",), ()),
    "run-measured": (("paper",), ()),
    "run-narrow": (("klein",), NARROW),
    "compare-delay": (("klein", "long-delay"), ()),
    "compare-two-keys": (("klein", "long-delay", "stiff"), ()),
    "compare-engines": (("klein", "infinite"), ()),
    "compare-measured": (("paper", "klein"), ()),
    "avalanches": (("sizes",), _view("avalanches")),
    "avalanches-compared": (("sizes", "sizes-soft"), _view("avalanches")),
    "avalanches-bundle": (("bundle",), _view("avalanches")),
    "lattice": (("lattice",), _view("lattice")),
    "lattice-before": (("lattice",), _view("lattice", "--snapshot", "0")),
    "lattice-narrow": (("lattice",), _view("lattice", *NARROW)),
    "contacts": (("stretches",), _view("contacts", "--snapshot", "1")),
    "layers": (("layered",), _view("layers")),
    "return-map": (("irregular",), _view("return-map")),
    "bifurcation": (VELOCITIES, _view("bifurcation")),
    "response-step": (("velocity-step",), _view("response")),
    "response-steady": (("steady-force",), _view("response")),
    "response-holds": (("holds",), _view("response")),
    "response-creep": (("creep",), _view("response")),
    "response-ramps": (("ramps",), _view("response")),
    "response-measured": (("basalt",), _view("response")),
    "rates": (("rates",), ()),
    "strokes": (("reciprocating",), _view("strokes")),
    "strokes-disc": (("disc",), _view("strokes")),
    "strokes-loops": (("loops",), _view("strokes")),
    "stribeck": (("stribeck",), _view("stribeck")),
    "fronts": (("precursors",), _view("fronts")),
    "front-speeds": (("precursors",), _view("front-speeds")),
    "precursors": (("precursors",), _view("precursors")),
    "interface-stress": (("precursors",), _view("interface-stress")),
    "curve": (("curve",), ()),
    "curves": (("curve", "curve-narrow"), ()),
    "steady": (("steady",), ()),
    "onset": (("onset",), ()),
    "onset-wide": (("onset-wide",), ()),
    "onset-none": (("no-onset",), ()),
    "onsets": (("onset", "onset-wide"), ()),
    "cycle": (("cycle",), ()),
    "cycles": (("cycle", "cycle-slow"), ()),
    "branches": (("branches",), ()),
    "lyapunov": (("lyapunov",), ()),
    "sweep-line": (("sweep-line",), ()),
    "sweep-line-regime": (("sweep-line",), _view("regime")),
    "sweep-one": (("sweep-one",), ()),
    "sweep-map": (("sweep-map",), ()),
    "sweep-map-period": (("sweep-map",), _view("period")),
    "sweep-three": (("sweep-three",), _view("mean_peak_force")),
    "sweep-up-down": (("sweep-up-down",), ()),
    "sweep-hypercube": (("sweep-hypercube",), ()),
    "sweep-narrow": (("sweep-map",), NARROW),
    "fit": (("fit",), ()),
    "fit-narrow": (("fit",), NARROW),
    "misfit": (("fit",), _view("misfit")),
    "misfit-narrow": (("fit",), _view("misfit", *NARROW)),
    "strokes-narrow": (("reciprocating",), _view("strokes", *NARROW)),
    "response-narrow": (("holds",), _view("response", *NARROW)),
    "response-measured-narrow": (("basalt",), _view("response", *NARROW)),
    "avalanches-narrow": (("sizes",), _view("avalanches", *NARROW)),
    "run-nature": (("klein",), ("--width", "nature-2", "--letters")),
}

# Movies: an output, and the view of it.
MOVIES = {
    "movie-lattice": ("lattice", "lattice"),
    "movie-layers": ("layered", "layers"),
    "movie-contacts": ("stretches", "contacts"),
    "movie-fronts": ("precursors", "fronts"),
}

# Reports: outputs.
REPORTS = {"report": ("several", "coarse"), "report-sweep": ("sweep-line",)}
