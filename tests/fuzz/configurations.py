"""Configurations at random: of all kinds, and with whatever may be wrong with them.

Scales are drawn over decades, each by its ratio to another, so that most runs have slips, reversals
and ringing, and most are over in a tenth of a second.
"""

import math
from random import Random
from typing import Any

import tomli_w
from mesoslip.configuration.threshold_laws.table import law_cells

Tables = dict[str, Any]

# Most breaks of contacts, and most periods of the fastest rate, that a run is meant to have.
MOST_BREAKS = 6e3
MOST_PERIODS = 3e3

# Part of the configurations with thermal activation, and how often contacts then break in a run
# that bear no more than the back force.
THERMAL = 0.35
MOST_IDLE = 30.0
# Parts of those with delays of the exponential law, with a width of the force at attaching, and
# with a table of thresholds.
EXPONENTIAL = 0.3
NEWBORN = 0.2
TABLE = 0.2
# Part of tables with stiffnesses.
STIFFNESSES = 0.5
# Largest force on a slider without a spring, over the static force.
MOST_FORCE = 1.3
# Parts of those with a normal load, on a track, and with contacts that keep their thresholds.
LOAD, TRACK, KEEP = 0.4, 0.3, 0.15

MAX_WIDTH = {
    "gaussian": 1.0,
    "uniform": 0.577,
    "lognormal": 2.0,
    "weibull": 2.0,
    "exponential": 1.0,
}


def decades(random: Random, least: float, most: float) -> float:
    """A number between two powers of ten, its logarithm uniform; of few digits."""
    return float(f"{10 ** random.uniform(least, most):.3g}")


def _one_of(random: Random, **weights: float) -> str:
    return random.choices(list(weights), list(weights.values()))[0]


def draw(random: Random) -> Tables:
    """The tables of a configuration that is meant to run."""
    kind = _one_of(random, rigid=4, layered=3, prescribed=2, quasistatic=3, force=2)
    engine = "me" if kind != "quasistatic" and random.random() < 0.3 else "eq"
    contacts, interaction = _contacts(random, engine)
    force, stiffness = contacts["static_force"], contacts["stiffness"]
    slider = _slider(random, kind, stiffness)
    spring, mass = slider.get("stiffness", stiffness), slider.get("mass", 1e-3)
    rate = math.sqrt(spring / mass)
    if random.random() < 0.7:
        contacts["delay"] = decades(random, -3, 1.5) / rate
        if random.random() < EXPONENTIAL:
            contacts["delay_law"] = "exponential"
    if random.random() < 0.6:
        contacts |= {"area": decades(random, -14, -6), "film_thickness": 3.5e-9}
        contacts |= {"film_density": 956.0, "drag_rate": decades(random, 3, 14)}
    if interaction:
        contacts.setdefault("area", decades(random, -14, -6))
    run: Tables = {"engine": engine, "seed": random.randrange(2**63)}
    if engine == "eq" and random.random() < 0.3:
        run["realizations"] = random.randint(2, 4)
    if engine == "me" and random.random() < 0.5:
        run["resolution"] = round(random.uniform(0.1, 1.0), 2)
    tables: Tables = {"run": run, "slider": slider, "contacts": contacts}
    if interaction:
        tables["interaction"] = interaction
    stretch = force / stiffness
    speed = stretch * rate * decades(random, -3, 0.5)
    loading = 1.0 if kind == "prescribed" else 1 + stiffness / spring
    fastest = math.sqrt(stiffness * slider.get("layers", 1) / mass) + rate * slider.get("layers", 1)
    most = min(MOST_BREAKS / contacts["count"] * stretch / speed, MOST_PERIODS * 6 / fastest)
    duration = min(stretch * loading / speed * random.uniform(0.3, 5), most)
    if kind == "force":
        contacts["initial"] = "relaxed"
        most_path = MOST_BREAKS / contacts["count"] * stretch
        duration = min(duration, _sliding_time(slider, MOST_FORCE * force, most_path))
    _drive(random, tables, duration, speed)
    tables["output"] = _output(random, tables, duration)
    if not interaction.get("strength") and random.random() < THERMAL:
        contacts["coupling"] = "equal"
        contacts["threshold"].pop("stiffnesses", None)
        contacts["thermal"] = _thermal(random, contacts, speed / stretch, duration)
        if engine == "me" and contacts["initial"] == "uniform":
            contacts["initial"] = random.choice(["relaxed", "steady"])
        if not interaction and random.random() < 0.4:
            contacts["ageing"] = _ageing(random, contacts, duration)
    if contacts["initial"] != "steady" and "ageing" not in contacts and random.random() < NEWBORN:
        contacts["newborn_width"] = _newborn_width(random, contacts, engine)
    if random.random() < LOAD:
        tables["load"] = _load(random, duration, contacts["count"], is_constant=bool(interaction))
    is_alike = "thermal" not in contacts and "stiffnesses" not in contacts["threshold"]
    if random.random() < TRACK and (engine == "eq" or is_alike):
        contacts["track"] = _track(random, stretch)
    if random.random() < KEEP and engine == "eq":
        contacts["renewal"] = "keep"
    return tables


