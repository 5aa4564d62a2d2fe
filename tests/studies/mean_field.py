"""The master equation with tables of a lattice against the lattice: ``docs/mean-field.png``.

Slow sliding and the first slip of the source's case of interaction, for three strengths and two
lattices; prints the tables of ``docs/mean-field.md``::

    .venv/bin/python tests/studies/mean_field.py [figure]
"""

import sys
from pathlib import Path

import mesoslip
import numpy as np
import xarray as xr
from mesoslip import Config
from mesoslip.campaign.mean_field import FIRST, STEADY, MeanField
from numpy.typing import NDArray

Array = NDArray[np.float64]

ROOT = Path(__file__).parents[2]
LATTICE = ROOT / "runs" / "source" / "S25d.toml"
STRENGTHS = (0.03, 0.1, 0.3)
# Columns, rows, and realizations.
SIZES = ((60, 68, 4), (120, 136, 2))
# Displacement of the slider in slow sliding, and its last part, in mean breaking stretches.
LENGTH, SETTLED = 8.0, 4.0
COLOURS = {STEADY: "tab:blue", FIRST: "tab:orange"}


def lattice(strength: float, columns: int, rows: int, realizations: int) -> Config:
    """Equal contacts on a lattice, at the same distance whatever their number."""
    count = columns * rows
    return Config.load(
        LATTICE,
        [
            "contacts.coupling=equal",
            f"interaction.strength={strength}",
            f"run.realizations={realizations}",
            {
                "contacts.count": count,
                "contacts.area": 1e-10 * count / 4080,
                "interaction.columns": columns,
                "interaction.rows": rows,
            },
        ],
    )


def slow(config: Config, unit: float) -> tuple[Array, Array]:
    """Displacement over a stretch, and contact force over F_s of each realization."""
    tables = config.to_dict()
    tables["run"] |= {"duration": 1.0, "seed": 7}
    tables["drive"] = {"velocity": LENGTH * unit}
    tables["slider"] = {"kind": "prescribed"}
    tables["contacts"] |= {"delay": 0.0, "drag_rate": 0.0}
    tables["output"] = {"interval": 1 / 1600}
    tree = mesoslip.run(tables)
    return tree["displacement"].values[0] / unit, tree["contact_force"].values / 18e-6


def first_slip(config: Config) -> tuple[Array, Array]:
    """Peak force before the first slip, and its drop, over F_s; one for each realization."""
    tables = config.to_dict()
    tables["run"] |= {"duration": 2.3, "stop": {"slips": 1}}
    tables["output"] = {"interval": 1e-3}
    if config.run.engine == "me":
        tables["run"]["resolution"] = 0.5
    tree = mesoslip.run(tables)
    peaks = np.nanmax(tree["spring_force"].values, axis=1) / 18e-6
    slips: xr.Dataset = mesoslip.slips(tree)
    owner, drop = slips["realization_index"].values, slips["force_drop"].values / 18e-6
    drops = [drop[owner == one][:1].sum() for one in range(peaks.size)]
    return peaks, np.array(drops)


def report(name: str, x: Array, force: Array, slip: tuple[Array, Array]) -> None:
    late = force[:, x > SETTLED]
    peaks, drops = slip
    print(
        f"{name:16} peak F(X) {force.mean(axis=0).max():.3f}  steady {late.mean():.4f}  "
        f"fluctuation {late.std():.4f}  peak {peaks.mean():.3f} ± {np.std(peaks):.3f}  "
        f"drop {drops.mean():.3f} ± {np.std(drops):.3f}",
        flush=True,
    )


def main(file: Path) -> None:
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 3, figsize=(10, 3.6), sharey=True, layout="constrained")
    for axis, strength in zip(axes, STRENGTHS, strict=True):
        lattices = [lattice(strength, *size) for size in SIZES]
        unit = lattices[0].contacts.break_stretch
        field: MeanField = mesoslip.mean_field(lattices[0])
        print(f"xi = {strength}", {key: round(one[0], 12) for key, one in field.summary.items()})
        curves = []
        for config, style in zip(lattices, ("-", ":"), strict=True):
            x, force = slow(config, unit)
            curves.append(force.mean(axis=0))
            assert config.interaction is not None
            size = f"{config.interaction.columns} × {config.interaction.rows}"
            axis.plot(x, curves[-1], "k" + style, lw=1.2, label=f"lattice, {size}")
            report(f"lattice {size}", x, force, first_slip(config))
            tree = mesoslip.run(config.replace("run.realizations=1", "run.duration=3s"))
            sizes = tree["avalanches"]["size"].values
            print(f"   mean avalanche {sizes.mean():.2f}, largest {sizes.max()}")
        for generation, colour in COLOURS.items():
            config = field.config(generation)
            x, force = slow(config, unit)
            name = "steady sliding" if generation == STEADY else "first loading"
            axis.plot(x, force[0], color=colour, lw=1.2, label=f"ME, tables of {name}")
            report(f"ME {generation}", x, force, first_slip(config))
            gaps = [(0, 1), (1, 2), (2, 4), (4, 8)]
            found = [
                np.sqrt(np.mean((force[0] - curves[0])[(x > low) & (x <= high)] ** 2))
                for low, high in gaps
            ]
            print("   rms difference over F_s:", dict(zip(gaps, np.round(found, 4), strict=True)))
        axis.set(title=f"ξ = {strength:g}", xlabel="displacement $kX/f_s$", xlim=(0, LENGTH))
        axis.set_ylim(0)
    axes[0].set_ylabel("contact force $F/F_s$")
    axes[0].legend(frameon=False, fontsize=8, loc="lower right")
    figure.savefig(file, dpi=120)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "docs" / "mean-field.png")
