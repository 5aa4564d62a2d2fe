"""Short runs of every kind, for what must hold of all of them: some ten thousand events each."""

from collections.abc import Iterable
from itertools import combinations
from typing import Any

from conftest import drive_in_stages, klein_tables, long
from mesoslip import Config

# Fast loading of few contacts, so that slips and reversals come within some ten milliseconds.
FAST = {
    "run__duration": None,
    "drive": drive_in_stages((0.04, 1e-5), (0.01, 0.0), (0.05, -1e-5)),
    "contacts__count": 48,
    "contacts__threshold__relative_width": 0.1,
    "output__interval": 1e-3,
    "output__slip_interval": 1e-4,
}
PLACES = {"strength": 0.3, "lattice": "triangular", "columns": 8, "rows": 6}
RIGID = {"mass": 1.47e-3, "stiffness": 97.0, "damping_ratio": 0.2}
LAYERED = {"kind": "layered", "mass": 1.47e-3, "stiffness": 97.0, "layers": 3}
BASE = {"mass": 5e-3, "stiffness": 1e4, "damping": 10.0}
ROW = {
    "kind": "interface",
    "blocks": 4,
    "mass": 1.47e-3,
    "length": 1e-2,
    "bar_stiffness": 2000.0,
    "neighbour_damping": 500.0,
    "stiffness": 97.0,
    "damping_ratio": 0.2,
}
SNAPSHOTS = {"interaction": PLACES, "output__snapshots": [0.01, 0.03], "output__snapshot_size": 20}

# Contacts that grow stronger but for the strongest of them.
RELAX = {"law": "relax", "time": 3e-3, "young_force_ratio": 0.6, "young_relative_width": 0.3}
RAMPS = {
    "drive": {
        "stage": [
            {"duration": 0.04, "start_velocity": 0.0, "end_velocity": 2e-5},
            {"duration": 0.01, "hold": True},
            {"duration": 0.05, "start_velocity": 1e-5, "end_velocity": -2e-5},
        ]
    }
}
THERMAL = {
    "contacts__coupling": "equal",
    "contacts__thermal": {"rate": 1e4, "force_ratio": 0.05},
}
AGEING = {"contacts__coupling": "equal", "contacts__ageing": RELAX}

# Jumps and ramps of a force, with slips in between.
FORCE = {
    "slider": {"kind": "force", "mass": 1.47e-3, "damping": 50.0},
    "drive": {
        "stage": [
            {"duration": 0.04, "force": 1.2e-5},
            {"duration": 0.02, "start_force": 1.2e-5, "end_force": 2.0e-5},
            {"duration": 0.04, "force": -3e-6},
        ]
    },
}

TRACK = {"contacts__track": {"spread": 0.3, "length": 2e-9, "correlation": "exponential"}}
SMOOTH_TRACK = {"contacts__track": {"spread": 0.3, "length": 2e-9}}
KEEP = {"contacts__renewal": "keep"}
# A load that jumps, separates all contacts and brings them back; one that vibrates.
LOAD = {
    "load": {
        "normal_force": 2.0,
        "stage": [
            {"duration": 0.03, "normal_force": 3.0},
            {"duration": 0.04, "start_normal_force": 3.0, "end_normal_force": 0.8},
            {"duration": 0.005, "normal_force": 0.0},
            {"duration": 0.025, "start_normal_force": 0.0, "end_normal_force": 2.4},
        ],
    }
}
VIBRATING = {"load": {"normal_force": 1.0, "cycle": {"amplitude": 0.6, "frequency": 100.0}}}

ME = {"run__engine": "me"}
# Steps four times as long as by default, for master equations that take some tenths of a second.
COARSE = ME | {"run__resolution": 1.0}
RANDOM = {"contacts__delay_law": "exponential"}
NEWBORN = {"contacts__newborn_width": 0.05}
TABLE = {"contacts__threshold": {"law": "table", "samples": [2.0, 3.0, 3.5, 4.0, 3.0, 5.0]}}
# Rows in another order by break stretch than by threshold, with back force and newborn width.
STIFFNESSES = {
    "contacts__threshold": {
        "law": "table",
        "samples": [2.0, 3.0, 3.5, 4.0, 3.0, 5.0],
        "stiffnesses": [3.0, 2.0, 4.0, 2.5, 5.0, 1.5],
    },
    "contacts__coupling": "table",
}