def _load(random: Random, duration: float, count: int, *, is_constant: bool) -> Tables:
    """A normal load, constant or in stages, cycles or a history; of 0 in some of them."""
    force = decades(random, -6, 3)

    def normal_force() -> float:
        return force * random.choice([1.0, 1.0, 0.0, random.uniform(0, 2)])

    what = "constant" if is_constant else _one_of(random, constant=1, stage=3, cycle=2, history=1)
    load: Tables = {"normal_force": force}
    if what == "stage":
        # Some loads end before the run, which is said, and holds.
        lengths = [duration * random.uniform(0.05, 0.6) for _ in range(random.randint(1, 5))]
        load["stage"] = [
            {"duration": one, "normal_force": normal_force()}
            if random.random() < 0.5
            else {
                "duration": one,
                "start_normal_force": normal_force(),
                "end_normal_force": normal_force(),
            }
            for one in lengths
        ]
        load["stage"][0] = {"duration": lengths[0], "normal_force": force}
    elif what == "cycle":
        amplitude = random.choice([1.0, random.uniform(0.01, 1)])
        cycles = min(random.uniform(0.2, 100), MOST_BREAKS / (count * amplitude))
        load["cycle"] = {"amplitude": amplitude * force, "frequency": cycles / duration}
        if random.random() < 0.5:
            load["cycle"]["phase"] = random.uniform(-3, 3)
    elif what == "history":
        times = [0.0, *sorted(duration * random.uniform(0.01, 1.2) for _ in range(4))]
        load["history"] = {"time": times, "normal_force": [normal_force() for _ in times]}
    return load


def _track(random: Random, stretch: float) -> Tables:
    """A strength along the track, over lengths from a fifth of the breaking stretch on."""
    return {
        "spread": random.choice([0.3, decades(random, -3, 0)]),
        "length": stretch * decades(random, -0.7, 2),
        "correlation": random.choice(["gaussian", "exponential"]),
    }


def _sliding_time(slider: Tables, force: float, path: float) -> float:
    """Time in which a block without contacts comes at least so far under a force."""
    mass, damping = slider["mass"], slider["damping"]
    return max(math.sqrt(2 * mass * path / force), mass * damping * path / force)


def _newborn_width(random: Random, contacts: Tables, engine: str) -> float:
    """A width that the engine takes."""
    most = 0.25
    if engine == "me":
        most = min(most, 2.9 * _width(contacts["threshold"]))
    return most * decades(random, -2, 0)


def _width(threshold: Tables) -> float:
    """Relative width of thresholds."""
    if threshold["law"] == "table":
        weights = threshold.get("weights")
        cells = law_cells(tuple(threshold["samples"]), weights and tuple(weights))
        return cells.relative_width
    return float(threshold["relative_width"])


def _thermal(random: Random, contacts: Tables, rate: float, duration: float) -> Tables:
    """Activation at rates around that of loading, by which no contact breaks all the time."""
    ratio = decades(random, -3, 0)
    exponent = (1 - contacts["back_force_ratio"]) / ratio
    most = math.log(MOST_IDLE / duration) + exponent
    logarithm = min(math.log(rate * decades(random, -4, 4)), most, math.log(1e24))
    return {"rate": float(f"{math.exp(logarithm):.3g}"), "force_ratio": ratio}


