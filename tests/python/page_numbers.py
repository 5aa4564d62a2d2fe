"""Numbers on pages, compared with what the commands and blocks above them gave.

A comment below a passage has a line for each number, or row of numbers, as the passage has it:

    <!-- numbers
    slips = mesoslip.slips("out/klein.nc")
    1.915 s = slips["start_time"][0]
    17.7 µN ~ 2 % = slips["force_before"][0]
    -->

Text that begins with a number is looked for on the page; after the equals sign is its value, in SI
if the text ends with a unit. It may differ by one in its last digit, or by a share that is given.
Other lines are executed, with the text as `page`. `<!-- printed -->` above a block, or
`<!-- printed, 2 % -->`, states that the commands above have printed its lines, with numbers within
that share.
"""

import re
from typing import Any

import numpy as np
from mesoslip.configuration.units import to_si

START = "<!-- numbers"
PRINTED = re.compile(r"^<!-- printed(?:, (?P<percent>[\d.]+) %)? -->$")
CHECK = re.compile(r"^(?P<text>[-−]?\d.*?)(?: ~ (?P<percent>[\d.]+) %)? = (?P<expression>.+)$")
# Groups of three digits may be apart: 53 214. Powers of ten may have no factor.
NUMBER = re.compile(r"(?<![\w.^])[-−]?\d+(?: \d{3}(?!\d))*(?:\.\d+)?(?:e[-+]?\d+)?")
UNITS = ("s", "m", "N", "N/m", "m/s", "J", "N/s", "Hz", "kg")
# Share by which printed numbers may differ.
SHARE = 0.01


def number_of(text: str) -> float:
    """A number as a page has it."""
    return float(text.replace("−", "-").replace(" ", ""))


def last_digit(text: str) -> float:
    """Size of one in the last digit of a number."""
    mantissa, _, power = text.partition("e")
    return float(10.0 ** (int(power or 0) - len(mantissa.partition(".")[2])))


def size_of(unit: str) -> float:
    """Size of a unit in SI; 1 if it is none, such as the rest of a row of a table."""
    if unit == "%":
        return 0.01
    for one in UNITS:
        try:
            return to_si(f"1 {unit}", one, "") if unit else 1.0
        except ValueError:
            continue
    raise ValueError(f"{unit!r} is not a unit of a number on a page")


def wrong_numbers(comment: str, page: str, names: dict[str, Any]) -> list[str]:
    """What is wrong with numbers of a page, by a comment that uses names of the blocks above."""
    flat, wrong, statements = " ".join(page.split()), [], []
    names["page"] = page
    for match, line in ((CHECK.match(one), one) for one in comment.splitlines()):
        if match is None:
            statements.append(line)
            continue
        exec("\n".join(statements), names)
        statements.clear()
        text, share = match["text"], match["percent"]
        # Once on the page, and once in the comment itself.
        if flat.count(text) < 2:
            wrong.append(f"{text!r} is not on the page")
        found = np.ravel(np.asarray(eval(match["expression"], names), dtype=float)).tolist()
        wrong += differences(text, found, None if share is None else float(share) / 100)
    exec("\n".join(statements), names)
    return wrong


def differences(text: str, found: list[float], share: float | None) -> list[str]:
    """Numbers of a text that are not those found, in SI."""
    numbers = NUMBER.findall(text)
    if len(numbers) != len(found):
        return [f"{text!r} has {len(numbers)} numbers for {len(found)}"]
    size = size_of(NUMBER.split(text)[-1].strip(" |"))
    wrong = []
    for number, value in zip(numbers, found, strict=True):
        allowed = last_digit(number) if share is None else share * abs(number_of(number))
        if not abs(value / size - number_of(number)) <= allowed * (1 + 1e-9):
            wrong.append(f"{text!r}: {number} is {value / size:.6g}")
    return wrong


def not_printed(block: str, printed: str, share: float) -> list[str]:
    """Lines of a block that no command has printed, but for numbers within a share."""
    lines: dict[str, list[list[str]]] = {}
    for line in printed.splitlines():
        lines.setdefault(_words(line), []).append(NUMBER.findall(line))
    wrong = []
    for line in block.splitlines():
        if not line.strip() or line.startswith("$ "):
            continue
        numbers = [number_of(one) for one in NUMBER.findall(line)]
        if not any(
            np.allclose(numbers, [number_of(one) for one in other], rtol=share, atol=0)
            for other in lines.get(_words(line), [])
        ):
            wrong.append(f"{line!r} is not printed")
    return wrong


def _words(line: str) -> str:
    """A line without its numbers, and blanks that depend on their widths."""
    return " ".join(NUMBER.sub("0", line).split())
