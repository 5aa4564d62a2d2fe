"""Do the rules of `mesoslip regime` see what an eye sees, far from Klein's case?

``marked_motions.json`` has motions of layers, lattices, ageing and activated contacts, fast drives,
light damping, forces, and of another apparatus. Their parameters were drawn at random. Each was
marked by eye from a picture of its force (of its velocity under a force) in random order, without
its parameters and before the program classified it: the first mark is the judgement, the others are
those that the picture leaves open. Thresholds were chosen with set 1; set 2 was drawn and marked
later. Prints the table of ``docs/regimes.md``::

    .venv/bin/python tests/studies/marked_motions.py [set] [figure]
"""

import json
import math
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import mesoslip
import numpy as np
from mesoslip.analysis.regime.result import NAMES
from numpy.typing import NDArray

Array = NDArray[np.float64]

FILE = Path(__file__).with_suffix(".json")


class Marked(NamedTuple):
    """A motion: its kind, configuration, marks, and what the program calls it."""

    kind: str
    configuration: dict[str, Any]
    marks: list[str]
    regime: str
    time: Array
    force: Array


def load(number: int | None = None) -> list[dict[str, Any]]:
    """The motions, those of both sets by default."""
    motions: list[dict[str, Any]] = json.loads(FILE.read_text())
    return [one for one in motions if number in {None, one["set"]}]


def classified(motions: Sequence[dict[str, Any]]) -> Iterator[Marked]:
    for one in motions:
        tree = mesoslip.run(one["configuration"], executor=1)
        regime = NAMES[int(mesoslip.regime(tree)["regime"][0])]
        name = "elastic_force" if "elastic_force" in tree else "spring_force"
        yield Marked(
            one["kind"],
            one["configuration"],
            one["marks"],
            regime,
            tree["time"].values,
            tree[name].values[0],
        )


def draw(motions: Sequence[Marked], file: str) -> None:
    import matplotlib.pyplot as plt

    rows = max(1, math.ceil(len(motions) / 4))
    figure, axes = plt.subplots(rows, 4, figsize=(20, 2.5 * rows), squeeze=False)
    for one, panel in zip(motions, axes.flat, strict=False):
        half = len(one.time) // 2
        panel.plot(one.time[half:], 1e6 * one.force[half:], linewidth=0.4)
        panel.set_title(f"{one.kind}: {one.regime}, marked {' or '.join(one.marks)}", fontsize=7)
    figure.tight_layout()
    figure.savefig(file, dpi=60)


def main() -> None:
    numbers = [int(sys.argv[1])] if len(sys.argv) > 1 else [1, 2]
    different = []
    for number in numbers:
        found = list(classified(load(number)))
        same = sum(one.regime == one.marks[0] for one in found)
        allowed = sum(one.regime in one.marks for one in found)
        share = 100 * allowed / len(found)
        print(
            f"set {number}: {len(found)} motions, {same} as marked first, {allowed} "
            f"({share:.1f} %) as the marks allow"
        )
        different += [one for one in found if one.regime not in one.marks]
    for one in different:
        print(f"{one.kind}: {one.regime}, marked {' or '.join(one.marks)}")
    if len(sys.argv) > 2:
        draw(different, sys.argv[2])


if __name__ == "__main__":
    main()