KINDS: dict[str, dict[str, Any]] = {
    "rigid": {},
    "rigid, three realizations": {"run__realizations": 3, "contacts__coupling": "equal"},
    "rigid, steady": {"contacts__initial": "steady"},
    "rigid, bundle": {"contacts__reattach": False},
    "rigid, exponential delays": RANDOM,
    "rigid, exponential delays, me": RANDOM | ME,
    "rigid, newborn width": NEWBORN,
    "rigid, newborn width, me": NEWBORN | COARSE,
    "rigid, table": TABLE,
    "rigid, table, me": TABLE | ME,
    "rigid, stiffnesses": STIFFNESSES | NEWBORN,
    "rigid, stiffnesses, me": STIFFNESSES | ME,
    "rigid, track": TRACK,
    "rigid, keep, exponential delays": KEEP | RANDOM,
    "rigid, track, keep, newborn width": TRACK | KEEP | NEWBORN,
    "rigid, track, stiffnesses": SMOOTH_TRACK | STIFFNESSES,
    "rigid, track, me, newborn width": SMOOTH_TRACK | NEWBORN | COARSE,
    "rigid, ageing, track": TRACK | AGEING,
    "prescribed, ageing, track, me": TRACK
    | AGEING
    | {"run__engine": "me", "slider": {"kind": "prescribed"}},
    "rigid, thermal, track": TRACK | THERMAL,
    "prescribed, thermal, ageing, track": TRACK
    | AGEING
    | THERMAL
    | {"slider": {"kind": "prescribed"}},
    "quasistatic, lattice, track, keep": TRACK
    | KEEP
    | SNAPSHOTS
    | {"slider": {"kind": "quasistatic", "stiffness": 97.0}, "run__avalanches": 500},
    "rigid, lattice": SNAPSHOTS,
    "rigid, lattice, no delay": SNAPSHOTS | {"contacts__delay": 0.0},
    "rigid, me": ME,
    "rigid, ramps": RAMPS,
    "rigid, to a displacement": {"run__stop": {"displacement": 2.01e-7}},
    "rigid, to a slip": {"run__stop": {"slips": 1}},
    "rigid, to a steady state": {
        "drive": {"velocity": 1e-5},
        "run": {
            "duration": 0.2,
            "stop": {"steady": {"displacement": 1e-7, "blocks": 3, "tolerance": 0.3}},
        },
    },
    "rigid, ageing, ramps": AGEING | RAMPS,
    "prescribed, ramps": RAMPS | {"slider": {"kind": "prescribed"}},
    "prescribed, me, ramps": RAMPS | {"slider": {"kind": "prescribed"}, "run__engine": "me"},
    "layered, adams, ramps": RAMPS | {"slider": LAYERED | {"solver": {"method": "adams"}}},
    "quasistatic, ramps": RAMPS | {"slider": {"kind": "quasistatic", "stiffness": 97.0}},
    "prescribed": {"slider": {"kind": "prescribed"}},
    "prescribed, lattice": {"slider": {"kind": "prescribed"}} | SNAPSHOTS,
    "prescribed, me": {"slider": {"kind": "prescribed"}, "run__engine": "me"},
    "layered": {"slider": LAYERED | {"base": BASE}, "output__layers": True},
    "layered, lattice": {"slider": LAYERED} | SNAPSHOTS,
    "layered, me": {"slider": LAYERED, "run__engine": "me"},
    "layered, adams": {"slider": LAYERED | {"solver": {"method": "adams"}}},
    "layered, bdf": {"slider": LAYERED | {"solver": {"method": "bdf"}}},
    "interface": {"slider": ROW},
    "interface, both": {"slider": ROW | {"loading": "both", "top_stiffness": 50.0}},
    "interface, me": {"slider": ROW | {"blocks": 3}} | COARSE,
    "quasistatic": {"slider": {"kind": "quasistatic", "stiffness": 97.0}},
    "quasistatic, lattice": {"slider": {"kind": "quasistatic", "stiffness": 97.0}}
    | SNAPSHOTS
    | {"run__avalanches": 500},
    "quasistatic, force": {
        "slider": {"kind": "quasistatic"},
        "drive": {"force_rate": 1e-6},
        "contacts__reattach": False,
        "contacts__count": 2000,
    },
    "force": FORCE,
    "force, me": FORCE | COARSE,
    "force, thermal": FORCE | THERMAL,
    "rigid, thermal": THERMAL,
    "rigid, thermal, ramps": THERMAL | RAMPS,
    "prescribed, thermal": THERMAL | {"slider": {"kind": "prescribed"}},
    "prescribed, thermal, ramps": THERMAL | RAMPS | {"slider": {"kind": "prescribed"}},
    "layered, thermal": THERMAL | {"slider": LAYERED | {"base": BASE}},
    "layered, thermal, adams": THERMAL | {"slider": LAYERED | {"solver": {"method": "adams"}}},
    "quasistatic, thermal": THERMAL | {"slider": {"kind": "quasistatic", "stiffness": 97.0}},
    "rigid, thermal, me": THERMAL | COARSE,
    "rigid, thermal, me, newborn width": THERMAL
    | NEWBORN
    | RANDOM
    | COARSE
    | {"contacts__threshold__relative_width": 0.15},
    "prescribed, thermal, me, table": THERMAL
    | TABLE
    | {"run__engine": "me", "slider": {"kind": "prescribed"}},
    "layered, thermal, me": THERMAL | COARSE | {"slider": LAYERED | {"base": BASE}},
    "force, thermal, me": FORCE | THERMAL | COARSE,
    "rigid, thermal, ageing": AGEING | THERMAL,
    "prescribed, thermal, ageing, log": AGEING
    | THERMAL
    | {
        "slider": {"kind": "prescribed"},
        "contacts__ageing": {"law": "log", "time": 1e-4, "growth": 0.03},
    },
    "rigid, thermal, ageing, me": AGEING | THERMAL | COARSE,
    "rigid, ageing": AGEING,
    "rigid, ageing, weaker": AGEING
    | {"contacts__count": 200, "contacts__ageing": RELAX | {"young_force_ratio": 1.3}},
    # Contacts that fall and grow old leave two lists at once.
    "rigid, ageing, some weaker": AGEING
    | {
        "contacts__threshold__relative_width": 0.2448,
        "contacts__ageing": RELAX
        | {"time": 1e-3, "young_force_ratio": 1.0, "young_relative_width": 0.1},
    },
    "rigid, ageing, log": AGEING
    | {"contacts__ageing": {"law": "log", "time": 1e-4, "growth": 0.03}},
    "rigid, ageing, me": AGEING | ME,
    "prescribed, ageing": AGEING | {"slider": {"kind": "prescribed"}},
    "layered, ageing": AGEING | {"slider": LAYERED | {"base": BASE}},
    "quasistatic, ageing": AGEING
    | {
        "slider": {"kind": "quasistatic", "stiffness": 97.0},
        "contacts__count": 200,
        "contacts__ageing": RELAX | {"young_force_ratio": 0.9, "initial_age": 0.0},
    },
    "rigid, load": LOAD,
    "rigid, exponential delays, load": VIBRATING | RANDOM | NEWBORN,
    "prescribed, vibrating load": VIBRATING | {"slider": {"kind": "prescribed"}},
    "quasistatic, load": LOAD | {"slider": {"kind": "quasistatic", "stiffness": 97.0}},
    "layered, ageing, load": LOAD | AGEING | {"slider": LAYERED},
    "prescribed, ageing, load": VIBRATING | AGEING | {"slider": {"kind": "prescribed"}},
    "rigid, ageing, some weaker, load": LOAD
    | AGEING
    | {
        "contacts__threshold__relative_width": 0.2448,
        "contacts__ageing": RELAX | {"young_force_ratio": 1.0, "young_relative_width": 0.1},
    },
    "force, thermal, load": VIBRATING | FORCE | THERMAL,
    "prescribed, thermal, load": LOAD | THERMAL | {"slider": {"kind": "prescribed"}},
    "rigid, thermal, ageing, load": LOAD | AGEING | THERMAL,
    "rigid, me, load": LOAD | COARSE,
    "rigid, exponential delays, me, load": VIBRATING | RANDOM | COARSE,
    "prescribed, thermal, ageing, me, load": LOAD
    | AGEING
    | THERMAL
    | COARSE
    | {"slider": {"kind": "prescribed"}},
}

