"""Kill runs, resumed runs, sweeps and fits at random moments: nothing differs, nothing is lost.

Half of the kills are of runs; see kill_runs.py, kill_sweep.py and kill_fit.py for what is checked.
Exit status 0 if nothing was wrong.
"""

import argparse
import os
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "python"))
sys.path.insert(0, str(Path(__file__).parents[1] / "fuzz"))

import kill_fit
import kill_runs
import kill_sweep
from tally import Tally

ATTACKS = {
    "runs": kill_runs.attack_all,
    "fits": kill_fit.attack_in_new_folder,
    "sweeps": kill_sweep.attack_in_new_folder,
}


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("kills", nargs="?", type=int, default=300)
    parser.add_argument("--only", choices=ATTACKS, help="what alone is killed")
    parser.add_argument("--scale", type=float, default=1.0, help="factor of the durations of runs")
    parser.add_argument("--tally", type=Path, help="JSON file that takes the counts")
    given = parser.parse_args()
    random = np.random.default_rng(int(os.environ.get("SEED", "1")))
    kinds = [given.only] if given.only else ["runs", "runs", "fits", "sweeps"]
    total = Tally([])
    for kind in dict.fromkeys(kinds):
        kills = -(-given.kills * kinds.count(kind) // len(kinds))
        scale = {"scale": given.scale} if kind == "runs" else {}
        total.add(ATTACKS[kind](kills, random, **scale))
        print(total, flush=True)
        if given.tally is not None:
            total.write(given.tally)
    total.end()


if __name__ == "__main__":
    main()
