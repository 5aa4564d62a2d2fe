"""Time stamps in the forms of instruments, programs and countries.

Numbers such as 04/03/2026 are dates in more than one order. That of a column is the one in which
all its dates exist and do not decrease. pandas would decide for each cell by itself.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from datetime import date
from functools import lru_cache
from typing import Literal, NamedTuple, get_args

Order = Literal["dmy", "mdy", "ymd"]
"""Order of day, month and year in a date of numbers."""
ORDERS: tuple[Order, ...] = get_args(Order)
NAMES = {"d": "day", "m": "month", "y": "year"}
# First three letters of the months, in English and in German.
MONTHS = {
    **{"jan": 1, "feb": 2, "mar": 3, "apr": 4, "may": 5, "jun": 6, "jul": 7, "aug": 8, "sep": 9},
    **{"oct": 10, "nov": 11, "dec": 12, "mär": 3, "mrz": 3, "mai": 5, "okt": 10, "dez": 12},
}
POINT = re.compile(r"[0-9]\.[0-9]")
PART = r"(?:[0-9]{4}|[0-9]{1,2}|[^\W\d_]{3,9})"
DATE = rf"{PART}(?P<mark>[-/.]| |\. ){PART}(?:(?P=mark)|\.? |, ){PART}"
# A time of the day, perhaps of 12 hours. After a date it may have no seconds, or points in it.
STAMP = re.compile(
    rf"(?:(?P<date>{DATE})(?:T|,? +))?"
    r"(?P<hour>[0-9]{1,2})(?P<colon>[:.])(?P<minute>[0-9]{2})"
    r"(?:(?P=colon)(?P<second>[0-9]{2})(?:[.,:](?P<part>[0-9]{1,9}))?)?"
    r"(?:[ \u202f]?(?P<half>[AaPp])\.?[Mm]\.?)?(?: ?(?:Z|UTC|GMT|[+-][0-9]{2}:?[0-9]{2}))?"
)
# The form of time stamps in place of a unit, such as "dd.mm.yyyy hh:mm:ss".
STAMP_FORM = re.compile(r"(?i)(?=.*(?:yy|hh|jj))[dmyjhst.:/,f -]+")
# A year of two digits is from 1970 to 2069.
FIRST_YEAR = 1970
DAY = 86_400 * 10**9


class Chosen(NamedTuple):
    """The order of the dates of a column."""

    order: Order
    is_guess: bool = False
    """Whether another order is possible, with other times."""
    is_open: bool = False
    """Whether another order is possible, with the same times."""

    @property
    def name(self) -> str:
        """The order in words."""
        return "/".join(NAMES[one] for one in self.order)


@lru_cache(maxsize=256)
def _days(text: str) -> dict[Order, int]:
    """Number of the day of a date in each order in which it exists."""
    parts = re.findall(r"[0-9]+|[^\W\d_]+", text)
    years = [at for at, one in enumerate(parts) if len(one) == 4 and one.isdigit()]
    found: dict[Order, int] = {}
    for order in ORDERS:
        if years not in ([], [order.index("y")]):
            continue
        # A date with points, or with a name between its numbers, begins with the day or the year.
        is_european = POINT.search(text) is not None or not parts[1].isdigit()
        if is_european and (order == "mdy" or (order == "ymd" and not years)):
            continue
        cells = dict(zip(order, parts, strict=True))
        month = MONTHS.get(cells["m"][:3].lower(), cells["m"])
        if not (cells["y"].isdigit() and cells["d"].isdigit() and str(month).isdigit()):
            continue
        year = int(cells["y"])
        if not years:
            year += 100 * ((FIRST_YEAR + 99 - year) // 100)
        try:
            found[order] = date(year, int(month), int(cells["d"])).toordinal()
        except ValueError:
            continue
    return found


def chosen_order(dates: Iterable[str]) -> Chosen:
    """The order of dates that were written one after the other."""
    days = [_days(one) for one in dates]
    orders = [one for one in ORDERS if all(one in each for each in days)]
    # Dates that exist in no common order are found where they are read.
    orders = orders or [one for one in ORDERS if one in days[0]]
    rows = {one: [each[one] for each in days if one in each] for one in orders}
    increasing = [one for one in orders if rows[one] == sorted(rows[one])] or orders
    # A record has no gaps as a rule.
    spans = {one: max(rows[one]) - min(rows[one]) for one in increasing}
    order = min(increasing, key=spans.__getitem__)
    is_guess = len(set(spans.values())) > 1
    return Chosen(order, is_guess, not is_guess and len(spans) > 1)


def order_of(form: str) -> Order | None:
    """The order of dates in the form of time stamps, such as "dd.mm.yyyy hh:mm:ss"."""
    letters = form.lower().translate(str.maketrans("tj", "dy"))
    first = "".join(dict.fromkeys(re.findall("[dmy]", letters)))
    return next((one for one in ORDERS if one == first), None)


def date_of(cell: str) -> str | None:
    """The date of a time stamp, empty if it has none; None if a cell is not a time stamp."""
    found = STAMP.fullmatch(cell)
    return None if found is None else found["date"] or ""


class Clock:
    """Time stamps of a column as seconds from the first one. Without dates they pass midnight."""

    def __init__(self, chosen: Chosen | None = None) -> None:
        self.chosen = chosen
        self.first = ""
        self._start = self._last = self._days = 0

    def seconds(self, cell: str) -> float | None:
        """Seconds of a cell; None if it is not a time stamp."""
        found = STAMP.fullmatch(cell)
        if found is None:
            return None
        written = found["date"]
        if not written and (found["colon"] == "." or found["second"] is None):
            return None
        hour, minute, second = (int(found[one] or 0) for one in ("hour", "minute", "second"))
        if found["half"] and 1 <= hour <= 12:
            hour = hour % 12 + (12 if found["half"] in "Pp" else 0)
        day: int | None = self._days
        if written:
            days = _days(written)
            chosen = self.chosen or (chosen_order([written]) if days else None)
            day = None if chosen is None else days.get(chosen.order)
        if day is None or hour > 23 or minute > 59 or second > 59:
            return None
        second += 3600 * hour + 60 * minute
        now = day * DAY + second * 10**9 + int(f"{found['part'] or 0:0<9}")
        if not written and self.first and now < self._last - DAY // 2:
            self._days += 1
            now += DAY
        if not self.first:
            self.first, self._start = cell, now
        self._last = now
        return (now - self._start) / 1e9