def _ageing(random: Random, contacts: Tables, duration: float) -> Tables:
    time = duration * decades(random, -3, 1)
    contacts["initial"] = "relaxed"
    if random.random() < 0.5:
        return {"law": "log", "time": time, "growth": decades(random, -3, -0.5)}
    # Young contacts that can attach, and are narrow enough.
    contacts["back_force_ratio"] = min(contacts["back_force_ratio"], 0.1)
    width = _width(contacts["threshold"])
    return {
        "law": "relax",
        "time": time,
        "young_force_ratio": round(random.uniform(0.5, 1.4), 2),
        "young_relative_width": width * random.uniform(0.3, 1.0),
    }


def _contacts(random: Random, engine: str) -> tuple[Tables, Tables]:
    interaction: Tables = {}
    count = round(10 ** random.uniform(0, 2.6))
    if engine == "eq" and random.random() < 0.4:
        lattice = random.choice(["triangular", "square"])
        columns, rows = random.randint(2, 16), 2 * random.randint(1, 8)
        strength = random.choice([0, decades(random, -3, 1)])
        interaction = {"strength": strength, "lattice": lattice, "columns": columns, "rows": rows}
        count = columns * rows
    contacts = {
        "count": count,
        "static_force": decades(random, -9, 2),
        "coupling": random.choice(["scaled", "equal"]),
        "initial": random.choice(["relaxed", "steady", "uniform"]),
        "back_force_ratio": random.choice([0.0, 0.1, round(random.uniform(0, 0.95), 2)]),
        "threshold": _threshold(random, engine),
    }
    if "stiffnesses" in contacts["threshold"]:
        contacts["coupling"] = "table"
    contacts["stiffness"] = contacts["static_force"] / decades(random, -10, -4)
    if random.random() < 0.1:
        contacts["reattach"] = False
    return contacts, interaction


def _threshold(random: Random, engine: str) -> Tables:
    if random.random() < TABLE:
        # Of thresholds that are all above most back forces, or of areas over decades.
        wide = random.random() < 0.3
        samples = [decades(random, -1, 1) if wide else 1 + random.random() for _ in range(4)]
        samples += random.choices(samples, k=random.randint(0, 4))
        threshold: Tables = {"law": "table", "samples": samples}
        if random.random() < 0.5:
            rest = [random.choice([0.0, 1.0, 3.5]) for _ in samples[2:]]
            threshold["weights"] = [1.0, 2.0, *rest]
        if random.random() < STIFFNESSES:
            # Neither of the first two rows, which have weights, is like the other.
            threshold["stiffnesses"] = [decades(random, -0.7, 0.7) for _ in samples]
        return threshold
    law = random.choice(list(MAX_WIDTH))
    width = min(decades(random, -4, 0.3), MAX_WIDTH[law])
    if engine == "me":
        width = max(width, 0.005)
    return {"law": law, "relative_width": width}


def _slider(random: Random, kind: str, contact_stiffness: float) -> Tables:
    slider: Tables = {"kind": kind}
    if kind == "prescribed":
        return slider
    if kind == "force":
        slider["mass"] = decades(random, -6, 1)
        slider["damping"] = math.sqrt(contact_stiffness / slider["mass"]) * decades(random, -2, 1.5)
        return slider
    slider["stiffness"] = contact_stiffness * decades(random, -2.5, 1)
    if kind == "quasistatic":
        return slider
    slider["mass"] = decades(random, -6, 1)
    if kind == "rigid":
        if random.random() < 0.8:
            slider["damping_ratio"] = random.choice([0.2, decades(random, -4, 1.5)])
        return slider
    rate = math.sqrt(slider["stiffness"] / slider["mass"])
    slider["layers"] = random.choice([1, 2, 3, random.randint(4, 20)])
    if random.random() < 0.5:
        slider["layer_damping"] = rate * decades(random, -3, 1)
    if random.random() < 0.4:
        slider["base"] = {
            "mass": slider["mass"] * decades(random, -1, 2),
            "stiffness": slider["stiffness"] * decades(random, -1, 2),
            "damping": rate * random.choice([0.0, decades(random, -2, 1)]),
        }
    if random.random() < 0.5:
        slider["solver"] = {
            "method": random.choice(["auto", "series", "adams", "bdf"]),
            "relative_tolerance": decades(random, -11, -4),
        }
    return slider