# Those between which outputs, and with them reports and pictures, differ.
DIFFERENT = {
    *("rigid", "rigid, three realizations", "rigid, bundle", "rigid, lattice", "rigid, me"),
    *("rigid, to a slip", "rigid, ageing, ramps", "prescribed, ramps", "layered", "layered, me"),
    *("quasistatic, lattice", "quasistatic, force", "force", "rigid, thermal"),
}


def configuration(kind: str, **changes: Any) -> Config:
    """The short run of a kind, with changes."""
    return Config.from_dict(klein_tables(**FAST | KINDS[kind] | changes))


def _pairs(kind: str) -> set[object]:
    """What is in a kind: words, and pairs of them."""
    words = kind.split(", ") if ", me" in kind else ["eq", *kind.split(", ")]
    return {*words, *map(frozenset, combinations(words, 2))}


def pairwise(kinds: Iterable[str]) -> list[Any]:
    """Kinds as parameters of a test, of which those are long whose pairs of words others have.

    ``make fuzz`` tests all. What breaks only where three come together is rare, and found there.
    """
    every, kept = list(kinds), set[str]()
    missing = set[object]().union(*map(_pairs, every))
    while missing:
        most = max(every, key=lambda one: len(_pairs(one) & missing))
        kept.add(most)
        missing -= _pairs(most)
    return [one if one in kept else long(one) for one in every]
