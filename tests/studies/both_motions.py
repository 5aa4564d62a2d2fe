"""Smooth sliding, oscillation, or both? `mesoslip cycle` from relaxed and from steady contacts
over the velocity, beside linear theory: ``docs/both-motions.png``; a minute.

    .venv/bin/python tests/studies/both_motions.py [figure]
"""

import sys
from pathlib import Path

import mesoslip
from mesoslip import Config
from mesoslip.theory.steady_sliding import stability_boundary

ROOT = Path(__file__).parents[2]
KLEIN = ROOT / "runs" / "klein.toml"
STARTS = {"relaxed": "C0o", "steady": "C1x"}
# Passages before a motion that does not settle is compared with itself later.
MAX_CYCLES = 24


# Klein's case with a short delay and broad thresholds.
CHANGES = (
    "contacts.delay=0.1 ms",
    "contacts.threshold.relative_width=0.2",
    "output.slip_interval=none",
)
# Velocities of the drive, and two around the linear boundary [um/s].
VELOCITIES = (24.0, 25.0, 25.4, 25.8, 26.4, 27.0, 27.5, 28.0, 29.0, 30.0)
ENDS = 20.0, 30.0


def main(file: Path) -> None:
    import matplotlib.pyplot as plt

    base = Config.load(KLEIN, CHANGES)
    limit = 1e6 * stability_boundary(base, "drive.velocity", *(1e-6 * one for one in ENDS))
    print(f"linear boundary {limit:.4g} um/s", flush=True)
    figure, axes = plt.subplots(figsize=(5, 3.4), layout="constrained")
    for start, style in STARTS.items():
        amplitudes = []
        for velocity in VELOCITIES:
            found = mesoslip.cycle(
                base.replace({"drive.velocity": 1e-6 * velocity}),
                start=start,
                max_cycles=MAX_CYCLES,
                find_multipliers=False,
            )
            amplitudes.append(found.amplitude_ratio)
            print(f"{velocity:g} um/s, {start}: {found.motion} {amplitudes[-1]:.4f}", flush=True)
        axes.plot(VELOCITIES, amplitudes, style, mfc="none", label=f"cycle, {start} start")
    axes.plot((limit, VELOCITIES[-1]), (0, 0), "k-", label="smooth sliding, linearly stable")
    axes.plot((VELOCITIES[0], limit), (0, 0), "k:", label="linearly unstable")
    axes.axvline(limit, color="0.5", ls=":")
    axes.set(xlabel="velocity of the drive, µm/s", ylabel="amplitude / $F_s$")
    axes.legend(loc="center left")
    figure.savefig(file, dpi=130)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "docs/both-motions.png")
