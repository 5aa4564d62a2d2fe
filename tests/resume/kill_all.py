"""Kill runs, resumed runs, sweeps and fits at random moments: nothing differs, nothing is lost.

Usage: kill_all.py [KILLS] [--scale FACTOR] [--tally FILE]. A quarter of the kills goes to each; see
kill.py, kill_sweep.py and kill_fit.py for what is checked. Exit status 0 if nothing was wrong.
"""

import os

import kill
import kill_fit
import kill_sweep
import numpy as np
from tally import Tally, arguments


def main() -> None:
    given = arguments(__doc__, 300)
    random = np.random.default_rng(int(os.environ.get("SEED", "1")))
    quarter = -(-given.kills // 4)
    total = Tally([])
    for attack in (
        lambda: kill.attack_all(2 * quarter, random, scale=given.scale),
        lambda: kill_fit.attack_in_new_folder(quarter, random),
        lambda: kill_sweep.attack_in_new_folder(quarter, random),
    ):
        total.add(attack())
        print(total, flush=True)
        if given.tally is not None:
            total.write(given.tally)
    total.end(given.tally)


if __name__ == "__main__":
    main()
