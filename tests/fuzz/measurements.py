"""Files of measurements in the styles of laboratories, with what they say; and damaged ones."""

import bz2
import gzip
import lzma
import re
from collections.abc import Callable
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Headers of each quantity, with a place for the unit.
HEADERS = {
    "time": ["time{}", "Time{}", "t{}", "Elapsed time{}", "TIME{}", "Zeit{}"],
    "force": ["Force{}", "shear_force{}", "Spring force{}", "Lateral force{}", "Kraft{}"],
    "friction": ["Friction", "mu", "F_over_mg", "Friction coefficient", "COF", "µ", "F/mg"],
    "shear_stress": ["Shear stress{}", "tau{}", "shear_stress{}"],
    "normal_stress": ["Normal_stress{}", "Normal stress{}", "sigma_n{}"],
    "load_point": ["Load point{}", "lp_disp{}", "Stage position{}", "load_point{}"],
}
# Units as they are written, and their size in SI.
UNITS = {
    "time": {"s": 1, "sec": 1, "ms": 1e-3, "msec": 1e-3, "min": 60, "seconds": 1},
    "force": {
        "N": 1, "mN": 1e-3, "kN": 1e3, "µN": 1e-6, "uN": 1e-6, "kgf": 9.80665, "g": 9.80665e-3,
    },
    "friction": {"": 1},
    "shear_stress": {"MPa": 1e6, "kPa": 1e3, "Pa": 1},
    "normal_stress": {"MPa": 1e6, "kPa": 1e3},
    "load_point": {"µm": 1e-6, "um": 1e-6, "microns": 1e-6, "mm": 1e-3, "m": 1, "nm": 1e-9},
}  # fmt: skip
STYLES = (
    "{} [{}]",
    "{}[{}]",
    "{} ({})",
    "{}({})",
    "{} {{{}}}",
    "{}_{}",
    "{} / {}",
    "{}, {}",
    "{} in {}",
)
UNUSED = ["Temperature (C)", "Sample no", "Vertical LVDT [mm]", "Pump"]
PROSE = ["Experiment b819", "Rate: 1000 Hz", "Operator: A. Nonymous, room 12", "Comment; none",
         "date 2019-01-01", "gain 2.5", "*** data ***"]  # fmt: skip


@dataclass
class Case:
    """A file, its name, options to read it, and what it says.

    ``lines`` has the first line of numbers of a text and the line after the last one, from 0.
    """

    name: str
    data: bytes
    time: Array
    force: Array
    force_name: str
    options: dict[str, Any] = field(default_factory=dict)
    text: str = ""
    first: int = 0
    delimiter: str = ","
    decimal: str = "."
    encoding: str = "utf-8"
    newline: str = "\n"
    compression: str = ""
    count: int = 0
    columns: list[str] = field(default_factory=list)
    sizes: list[float] = field(default_factory=list)


