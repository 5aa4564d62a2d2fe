"""What was killed, and what came of it."""

from __future__ import annotations

import json
import sys
from collections import Counter
from collections.abc import Iterable
from pathlib import Path


class Tally:
    """Counts of kills, of outputs that differ in a bit, and of what was lost.

    Attributes
    ----------
    kills
        Number of kills of each kind.
    compared
        Number of outputs that were compared with that of a run that was not killed.
    differing, lost
        Messages: which outputs differ, and what was lost or left behind.
    """

    def __init__(self, kinds: Iterable[str]) -> None:
        self.kills = Counter(dict.fromkeys(kinds, 0))
        self.compared = 0
        self.differing: list[str] = []
        self.lost: list[str] = []

    def compare(self, kind: str, differences: list[str]) -> None:
        """Count an output, and where it differs."""
        self.compared += 1
        self.differing += [f"{kind}: {one} differs" for one in differences]

    def lose(self, message: str) -> None:
        """Count something that was lost."""
        self.lost.append(message)

    def add(self, other: Tally) -> None:
        """Add the counts of another."""
        self.kills.update(other.kills)
        self.compared += other.compared
        self.differing += other.differing
        self.lost += other.lost

    @property
    def is_right(self) -> bool:
        """Whether nothing differs and nothing was lost."""
        return not self.differing and not self.lost

    def __str__(self) -> str:
        kills = ", ".join(f"{count} kills of {kind}" for kind, count in self.kills.items())
        return (
            f"{kills}; {self.compared} outputs compared, {len(self.differing)} differences, "
            f"{len(self.lost)} losses"
        )

    def write(self, path: Path) -> None:
        """Keep the counts in a JSON file."""
        counts = {"kills": dict(self.kills), "compared": self.compared}
        found = {"differing": self.differing, "lost": self.lost}
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps({**counts, **found}, indent=1) + "\n")

    def end(self) -> None:
        """Print the counts, and exit with status 0 if nothing was wrong."""
        for message, count in Counter(self.differing + self.lost).items():
            print(f"wrong: {message} ({count} times)")
        print(self)
        sys.exit(not self.is_right)
