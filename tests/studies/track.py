"""Strength along the track, and loops of kept thresholds: ``docs/track.png``.

The ready runs `track.toml` and `pre-sliding.toml`, and forces of the master equation along 24
tracks beside the linear theory. Half a minute on one core.
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import mesoslip
import numpy as np
from mesoslip import Config, TrackResponse, track_strength

ROOT = Path(__file__).parents[2]
TRACKS, SAMPLES = 24, 4096


def stick_slip(axes, below):
    """Forces before slips and the strength where they begin, and their correlation."""
    config = Config.load(ROOT / "runs" / "track.toml")
    uniform = config.replace("contacts.track=none")
    for one, colour, label in ((config, "C0", "track"), (uniform, "C1", "uniform strength")):
        tree = mesoslip.run(one)
        slips = tree["slips"].to_dataset()
        found = []
        for realization in range(one.run.realizations):
            mine = slips["realization_index"].values == realization
            force = 1e6 * slips["force_before"].values[mine][3:]
            place = np.interp(
                slips["start_time"].values[mine][3:],
                tree["time"].values,
                tree["displacement"].values[realization],
            )
            if realization == 0:
                axes.plot(1e6 * place, force, f"{colour}.-", lw=0.7, ms=3, label=label)
                if one is config:
                    mean = np.mean(force / track_strength(config, place))
                    x = np.linspace(place[0], place[-1], 1000)
                    strength = mean * track_strength(config, x)
                    axes.plot(1e6 * x, strength, "0.7", lw=0.6, zorder=0, label="strength")
            change = force - np.mean(force)
            found.append([np.mean(change[lag:] * change[: len(change) - lag]) for lag in range(25)])
        correlation = np.mean(found, axis=0)
        below.plot(correlation / correlation[0], f"{colour}.-", label=label)
    axes.set(xlabel="displacement (µm)", ylabel="force before a slip (µN)")
    axes.legend(fontsize=7)
    below.axhline(0, color="0.8", lw=0.5)
    below.set(xlabel="slips later", ylabel="correlation of forces before slips")
    below.legend(fontsize=7)


def spectrum(axes):
    """The spectrum of the force of slow sliding beside the linear theory."""
    config = Config.from_dict(
        {
            "run": {"engine": "me", "duration": 150.0, "realizations": TRACKS},
            "drive": {"velocity": 1.0},
            "slider": {"kind": "prescribed"},
            "contacts": {
                **{"count": 1000, "static_force": 1.0, "stiffness": 1.0, "coupling": "equal"},
                "initial": "steady",
                "threshold": {"law": "gaussian", "relative_width": 0.1},
                "track": {"spread": 0.03, "length": 0.3, "correlation": "exponential"},
            },
            "output": {"interval": 1 / 32},
        }
    )
    theory = TrackResponse(config)
    force = mesoslip.run(config)["contact_force"].values[:, -SAMPLES:]
    window = np.hanning(SAMPLES)
    power = np.abs(np.fft.rfft(window * (force - theory.response(0.0).real))) ** 2
    density = np.mean(power, axis=0) / 32 / (2 * np.pi * np.sum(window**2))
    q = 2 * np.pi * np.fft.rfftfreq(SAMPLES, 1 / 32)
    shown = (q > 0) & (q < 25)
    axes.semilogy(q[shown], density[shown], "C0", lw=0.6, label=f"{TRACKS} tracks, N → ∞")
    axes.semilogy(q[shown], theory.force_spectrum(q[shown]), "k--", lw=1, label="linear theory")
    axes.set(xlabel="wavenumber × breaking stretch", ylabel="spectrum of $F/F_s$")
    axes.legend(fontsize=7)
    print(f"deviation {np.std(force - 0.505):.4f}, theory {theory.force_deviation:.4f}")


def loops(axes):
    """Pre-sliding with kept thresholds and with others."""
    config = Config.load(ROOT / "runs" / "pre-sliding.toml")
    drawn = config.replace("contacts.renewal=redraw", "contacts.back_force_ratio=0.04")
    for one, colour, label in ((config, "C0", "keep"), (drawn, "C1", "redraw")):
        tree = mesoslip.run(one)
        x, force = (tree[name].values[0] for name in ("displacement", "contact_force"))
        slipped = force - config.contacts.stiffness * x
        axes.plot(1e9 * x, 1e6 * slipped, colour, lw=0.8, label=label)
    axes.set(xlabel="displacement (nm)", ylabel="force less $NkX$ (µN)")
    axes.legend(fontsize=7)


def main(path: Path) -> None:
    figure, axes = plt.subplots(2, 2, figsize=(9, 6), layout="constrained")
    stick_slip(*axes[0])
    spectrum(axes[1, 0])
    loops(axes[1, 1])
    figure.savefig(path, dpi=110)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "docs" / "track.png")
