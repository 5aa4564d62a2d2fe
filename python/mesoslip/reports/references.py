"""References of reports: the program, the papers of the model, and those of methods."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from mesoslip.text_rows import rows_of_text

# A citation in a text, as in Markdown of Pandoc: [@braun2009; @braun2011].
CITATION = re.compile(r"\[@([^\]]+)\]")
# Key of the program itself; its version and year are those of an output.
PROGRAM = "mesoslip"


@dataclass(frozen=True)
class Reference:
    """A reference, with its kind and fields as in BibTeX."""

    kind: str
    fields: Mapping[str, str]

    @property
    def line(self) -> str:
        """The reference as a line of a list."""
        given = self.fields
        names = [
            " ".join(reversed(one.split(", ")))
            for one in given["author"].strip("{}").split(" and ")
        ]
        authors = names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"
        where = " ".join(given[name] for name in ("journal", "volume", "note") if name in given)
        if "pages" in given:
            where += f", {given['pages'].replace('--', '–')}"
        parts = [authors, given["title"], f"{where} ({given['year']})".strip()]
        if "doi" in given:
            parts.append(f"doi:{given['doi']}")
        elif "url" in given:
            parts.append(given["url"])
        return f"{', '.join(parts)}."

    def bibtex(self, key: str) -> str:
        """The entry of a BibTeX file."""
        inner = ",\n".join(f"  {name} = {{{text}}}" for name, text in self.fields.items())
        return f"@{self.kind}{{{key},\n{inner}\n}}"


# Key, author, title, journal, volume, pages, year and DOI. Indented lines continue the row above.
ARTICLES = """
braun2009 | Braun, O. M. and Tosatti, E.
    | Kinetics of stick-slip friction in boundary lubrication
    | Europhysics Letters | 88 | 48003 | 2009 | 10.1209/0295-5075/88/48003
braun2011 | Braun, O. M. and Tosatti, E.
    | Kinetics and dynamics of frictional stick-slip in mesoscopic boundary lubrication
    | Philosophical Magazine | 91 | 3253--3275 | 2011
braun2011temperature | Braun, O. M. and Peyrard, M.
    | Dependence of kinetic friction on velocity: Master equation approach
    | Physical Review E | 83 | 046129 | 2011 | 10.1103/PhysRevE.83.046129
braun2015 | Braun, O. M.
    | Stick-slip vs. smooth sliding in the multicontact interface
    | Europhysics Letters | 109 | 48004 | 2015
barel2010 | Barel, I. and Urbakh, M. and Jansen, L. and Schirmeisen, A.
    | Multibond dynamics of nanoscale friction: the role of temperature
    | Physical Review Letters | 104 | 066104 | 2010 | 10.1103/PhysRevLett.104.066104
hindmarsh2005 | Hindmarsh, A. C. and others
    | SUNDIALS: Suite of nonlinear and differential/algebraic equation solvers
    | ACM Transactions on Mathematical Software | 31 | 363--396 | 2005 | 10.1145/1089014.1089020
wood2010 | Wood, S. N.
    | Statistical inference for noisy nonlinear ecological dynamic systems
    | Nature | 466 | 1102--1104 | 2010 | 10.1038/nature09319
dieterich1979 | Dieterich, J. H.
    | Modeling of rock friction: 1. Experimental results and constitutive equations
    | Journal of Geophysical Research | 84 | 2161--2168 | 1979 | 10.1029/JB084iB05p02161
ruina1983 | Ruina, A.
    | Slip instability and state variable friction laws
    | Journal of Geophysical Research | 88 | 10359--10370 | 1983 | 10.1029/JB088iB12p10359
foreman2013 | Foreman-Mackey, D. and Hogg, D. W. and Lang, D. and Goodman, J.
    | emcee: The MCMC hammer
    | Publications of the Astronomical Society of the Pacific | 125 | 306--312 | 2013
    | 10.1086/670067
"""
FIELDS = ("author", "title", "journal", "volume", "pages", "year", "doi")
REFERENCES = {
    key: Reference("article", dict(zip(FIELDS, cells, strict=False)))
    for key, *cells in rows_of_text(ARTICLES)
} | {
    "braun2010": Reference(
        "misc",
        {
            "author": "Braun, O. M. and Peyrard, M.",
            "title": "Master equation approach to friction at the mesoscale",
            "year": "2010",
            "url": "https://arxiv.org/abs/1009.2856",
        },
    )
}


def program(version: str, commit: str, year: str) -> Reference:
    """The program as a reference."""
    return Reference(
        "misc",
        {
            "author": "{the mesoslip developers}",
            "title": "mesoslip: stick-slip friction of a multicontact interface",
            "note": f"version {version}, commit {commit}",
            "year": year,
        },
    )


def numbered(text: str, keys: Sequence[str] = ()) -> tuple[str, list[str]]:
    """A text with its citations as numbers, and all keys in the order of their numbers.

    Citations such as "[@braun2009; @braun2011]" become "[1, 2]"; `keys` have the first numbers.
    """
    found = list(keys)

    def numbers(match: re.Match[str]) -> str:
        cited = [one.strip().removeprefix("@") for one in match.group(1).split(";")]
        found.extend(one for one in cited if one not in found)
        return f"[{', '.join(str(1 + found.index(one)) for one in cited)}]"

    return CITATION.sub(numbers, text), found