def _drive(random: Random, tables: Tables, duration: float, speed: float) -> None:
    """The drive, in stages with holds and reversals or not, and what ends the run."""
    run, slider, contacts = tables["run"], tables["slider"], tables["contacts"]
    if slider["kind"] == "force":
        tables["drive"] = _forces(random, contacts["static_force"], duration)
        if "stage" not in tables["drive"]:
            run["duration"] = duration
        return
    if slider["kind"] == "quasistatic" and random.random() < 0.25:
        del slider["stiffness"]
        contacts["reattach"] = random.random() < 0.3
        sign = random.choice([1, 1, -1])
        tables["drive"] = {"force_rate": sign * contacts["static_force"] / duration}
        if contacts["reattach"] or random.random() < 0.5:
            run["duration"] = duration * random.uniform(0.5, 1.5)
        return
    if random.random() < 0.55:
        tables["drive"] = {"velocity": random.choice([1, 1, 1, -1]) * speed}
    else:
        count = random.randint(1, 6)
        stages = [
            {
                "duration": duration / count * random.uniform(0.2, 2),
                "velocity": random.choice([1, 1, 0, 0, -1]) * speed * random.choice([1, 1, 3, 0.1]),
            }
            for _ in range(count)
        ]
        for stage in stages:
            if random.random() < 0.3:
                stage["start_velocity"] = stage.pop("velocity")
                stage["end_velocity"] = random.choice([1, 0, -1]) * speed
        tables["drive"] = {"stage": stages}
    ends = ["duration", "drive_displacement"]
    if slider["kind"] == "quasistatic" or "interaction" in tables:
        ends.append("avalanches")
    for end in random.sample(ends, random.choice([1, 1, 1, 2])):
        value = {"duration": duration, "drive_displacement": speed * duration, "avalanches": 0}[end]
        if end == "avalanches":
            run[end] = random.randint(1, 300)
        elif not {"duration", "drive_displacement"} & run.keys():
            run[end] = value


def _forces(random: Random, static_force: float, duration: float) -> Tables:
    """A force, one that grows, or jumps and ramps of it in stages."""

    def force() -> float:
        sign = random.choice([1, 1, 1, -1, 0])
        return sign * static_force * random.choice([random.uniform(0, MOST_FORCE), 0.6, 0.05])

    what = _one_of(random, force=1, rate=1, stages=2)
    if what == "force":
        return {"force": force()}
    if what == "rate":
        sign = random.choice([1, 1, -1])
        return {"force_rate": sign * random.uniform(0.3, MOST_FORCE) * static_force / duration}
    count = random.randint(1, 6)
    stages = [{"duration": duration / count * random.uniform(0.2, 1)} for _ in range(count)]
    for stage in stages:
        if random.random() < 0.5:
            stage["force"] = force()
        else:
            stage |= {"start_force": force(), "end_force": force()}
    return {"stage": stages}


def _output(random: Random, tables: Tables, duration: float) -> Tables:
    output: Tables = {}
    if random.random() < 0.7:
        output["interval"] = duration / decades(random, 0.5, 3.3)
        if random.random() < 0.7:
            output["slip_interval"] = output["interval"] / random.uniform(1, 30)
    if tables["slider"]["kind"] == "layered" and random.random() < 0.5:
        output["layers"] = True
    if "interaction" in tables and random.random() < 0.5:
        times = sorted({duration * random.uniform(0, 0.6) for _ in range(random.randint(1, 3))})
        output |= {"snapshots": times, "snapshot_size": random.randint(1, 20)}
    if (
        tables["slider"]["kind"] == "quasistatic" or "interaction" in tables
    ) and random.random() < 0.3:
        output["avalanche_size"] = random.randint(1, 5)
    return output