def _samples(random: Random) -> dict[str, Array]:
    """Samples in SI: stick-slip or a velocity step, at one rate or two, perhaps with a gap."""
    generator = np.random.default_rng(random.getrandbits(32))
    rows = random.choice([12, 40, 200, 400])
    steps = np.full(rows, random.choice([0.1, 1e-2, 5e-4]))
    if random.random() < 0.3:
        steps[rows // 2 :] /= random.choice([2.0, 10.0])
    if random.random() < 0.2:
        steps[rows // 3] *= random.choice([3, 50])
    time = np.round(random.choice([0.0, 193.9095, 11607.7]) + np.cumsum(steps), 6)
    period = 37 * steps[0]
    force = 0.3 + 0.1 * (time % period) / period + 1e-3 * generator.standard_normal(rows)
    drive = 42e-6 * (time - time[0]) + 1e-9 * generator.standard_normal(rows)
    return {
        "time": time,
        "force": force,
        "friction": force,
        "shear_stress": 1e7 * force,
        "normal_stress": 2e7 + 1e4 * generator.standard_normal(rows),
        "load_point": drive,
    }


def make(name: str) -> Case:
    """A file in some style."""
    random = Random(name)
    samples = _samples(random)
    force = random.choice(["force", "force", "friction", "friction", "shear_stress"])
    quantities = ["time", force]
    if force == "shear_stress" or random.random() < 0.3:
        quantities.append("normal_stress")
    if random.random() < 0.4:
        quantities.append("load_point")
    random.shuffle(quantities)
    units = {one: random.choice(list(UNITS[one])) for one in quantities}
    kind = random.choice(["text"] * 8 + ["npz", "mat", "hdf5", "netcdf"])
    if kind != "text":
        return _binary(kind, quantities, units, samples, force)
    return _text(random, quantities, units, samples, force)


def _expected(force: str, numbers: dict[str, Array]) -> tuple[Array, str]:
    if force == "shear_stress":
        return numbers[force] / numbers["normal_stress"], "friction_coefficient"
    return numbers[force], "friction_coefficient" if force == "friction" else "spring_force"


def _binary(
    kind: str,
    quantities: list[str],
    units: dict[str, str],
    samples: dict[str, Array],
    force: str,
) -> Case:
    plain = {"µN": "uN", "µm": "um", "": ""}
    names, columns = {}, {}
    for one in quantities:
        unit = plain.get(units[one], units[one])
        name = {"friction": "friction"}.get(one, one)
        names[one] = name if kind in {"hdf5", "netcdf"} or not unit else f"{name}_{unit}"
        columns[one] = samples[one] / UNITS[one][units[one]]
    stream = BytesIO()
    if kind == "npz":
        np.savez(stream, allow_pickle=False, **{names[one]: columns[one] for one in quantities})
    elif kind == "mat":
        from scipy.io import savemat

        savemat(stream, {names[one]: columns[one] for one in quantities} | {"fs": 1000.0})
    elif kind == "hdf5":
        import h5py

        with h5py.File(stream, "w") as file:
            for one in quantities:
                made = file.create_dataset(f"run/{names[one]}", data=columns[one])
                made.attrs["units"] = units[one]
    else:
        from scipy.io import netcdf_file

        file = netcdf_file(stream, "w")
        file.createDimension("sample", len(samples["time"]))
        for one in quantities:
            variable = file.createVariable(names[one], "f8", ("sample",))
            variable[:] = columns[one]
            variable.units = plain.get(units[one], units[one])
        file.flush()
    data = stream.getvalue()
    ending = {"npz": "npz", "mat": "mat", "hdf5": "h5", "netcdf": "nc"}[kind]
    values, name = _expected(
        force, {one: columns[one] * UNITS[one][units[one]] for one in quantities}
    )
    return Case(f"record.{ending}", data, samples["time"], values, name)


def _format(random: Random, quantity: str) -> Callable[[float], str]:
    """How the numbers of a column are written: enough digits for the time."""
    if quantity == "time":
        return lambda value: f"{value:.9f}"
    return random.choice([lambda value: f"{value:.9g}", lambda value: f"{value:.7e}"])


def _text(
    random: Random,
    quantities: list[str],
    units: dict[str, str],
    samples: dict[str, Array],
    force: str,
) -> Case:
    delimiter = random.choice(["\t", ",", ";", " ", "|", "  "])
    decimal = random.choice([".", ".", ","]) if delimiter != "," else "."
    encoding = random.choice(["utf-8"] * 4 + ["utf-8-sig", "latin-1", "utf-16"])
    newline = random.choice(["\n", "\n", "\r\n", "\r"])
    style = random.choice(STYLES)
    if delimiter == ",":
        style = style.replace(", ", " / ")
    has_unit_line = random.random() < 0.25
    extra = random.choice(UNUSED) if random.random() < 0.3 else None
    columns, headers, unit_cells, sizes = [], [], [], []
    numbers: dict[str, Array] = {}
    for one in quantities:
        unit, size = units[one], UNITS[one][units[one]]
        write = _format(random, one)
        texts = [write(value / size) for value in samples[one]]
        numbers[one] = np.array([float(text) for text in texts]) * size
        name = random.choice(HEADERS[one]).replace("{}", "")
        unit_style = "{} [{}]" if style == "{}_{}" and unit in {"g", "min"} else style
        if one == "force" and "/" in style:
            unit_style = "{} / {}"
        headers.append(name if has_unit_line or not unit else unit_style.format(name, unit))
        unit_cells.append(unit or "-")
        columns.append([text.replace(".", decimal) for text in texts])
        sizes.append(size)
    names = list(quantities)
    if extra is not None:
        at = random.randint(0, len(columns))
        columns.insert(at, [str(random.randint(10, 99)) for _ in samples["time"]])
        headers.insert(at, extra)
        unit_cells.insert(at, "-")
        names.insert(at, "")
        sizes.insert(at, 1.0)
    is_blank = not delimiter.strip(" ")
    if is_blank and (
        delimiter == "  " or has_unit_line or style not in {"{}_{}", "{}[{}]", "{}({})"}
    ):
        # Names of several words need more than a blank between them.
        delimiter = "  "
    separator = delimiter
    if is_blank and delimiter == " ":
        headers = [one.replace(" ", "_") for one in headers]
    mark = random.choice(["", "", "", "# ", "% ", "#"])
    above = []
    for _ in range(random.choice([0, 0, 1, 3])):
        line = random.choice(PROSE)
        above.append(mark + line)
    above.append(mark + separator.join(headers))
    if has_unit_line:
        above.append(mark + separator.join(unit_cells))
    rows = [separator.join(cells) for cells in zip(*columns, strict=True)]
    kept = np.ones(len(rows), dtype=bool)
    lines = [*above, *rows]
    first = len(above)
    _add_habits(random, lines, first, above, kept, columns, names, separator, is_blank)
    text = newline.join(lines) + (newline if random.random() < 0.9 else "")
    if any(ord(one) > 127 for one in text) and encoding == "latin-1":
        text = text.replace("μ", "µ")
    case = Case(
        "record.txt",
        b"",
        numbers["time"][kept],
        _expected(force, numbers)[0][kept],
        _expected(force, numbers)[1],
        text=text,
        first=first,
        delimiter=" " if is_blank else delimiter,
        decimal=decimal,
        encoding=encoding,
        newline=newline,
        compression=random.choice([""] * 6 + ["gz", "bz2", "xz"]),
        count=len(columns),
        columns=names,
        sizes=sizes,
    )
    case.data = encoded(case, text)
    if case.compression:
        case.name += f".{case.compression}"
    return case


def encoded(case: Case, text: str) -> bytes:
    """The bytes of a file with a text."""
    data = text.encode(case.encoding)
    return packed(case, data)


def packed(case: Case, data: bytes) -> bytes:
    """Bytes as the file of a case compresses them."""
    pack = {"": bytes, "gz": gzip.compress, "bz2": bz2.compress, "xz": lzma.compress}
    return pack[case.compression](data)


def _add_habits(
    random: Random,
    lines: list[str],
    first: int,
    above: list[str],
    kept: NDArray[np.bool_],
    columns: list[list[str]],
    names: list[str],
    separator: str,
    is_blank: bool,
) -> None:
    """What instruments do to rows: repeated headers and blocks, missing numbers, a cut last row."""
    count = len(columns[0])
    if random.random() < 0.2:
        row = random.randrange(count)
        column = random.choice(
            [n for n, name in enumerate(names) if name not in {"", "load_point"}]
        )
        cells = [one[row] for one in columns]
        cells[column] = random.choice(["nan", "NaN", "INF", "-9999", "9.99e37", "OVER"])
        if not is_blank and random.random() < 0.3:
            cells[column] = ""
        if cells[column].startswith("9.99") and any("," in one[row] for one in columns):
            cells[column] = "9,99e37"
        lines[first + row] = separator.join(cells)
        # A row that is normal stress alone counts only for a stress ratio.
        kept[row] = names[column] == "normal_stress" and "shear_stress" not in names
    if random.random() < 0.2:
        start = random.randrange(count - 6)
        length = random.randint(2, 5)
        block = lines[first + start : first + start + length]
        lines[first + start + length : first + start + length] = block
    elif random.random() < 0.15 and count > 30:
        at = first + random.randrange(10, count - 10)
        lines[at:at] = above if random.random() < 0.5 else [above[-1]]
    if random.random() < 0.1 and separator.strip() and len(columns) > 2:
        cut = separator.join(one[0] for one in columns)[:6]
        if separator in cut[:-1] or separator not in cut:
            lines.append(cut.rstrip(separator))


DAMAGES = (
    "flip", "flip", "flip", "character", "delete", "insert", "cut cell", "empty cell", "swap",
    "delimiter", "comma", "cut file", "repeat", "text", "join",
)  # fmt: skip


def damage(name: str) -> tuple[Case, list[int], str]:
    """A damaged text, the lines from 0 that are not as they were, and how they were damaged."""
    random = Random(name)
    number = 0
    case = make(f"{name} {number}")
    while not case.text:
        number += 1
        case = make(f"{name} {number}")
    case.compression, case.newline = "", "\n"
    case.encoding = "utf-8" if case.encoding == "utf-16" else case.encoding
    case.name = "record.txt"
    text = case.text.replace("\r\n", "\n").replace("\r", "\n")
    how = random.choice(DAMAGES)
    lines = text.split("\n")
    rows = [n for n in range(case.first, len(lines)) if lines[n].strip()]
    at = random.choice(rows) if random.random() < 0.85 else random.randrange(case.first)
    case.text = text
    changed = [at]
    line = lines[at]
    place = random.randrange(len(line)) if line else 0
    delimiter = case.delimiter
    if how == "flip":
        data = bytearray(line.encode("latin-1", "replace"))
        if data:
            data[place] ^= 1 << random.randrange(8)
        line = bytes(data).decode("latin-1")
    elif how == "character":
        line = line[:place] + random.choice(" .,;:-+eEx\"'#%\t0123456789NO_µ") + line[place + 1 :]
    elif how == "delete":
        line = line[:place] + line[place + 1 :]
    elif how == "insert":
        line = line[:place] + random.choice(' .,;-+eE"0123\x00\x1a') + line[place:]
    elif how == "cut cell":
        line = line[:place]
    elif how in {"empty cell", "swap", "delimiter", "comma"}:
        cells = line.split(delimiter) if delimiter != " " else line.split()
        one = random.randrange(len(cells))
        if how == "empty cell":
            cells[one] = ""
        elif how == "swap":
            other = random.randrange(len(cells))
            cells[one], cells[other] = cells[other], cells[one]
        elif how == "comma":
            cells[one] = cells[one].translate(str.maketrans(".,", ",."))
        joint = random.choice(",;\t |") if how == "delimiter" else delimiter
        line = joint.join(cells)
    elif how == "text":
        line = random.choice(["stopped by hand", "12:30:01", "Error 17", "1", "-", "time force"])
    lines[at] = line
    if how == "repeat":
        lines.insert(at, line)
        changed = [at, at + 1]
    elif how == "join" and at + 1 < len(lines):
        lines[at : at + 2] = [line + lines[at + 1]]
        changed = [at]
    text = "\n".join(lines)
    if how == "cut file":
        end = random.randrange(len(text) // 2, len(text))
        text = text[:end]
        changed = [text.count("\n")]
    case.text = text
    encoding = "latin-1" if how == "flip" else case.encoding
    case.data = text.encode(encoding, "replace")
    return case, changed, how


# A number, said once more and otherwise than the program does.
STRICT = re.compile(
    r"^[+-]?\d+(?:[.,]\d*)?(?:[eE][+-]?\d+)?$|^[+-]?[.,]\d+(?:[eE][+-]?\d+)?$", re.A
)


def literal_rows(case: Case, changed: list[int]) -> list[list[float]]:
    """Rows that changed lines say by their letters, in SI, in the order of the file's columns."""
    found = []
    lines = case.text.split("\n")
    for at in changed:
        line = lines[at] if at < len(lines) else ""
        cells = line.split() if case.delimiter == " " else line.split(case.delimiter)
        row = []
        for cell, size in zip(cells, case.sizes, strict=False):
            text = cell.strip().strip('"')
            other = "," if case.decimal == "." else "."
            is_read = STRICT.match(text) and other not in text
            row.append(float(text.replace(",", ".")) * size if is_read else np.nan)
        if len(row) == case.count:
            found.append(row)
    return found


def force_of(case: Case, row: list[float]) -> tuple[float, float]:
    """Time and force of a row."""
    values = dict(zip(case.columns, row, strict=True))
    if "shear_stress" in values:
        return values["time"], values["shear_stress"] / values["normal_stress"]
    force = next(values[name] for name in ("force", "friction") if name in values)
    return values["time"], force


def wrong_samples(case: Case, time: Array, force: Array, changed: list[int]) -> list[str]:
    """Samples that neither the whole file has nor a changed line by its letters."""
    true = np.column_stack([case.time, case.force])
    extra = [force_of(case, row) for row in literal_rows(case, changed)]
    allowed = np.vstack([true, np.array(extra).reshape(-1, 2)])
    allowed = allowed[np.isfinite(allowed).all(axis=1)]
    order = np.argsort(allowed[:, 0])
    allowed = allowed[order]
    problems = []
    for one, other in zip(time, force, strict=True):
        near = np.abs(allowed[:, 0] - one) <= 1e-9 * (1 + abs(one))
        if not (np.abs(allowed[near, 1] - other) <= 1e-6 * abs(other) + 1e-12).any():
            problems.append(f"wrong: {other:g} at {one:g} s")
    return problems[:3]


def check_whole(case: Case, path: Path) -> list[str]:
    """What is wrong with the reading of a file in some style."""
    from mesoslip import MesoslipError
    from mesoslip.measured.understanding import understand

    try:
        record = understand(path, **case.options).record
    except MesoslipError as error:
        return [f"refused: {error}"]
    time, force = case.time, case.force
    is_cut = "the last row seems to be cut short" in "\n".join(record.report)
    if is_cut and len(record.time) == len(time) - 1:
        # Without a line break at the end, fewer digits may be a cut; of numbers or of none.
        time, force = time[:-1], force[:-1]
    if record.force_name != case.force_name or len(record.time) != len(time):
        return [f"{record.force_name}, {len(record.time)} samples for {len(time)}"]
    is_right = np.allclose(record.time, time, rtol=1e-9, atol=1e-9) and np.allclose(
        record.force, force, rtol=1e-6
    )
    return [] if is_right else ["other numbers"]


def check(case: Case, path: Path, changed: list[int], how: str) -> tuple[str, list[str]]:
    """Read a damaged file: what came of it, and what is wrong.

    Returns
    -------
    tuple
        "refused", "right", or "guessed" if what is wrong is reported as a guess; and problems.
    """
    from mesoslip import FileError
    from mesoslip.measured.understanding import understand

    try:
        record = understand(path, **case.options).record
    except FileError as error:
        message = str(error)
        is_plain = "\n" not in message and len(message) < 1500
        names_place = re.search(r"\b(line|columns?|part|samples)\b", message)
        return "refused", [] if is_plain and names_place else [f"message: {message}"]
    report = "\n".join(record.report)
    if changed[0] < case.first and "guess: " in report:
        # A unit or a name that is damaged may be another one: it is reported.
        return "guessed", []
    if record.force_name != case.force_name:
        return "wrong", [f"read as {record.force_name}"]
    problems = wrong_samples(case, record.time, record.force, changed)
    if problems and "has no unit: taken" in report:
        return "guessed", []
    ratio = record.force[:1] / case.force[:1]
    if changed[0] < case.first and how != "swap" and problems:
        # Nor can anybody see that a unit has become another one.
        shares = record.force[: len(case.force)] / case.force[: len(record.force)]
        if np.allclose(shares, ratio, rtol=1e-6):
            return "another unit", []
    # Nobody can see that headers were exchanged, or lines are gone.
    if how == "swap" and changed[0] < case.first:
        return "right", []
    is_gone = how == "cut file" or not case.text.split("\n")[changed[0]].strip()
    is_named = any(re.search(rf"\b{one + 1}\b", report) for one in changed)
    words = ("left out", "used once", "taken as missing", "part ")
    if len(record.time) < len(case.time) and not (
        is_gone or is_named or any(one in report for one in words)
    ):
        problems.append("samples are missing, and the report does not say so")
    return ("wrong" if problems else "right"), problems


def write(case: Case, folder: Path) -> Path:
    """The file of a case."""
    path = folder / case.name
    path.write_bytes(case.data)
    return path
