"""Motion as a table of text: a header of joint names, one configuration a row."""

import csv
import re
from itertools import takewhile
from pathlib import Path

import numpy as np

from armguard.bounded import read_text, shown
from armguard.errors import TrajectoryError
from armguard.scene.trajectory import Trajectory

# Largest file [byte], most lines, and most characters of a line.
MOST_CSV_BYTES = 100_000_000
MOST_LINES = 500_000
MOST_IN_LINE = 20_000

# Column names that mean time, and units they may end in: `t`, `time_ms`, `stamp [s]`.
TIME_COLUMN = re.compile(
    r"(?:t|time|stamp|timestamp|time_from_start)"
    r"(?:[ _]?[\[(]?(s|sec|ms|us|µs|ns)[\])]?)?",
    re.IGNORECASE,
)
UNITS = {"s": 1.0, "sec": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "ns": 1e-9}

# Seconds since 1970 are below this for another three thousand years [s].
MOST_SECONDS = 1e11

# What a first column without a name holds: the row's number, as pandas writes it.
INDEX_COLUMNS = ("", "Unnamed: 0")


def read_csv(path: Path) -> Trajectory:
    """CSV with a header of joint names.

    Separated by commas, semicolons, tabs or blanks, whichever the header has. Lines
    that begin with `#` are remarks; the header may be one, as NumPy writes it.
    """
    text = read_text(path, MOST_CSV_BYTES)
    count = text.count("\n")
    if count > MOST_LINES:
        raise TrajectoryError(
            f"'{path.name}' has {count:,} lines; the limit is {MOST_LINES:,}: split it"
        )
    lines = [
        (k, line.strip())
        for k, line in enumerate(text.split("\n"), start=1)
        if line.strip()
    ]
    long = next((k for k, line in lines if len(line) > MOST_IN_LINE), 0)
    if long:
        raise TrajectoryError(
            f"{path.name}:{long}: the line has more than {MOST_IN_LINE:,} characters"
        )
    first, header, separator = header_of(path.name, lines)
    values = [
        row_of(split(line, separator), len(header), f"{path.name}:{k}", separator)
        for k, line in lines
        if k > first and not line.startswith("#")
    ]
    table = np.array(values, dtype=np.float64).reshape(len(values), len(header))
    names, table = without_index(header, table)
    if not all(names):
        raise TrajectoryError(
            f"{path.name}:{first}: the first line must hold the joint names; column "
            f"{names.index('') + 1} has none"
        )
    time = [k for k, name in enumerate(names) if TIME_COLUMN.fullmatch(name)]
    joints = [k for k in range(len(names)) if k not in time]
    if not joints:
        raise TrajectoryError(f"{path.name}:{first}: there is no joint in the header")
    return Trajectory(
        names=tuple(names[k] for k in joints),
        q=table[:, joints],
        stamps=seconds(path.name, names[time[0]], table[:, time[0]]) if time else None,
        source=path.name,
    )


def header_of(name: str, lines: list[tuple[int, str]]) -> tuple[int, list[str], str]:
    """Number of the header's line, its names, and what separates them."""
    remarks = list(takewhile(lambda line: line[1].startswith("#"), lines))
    number, text = next(iter(lines[len(remarks) :]), (1, ""))
    if remarks and all(is_number(cell) for cell in split(text, separator_of(text))):
        number, text = remarks[-1][0], remarks[-1][1].lstrip("# ")
    separator = separator_of(text)
    header = split(text, separator)
    if not text:
        raise TrajectoryError(f"{name}:1: the first line must hold the joint names")
    if all(is_number(cell) for cell in header):
        raise TrajectoryError(
            f"{name}:{number}: the first line must hold the joint names; it holds "
            "numbers"
        )
    twice = [cell for cell in header if header.count(cell) > 1]
    if twice:
        raise TrajectoryError(
            f"{name}:{number}: column '{shown(twice[0])}' is there twice"
        )
    return number, header, separator


def separator_of(text: str) -> str:
    """What separates the cells of a line."""
    sign = max(",;\t", key=text.count)
    if text.count(sign):
        return sign
    return " " if " " in text else ","


def split(text: str, separator: str) -> list[str]:
    """Cells of a line."""
    if separator == " " or not text:
        return text.split()
    try:
        return [cell.strip() for cell in next(csv.reader([text], delimiter=separator))]
    except csv.Error:
        return [text]


def row_of(cells: list[str], count: int, at: str, separator: str) -> list[float]:
    """Numbers of a line."""
    if len(cells) != count:
        raise TrajectoryError(f"{at}: {len(cells)} columns; the header has {count}")
    if separator == ";":
        # Where numbers have a decimal comma, columns are parted by semicolons.
        cells = [cell.replace(",", ".") for cell in cells]
    try:
        return [float(cell) for cell in cells]
    except ValueError:
        bad = next(cell for cell in cells if not is_number(cell))
        raise TrajectoryError(f"{at}: '{shown(bad)}' is no number") from None


def is_number(text: str) -> bool:
    """Whether a cell is a number."""
    try:
        float(text)
    except ValueError:
        return False
    return True


def without_index(header: list[str], table: np.ndarray) -> tuple[list[str], np.ndarray]:
    """The table without a first column that only counts its rows."""
    counts = np.arange(len(table))
    counted = len(table) and ((table[:, 0] - table[0, 0]) == counts).all()
    if header[0] in INDEX_COLUMNS and counted:
        return header[1:], table[:, 1:]
    return header, table


def seconds(name: str, column: str, values: np.ndarray) -> np.ndarray:
    """A column of times [s]."""
    match = TIME_COLUMN.fullmatch(column)
    unit = match and match.group(1)
    if unit:
        return np.asarray(values * UNITS[unit.lower()])
    if len(values) and abs(values[0]) > MOST_SECONDS:
        raise TrajectoryError(
            f"{name}: column '{column}' begins with {values[0]:g}, which is no time in "
            f"seconds; name its unit: '{column}_ms', '{column}_us' or '{column}_ns'"
        )
    return values
