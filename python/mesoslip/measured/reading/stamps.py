"""Time stamps in the forms of instruments, programs and countries.

Numbers such as 04/03/2026 are dates in more than one order. That of a column is the one in which
all its dates exist and do not decrease. pandas would decide for each cell by itself.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator
from datetime import date
from functools import lru_cache
from typing import Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray

from mesoslip.array_types import Array

Samples = NDArray[np.int_]
Characters = NDArray[np.uint8]

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
# Maximum number of forms of time stamps that are read at once: days, hours and months differ in
# their digits and letters.
MAX_FORMS = 100


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
    """The order of dates that were written one after the other; one of them exists at least."""
    days = [found for one in dates if (found := _days(one))]
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


def only_order(written: str) -> Order | None:
    """The order of a date that has a single one."""
    orders = [*_days(written)]
    return orders[0] if len(orders) == 1 else None


class Clock:
    """Time stamps of a column as seconds from the first one; those without dates, within a day."""

    def __init__(self, chosen: Chosen | None = None) -> None:
        self.chosen = chosen
        self.first = ""
        self._start = 0, 0

    @property
    def start(self) -> float:
        """The first time stamp [s], from one day for all files, or from midnight without a date."""
        day, part = self._start
        return (day * DAY + part) / 1e9

    def seconds(self, cell: str) -> float | None:
        """Seconds of a cell; None if it is not a time stamp."""
        data = np.frombuffer(cell.encode(), np.uint8)
        found = float(self.read(data, np.array([0]), np.array([data.size]))[0])
        return None if math.isnan(found) else found

    def read(self, data: Characters, first: Samples, after: Samples) -> Array:
        """Seconds of the cells ``data[first:after]``; NaN if one is not a time stamp."""
        found = np.full(first.size, np.nan)
        for rows, cells in _alike(data, first, after):
            found[rows] = self._seconds(cells)
        return found

    def _seconds(self, cells: Characters) -> Array:
        """Seconds of cells of one form, characters of shape (cells, length)."""
        form = _form(cells)
        nothing = np.full(len(cells), np.nan)
        if form is None or not (form["date"] or (form["colon"] == ":" and form["second"])):
            return nothing

        def number(name: str) -> Samples:
            digits = _part(cells, form, name).astype(int) - ord("0")
            return np.asarray(digits @ 10 ** np.arange(digits.shape[1])[::-1])

        hour, minute = number("hour"), number("minute")
        second = number("second") if form["second"] else np.zeros_like(hour)
        if form["half"]:
            noon = 12 if form["half"] in "Pp" else 0
            hour = np.where(hour <= 12, hour % 12 + noon, hour)
        day = self._day(_part(cells, form, "date")) if form["date"] else np.zeros_like(hour)
        known = (day >= 0) & (hour <= 23) & (minute <= 59) & (second <= 59)
        part = (3600 * hour + 60 * minute + second) * 10**9
        if form["part"]:
            part += number("part") * 10 ** (9 - len(form["part"]))
        if not known.any():
            return nothing
        if not self.first:
            row = int(np.argmax(known))
            self.first, self._start = cells[row].tobytes().decode(), (int(day[row]), int(part[row]))
        since = (day - self._start[0]) * DAY + part - self._start[1]
        return np.where(known, since / 1e9, np.nan)

    def _day(self, dates: Characters) -> Samples:
        """Numbers of the days of dates; -1 for one that does not exist."""
        rows, written = _changes(dates)
        days = []
        for one in written:
            found = _days(one)
            chosen = self.chosen or (chosen_order([one]) if found else None)
            days.append(-1 if chosen is None else found.get(chosen.order, -1))
        return np.repeat(days, np.diff(rows, append=len(dates)))


def dates_of(data: Characters, first: Samples, after: Samples) -> Iterator[str]:
    """The dates of the time stamps in the cells ``data[first:after]``, where they change."""
    found: dict[int, str] = {}
    for rows, cells in _alike(data, first, after):
        form = _form(cells)
        if form is not None and form["date"]:
            changes, written = _changes(_part(cells, form, "date"))
            found |= dict(zip(rows[changes].tolist(), written, strict=True))
    for row in sorted(found):
        yield found[row]


def _alike(
    data: Characters, first: Samples, after: Samples
) -> Iterator[tuple[Samples, Characters]]:
    """Rows of cells of one form, in which the same characters are digits, and their characters,
    shape (rows, length)."""
    rows, sizes = np.arange(first.size), after - first
    for _ in range(MAX_FORMS):
        if rows.size == 0:
            return
        size = sizes[rows[0]]
        alike = rows[sizes[rows] == size]
        cells = data[first[alike][:, np.newaxis] + np.arange(size)]
        is_digit = (cells >= ord("0")) & (cells <= ord("9"))
        forms = np.where(is_digit, np.uint8(ord("0")), cells)
        is_same = (forms == forms[0]).all(axis=1)
        yield alike[is_same], cells[is_same]
        rows = np.setdiff1d(rows, alike[is_same], assume_unique=True)


def _form(cells: Characters) -> re.Match[str] | None:
    return STAMP.fullmatch(cells[0].tobytes().decode())


def _part(cells: Characters, form: re.Match[str], name: str) -> Characters:
    """The characters of a part of time stamps."""
    start, end = (len(form.string[:one].encode()) for one in form.span(name))
    return cells[:, start:end]


def _changes(texts: Characters) -> tuple[list[int], list[str]]:
    """Rows in which a text differs from the one before, with the first, and the texts there."""
    rows = [0, *(np.flatnonzero((texts[1:] != texts[:-1]).any(axis=1)) + 1).tolist()]
    return rows, [texts[one].tobytes().decode() for one in rows]


def past_midnight(seconds: Array, last: float = math.nan) -> Array:
    """Seconds that increase over midnight, from those within a day; after a last one, if any."""
    known = np.isfinite(seconds)
    within = seconds[known]
    days = np.cumsum(np.diff(within, prepend=within[:1]) < -DAY / 2e9)
    if within.size and math.isfinite(last):
        days += max(0, round((last - within[0]) / (DAY / 1e9)))
    passed = seconds.copy()
    passed[known] = np.rint(within * 1e9 + days * DAY) / 1e9
    return passed
