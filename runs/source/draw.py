"""Draw the source's figures from the outputs of their runs."""

from __future__ import annotations

from pathlib import Path

from figures import FIGURES, draw
from scripts import parser_of, reporting_mistakes


def main() -> None:
    given = parser_of(
        __doc__, FIGURES, "figure", "folder of the pictures", Path("out/figures")
    ).parse_args()
    for path in draw(given.names, given.outputs, given.output):
        print(path)


if __name__ == "__main__":
    with reporting_mistakes():
        main()
