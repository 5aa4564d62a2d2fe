"""Judge the source's claims from the outputs of their runs."""

from __future__ import annotations

import json
import sys
from pathlib import Path

from claims import CLAIMS, judge
from claims.compare import differences
from claims.page import as_table, as_text, measured_page, measured_path, verdict_page
from mesoslip.output.targets import check_writable, written_whole
from scripts import parser_of, reporting_mistakes


def main() -> None:
    page = "page of verdicts to write, beside it NAME-measured"
    parser = parser_of(__doc__, CLAIMS, "claim", page, None)
    parser.add_argument("--json", action="store_true", help="print JSON")
    parser.add_argument(
        "--compare",
        type=Path,
        metavar="PAGE",
        help="an earlier page; exit status 1 if a judgement is another one than there",
    )
    given = parser.parse_args()
    if given.output is not None:
        check_writable(given.output)
    judgements = judge(given.names, given.outputs)
    if given.output is not None:
        for path, text in (
            (given.output, verdict_page(judgements, given.output)),
            (measured_path(given.output), measured_page(judgements)),
        ):
            with written_whole(path) as part:
                part.write_text(text, encoding="utf-8")
    print(json.dumps(as_table(judgements), indent=2) if given.json else as_text(judgements))
    if given.compare is not None:
        found = differences(judgements, given.compare)
        for line in found:
            print(line, file=sys.stderr)
        sys.exit(1 if found else 0)


if __name__ == "__main__":
    with reporting_mistakes():
        main()
