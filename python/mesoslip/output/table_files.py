"""Files of tables: comma-separated values in SI, Markdown, and LaTeX with booktabs."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from mesoslip.output.targets import written_whole

# Endings of files of printed tables; all others are comma-separated values.
MARKDOWN, LATEX = ".md", ".tex"

# Parts of cells and headers in LaTeX.
LATEX_TEXTS = {
    "inf": r"$\infty$",
    "Δ": r"$\Delta$",
    "<": r"$<$",
    "µ": r"\textmu{}",
    "±": r"$\pm$",
    "D_c2": r"$D_{c,2}$",
    "D_c": r"$D_c$",
    "a - b": r"$a - b$",
    "b2": r"$b_2$",
    "%": r"\%",
    "_": r"\_",
    "&": r"\&",
    "#": r"\#",
    "$": r"\$",
}


@dataclass(frozen=True)
class PrintedTable:
    """A table of texts: its title, headers with units, and rows of cells."""

    title: str
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


def is_printed(path: Path) -> bool:
    """Whether a file is Markdown or LaTeX."""
    return path.suffix.lower() in {MARKDOWN, LATEX}


def latex(table: PrintedTable) -> str:
    """A table as LaTeX, a ``tabular`` with the rules of booktabs."""
    rows = [" & ".join(map(_latex, row)) + r" \\" for row in (table.head, *table.rows)]
    lines = [
        r"\begin{tabular}{" + "l" + "r" * (len(table.head) - 1) + "}",
        r"\toprule",
        rows[0],
        r"\midrule",
        *rows[1:],
        r"\bottomrule",
        r"\end{tabular}",
    ]
    return "\n".join(lines)


def _latex(text: str) -> str:
    """A cell or header: its special characters, infinities and powers of ten."""
    pattern = "|".join(re.escape(one) for one in LATEX_TEXTS)
    pattern = pattern.replace("inf", r"\binf\b")
    text = re.sub(pattern, lambda found: LATEX_TEXTS[found.group()], text)
    return re.sub(r"(?<=[\d)])e(-?\d+)\b", r"$\\times 10^{\1}$", text)


def markdown(table: PrintedTable) -> str:
    """A table as Markdown; numbers are aligned right."""
    marks = (":---", *("---:" for _ in table.head[1:]))
    lines = [table.head, marks, *table.rows]
    return "\n".join(f"| {' | '.join(one)} |" for one in lines)


def write_printed(tables: Sequence[PrintedTable], path: Path) -> None:
    """Write tables as Markdown or LaTeX, by the ending of the file."""
    if path.suffix.lower() == LATEX:
        parts = [r"% \usepackage{booktabs}", *(f"% {one.title}\n{latex(one)}" for one in tables)]
    else:
        parts = [f"**{one.title}**\n\n{markdown(one)}" for one in tables]
    with written_whole(path) as part:
        part.write_text("\n\n".join(parts) + "\n", encoding="utf-8")


def rows_of(columns: Mapping[str, NDArray[Any]]) -> list[dict[str, Any]]:
    """A dictionary for each row of columns; None for unknown values."""
    lists = (values.tolist() for values in columns.values())
    return [
        {name: None if value != value else value for name, value in zip(columns, row, strict=True)}
        for row in zip(*lists, strict=True)
    ]


def write_table(rows: Iterable[Mapping[str, Any]], units: Mapping[str, str], path: Path) -> None:
    """Write rows as comma-separated values; the header has the unit of each column."""
    write_tables([(rows, units)], path)


def write_tables(
    tables: Sequence[tuple[Iterable[Mapping[str, Any]], Mapping[str, str]]], path: Path
) -> None:
    """Write tables of rows with the units of their columns, with an empty line between them."""
    with written_whole(path) as part, part.open("w", newline="", encoding="utf-8") as file:
        for number, (rows, units) in enumerate(tables):
            file.write("\n" if number else "")
            writer = csv.DictWriter(file, list(units))
            writer.writerow({name: f"{name} [{unit}]" for name, unit in units.items()})
            writer.writerows(rows)