# What may stand at any key, and should not.
NASTY: tuple[Any, ...] = (
    *(0, -1, 1, 2, 3.5, 1e300, -1e300, 5e-324, 1e-30, 1e30, 2**31, 2**53, 2**63 - 1, 10**400),
    *(math.inf, -math.inf, math.nan, True, False, "", " ", "auto", "none", "rigid", "me"),
    *("1", "1 m", "1 s", "1 g", "1,5 s", "−1 s", "1 ± 2 s", "9**9**9 s", "1 s s", "1e999 m"),
    *("0.5 ms", "18 uN", "1 light_year", "1 1/s", "1/0 s", "nan s", "1 µm", "\x00", "é" * 300),
    *([], [0], [[]], [1.0, 2.0], ["1 s"], {}, {"a": 1}, [{}], [{"duration": 1.0, "velocity": 0}]),
)
UNITS = ("s", "ms", "m", "um", "kg", "g", "N", "uN", "N/m", "1/s", "m^2", "kg/m^3", "", "m/s")
UNKNOWN = ("mas", "stifness", "delay", "Duration", "base", "kind", "__class__", "a.b", "")


def places(tables: Any, outer: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """The keys of nested tables and lists, each as those that lead to it."""
    found = []
    items = tables.items() if isinstance(tables, dict) else enumerate(tables)
    for key, value in items:
        found.append((*outer, key))
        if isinstance(value, dict | list):
            found += places(value, (*outer, key))
    return found


def _table_of(tables: Any, place: tuple[Any, ...]) -> Any:
    for key in place[:-1]:
        tables = tables[key]
    return tables


def mutate(random: Random, tables: Tables) -> bytes:
    """The text of a configuration with some things changed, its text too, sometimes."""
    for _ in range(random.choice([1, 1, 2, 3])):
        all_places = places(tables)
        if not all_places:
            break
        place = random.choice(all_places)
        table, key = _table_of(tables, place), place[-1]
        value = table[key]
        what = _one_of(random, nasty=4, unit=2, scale=3, drop=2, unknown=1, swap=1)
        if what == "nasty":
            table[key] = random.choice(NASTY)
        elif what == "unit" and isinstance(value, float):
            table[key] = f"{value} {random.choice(UNITS)}"
        elif what == "scale" and isinstance(value, int | float):
            factor = random.choice([-1, 10.0, 1e3, 1e-3, 1e8, 1e-8, 1e100])
            table[key] = type(value)(value * factor) if abs(value) < 1e200 else value
        elif what == "drop":
            del table[key]
        elif what == "unknown" and isinstance(table, dict):
            table[random.choice(UNKNOWN)] = random.choice(NASTY)
        elif what == "swap":
            other = random.choice(all_places)
            if place[: len(other)] != other and other[: len(place)] != place:
                their = _table_of(tables, other)
                table[key], their[other[-1]] = their[other[-1]], value
    data = text(tables)
    if random.random() < 0.25:
        data = _spoil(random, data)
    return data


def _spoil(random: Random, data: bytes) -> bytes:
    """A text with some bytes changed, lines repeated, or its end missing."""
    for _ in range(random.choice([1, 1, 3, 10])):
        place = random.randrange(len(data) + 1)
        what = _one_of(random, byte=4, drop=3, insert=3, cut=1, repeat=1)
        if what == "byte":
            data = data[:place] + bytes([random.randrange(256)]) + data[place + 1 :]
        elif what == "drop":
            data = data[:place] + data[place + random.randint(1, 5) :]
        elif what == "insert":
            piece = random.choice([b"[", b"]", b"=", b'"', b"\n", b"#", b"9", b".", b"e", b"-"])
            data = data[:place] + piece * random.choice([1, 1, 2, 3000]) + data[place:]
        elif what == "cut":
            data = data[:place]
        else:
            data = data[:place] + data[max(0, place - 40) :]
    return data


def text(tables: Tables) -> bytes:
    """The tables as a file; what TOML cannot hold is left out."""
    return tomli_w.dumps(tables).encode("utf-8", "surrogateescape")
