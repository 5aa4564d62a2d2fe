"""First slip of a film that melts as a whole, and of contacts: ``docs/melting-film.png``.

Slip time and share of detached contacts against the viscosity, for delays from 0.5 ms to one after
which nothing attaches within the slip; prints the tables of ``docs/melting-film.md``::

    .venv/bin/python tests/studies/melting_film.py [figure]
"""

import sys
from pathlib import Path

import mesoslip
import numpy as np
from mesoslip import Config
from mesoslip.theory.derived import derived
from numpy.typing import NDArray

Array = NDArray[np.float64]

ROOT = Path(__file__).parents[2]
KLEIN = ROOT / "runs" / "klein.toml"
BULK = 2e11
RATIOS = 10 ** np.arange(0, 7.01, 0.5)
TABLE = (1e0, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7)
DELAYS = {0.5e-3: "tab:blue", 5e-3: "tab:orange", 20e-3: "tab:green", 1.0: "tab:red"}
FILM, CONTACTS = "film", "4080 contacts"
# The lowest force is looked for this long after the maximum [s]; the slip time is that of this part
# of the drop, as the rest of a drop is ringing or creep.
WINDOW, PART = 0.5, 0.9
# A drop that is less is no slip [F_s].
MIN_DROP = 0.1


def case(kind: str, delay: float, ratio: float) -> Config:
    """Klein's case with equal stiffness, as one contact without dispersion or as many."""
    count, width = (1, 1e-6) if kind == FILM else (4080, 0.01)
    return Config.load(
        KLEIN,
        [
            "contacts.coupling=equal",
            {
                "run.duration": 2.5,
                "contacts.count": count,
                "contacts.threshold.relative_width": width,
                "contacts.delay": delay,
                "contacts.drag_rate": BULK * ratio,
                "output.interval": 2e-5,
            },
        ],
    )


def fall(time: Array, force: Array, share: Array) -> tuple[float, float, float]:
    """Slip time [s], drop [F_s] and mean share of detached contacts of the first slip.

    The slip is the fall after the first maximum that is followed by a drop; NaN if there is none.
    """
    start = int(np.argmax(force))
    later = slice(start, start + int(WINDOW / (time[1] - time[0])))
    drop = force[start] - force[later].min()
    if drop < MIN_DROP:
        return np.nan, drop, np.nan
    end = start + int(np.argmax(force[later] < force[start] - PART * drop))
    return time[end] - time[start], drop, share[start : end + 1].mean()


def measure(kind: str, delay: float, ratio: float) -> tuple[float, float, float]:
    """As `fall`, of the first slip of a run."""
    config = case(kind, delay, ratio)
    tree = mesoslip.run(config)
    time = tree["time"].values
    begins = time < 1.95  # the slips that follow start later
    force = tree["spring_force"].values[0] / config.contacts.static_force
    share = tree["detached_contacts"].values[0] / config.contacts.count
    peak = np.where(begins, force, -np.inf)
    start = int(np.argmax(peak))
    return fall(time[start:], np.minimum(force[start:], force[start]), share[start:])


def melted(ratio: float) -> tuple[float, float]:
    """Slip time of S47 as in `fall`, and the estimate β/Ω_S [s]; NaN if there is none."""
    tree = mesoslip.onset(case(CONTACTS, 1.0, ratio))
    if "melting" not in tree.children:
        return np.nan, np.nan
    data = tree["melting"].to_dataset()
    drop = -data["relative_force_drop"].values
    time = data["onset_time"].values / omega_s()
    size = drop.max()
    part = time[np.argmax(drop >= PART * size)] if size > MIN_DROP else np.nan
    return part, tree.attrs.get("slip_time_melting", np.nan)


def omega_s() -> float:
    """Frequency of the setup [1/s]."""
    return float(derived(case(FILM, 1.0, 1.0))["omega_s"].value)


def row(name: str, values: Array, form: str) -> str:
    """A row of a table of the page."""
    picked = [values[int(np.argmin(abs(np.log10(RATIOS / one))))] for one in TABLE]
    cells = ["-" if np.isnan(one) else format(one, form) for one in picked]
    return f"| {name} | " + " | ".join(cells) + " |"


def main(file: Path) -> None:
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 2, figsize=(10, 4), layout="constrained")
    print("| | " + " | ".join(f"{one:.0e}" for one in TABLE) + " |")
    for delay, colour in DELAYS.items():
        for kind, style in ((FILM, "-"), (CONTACTS, "--")):
            found = np.array([measure(kind, delay, ratio) for ratio in RATIOS])
            label = f"{kind}, delay {1e3 * delay:g} ms"
            axes[0].plot(RATIOS, 1e3 * found[:, 0], style, color=colour, label=label)
            axes[1].plot(RATIOS, found[:, 2], style, color=colour)
            print(row(f"slip time, {label}", 1e3 * found[:, 0], ".1f"))
            print(row(f"drop, {label}", found[:, 1], ".2f"))
            print(row(f"share detached, {label}", found[:, 2], ".2f"), flush=True)
    exact, estimate = np.array([melted(ratio) for ratio in RATIOS]).T
    print(row("S47", 1e3 * exact, ".1f"))
    print(row("beta/Omega_S", 1e3 * estimate, ".1f"))
    axes[0].plot(RATIOS, 1e3 * exact, "k:", lw=2, label="S47, instant melting")
    axes[0].plot(RATIOS, 1e3 * estimate, color="0.5", ls=":", label="β/Ω$_S$")
    alpha = derived(case(CONTACTS, 1.0, 1.0))["slip_time_sequential"].value
    axes[0].axhline(1e3 * alpha, color="0.5", ls="-.", label="α/Ω$_S$, contacts (S46)")
    print(f"alpha/Omega_S {1e3 * alpha:.1f} ms")
    axes[0].set(yscale="log", ylabel=f"time of {100 * PART:.0f} % of the drop [ms]")
    axes[1].set(ylabel="share of detached contacts in it", ylim=(0, 1.02))
    for axis in axes:
        axis.set(xscale="log", xlabel="viscosity over that of the bulk")
        axis.grid(alpha=0.3)
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside right", fontsize=8)
    figure.savefig(file, dpi=120)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "docs" / "melting-film.png")
