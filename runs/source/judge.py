"""Judge the source's claims from the outputs of their runs."""

from __future__ import annotations

import json

from claims import CLAIMS, judge
from claims.page import as_markdown, as_table, as_text
from mesoslip.output.targets import check_writable, written_whole
from scripts import parser_of, reporting_mistakes


def main() -> None:
    parser = parser_of(__doc__, CLAIMS, "claim", "page to write", None)
    parser.add_argument("--json", action="store_true", help="print JSON")
    given = parser.parse_args()
    if given.output is not None:
        check_writable(given.output)
    judgements = judge(given.names, given.outputs)
    if given.output is not None:
        with written_whole(given.output) as part:
            part.write_text(as_markdown(judgements), encoding="utf-8")
    print(json.dumps(as_table(judgements), indent=2) if given.json else as_text(judgements))


if __name__ == "__main__":
    with reporting_mistakes():
        main()
