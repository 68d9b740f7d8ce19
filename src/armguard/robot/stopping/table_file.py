"""Tables of measured stops as makers publish them: CSV files to `StopTable`s."""

import csv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import accumulate
from math import isfinite, radians
from pathlib import Path

from armguard.bounded import read_text, shown
from armguard.errors import did_you_mean
from armguard.robot.model import JointKind, RobotModel
from armguard.robot.stopping.figures import FiguresError
from armguard.robot.stopping.table import StopTable

# Largest table [byte].
MOST_TABLE_BYTES = 2_000_000

# Columns by what they hold: exactly one of each group, but load and extension may be
# left out. ISO 10218-1, annex B, has speed, load and extension in percent.
SPEEDS = ("speed_percent", "speed")
TIMES = {"time_s": 1.0, "time_ms": 1e-3}
TRAVELS = {"angle_rad": 1.0, "angle_deg": radians(1.0), "travel_m": 1.0}
CONDITIONS = ("load_percent", "extension_percent")
COLUMNS = ("joint", *SPEEDS, *CONDITIONS, *TIMES, *TRAVELS)
UNITS = {**TIMES, **TRAVELS}
IN_ANGLES = "angle_rad or angle_deg"


@dataclass(frozen=True, slots=True, kw_only=True)
class TableFile:
    """A CSV file of measured stops, and the conditions the robot works under.

    Attributes:
        path: The file.
        load: Load the robot carries, in percent of its rated one; None if any.
        extension: Extension it works at, in percent; None if any.
    """

    path: Path
    load: float | None = None
    extension: float | None = None

    @property
    def declared(self) -> dict[str, float]:
        """The conditions that are declared, by their columns [percent]."""
        given = zip(CONDITIONS, (self.load, self.extension), strict=True)
        return {column: value for column, value in given if value is not None}

    def wrong(self, sentence: str, line: int = 0) -> FiguresError:
        """An error about the file: `stop.csv:7: ...`."""
        where = f"{self.path.name}:{line}" if line else self.path.name
        return FiguresError(f"{where}: {sentence}", "tables")


@dataclass(frozen=True, slots=True)
class MeasuredStop:
    """One row of the file.

    Attributes:
        joint: The joint.
        speed: Its speed when the stop was ordered [rad/s or m/s].
        conditions: Load and extension by their columns, where the file has them
            [percent].
        time: Time to rest [s].
        travel: Way to rest [rad or m].
    """

    joint: str
    speed: float
    conditions: Mapping[str, float]
    time: float
    travel: float


def read_stop_tables(
    file: TableFile, model: RobotModel, velocity: Mapping[str, float]
) -> dict[str, StopTable]:
    """Tables of the joints a file has rows for, by joint name.

    Of each joint and speed the worst is taken of all rows at the next load and
    extension at or above the declared and at the next below; of all rows if none is
    declared. A higher speed never counts for less than a lower one.

    Args:
        file: The file and the conditions.
        model: The robot.
        velocity: Top speed of each joint, what percent are of [rad/s or m/s].

    Raises:
        FiguresError: The file cannot be read, or says what cannot be true.
    """
    grouped: dict[str, dict[float, list[MeasuredStop]]] = {}
    for row in measured_stops(file, model, velocity):
        grouped.setdefault(row.joint, {}).setdefault(row.speed, []).append(row)
    tables = {}
    for joint, by_speed in grouped.items():
        found = [near_conditions(file, rows) for _, rows in sorted(by_speed.items())]
        times = accumulate((max(row.time for row in rows) for rows in found), max)
        travels = accumulate((max(row.travel for row in rows) for rows in found), max)
        tables[joint] = StopTable(tuple(sorted(by_speed)), tuple(times), tuple(travels))
    return tables


def near_conditions(
    file: TableFile, rows: Sequence[MeasuredStop]
) -> Sequence[MeasuredStop]:
    """Rows at the next load and extension at or above the declared, and next below.

    Args:
        file: The file and the conditions.
        rows: Rows of one joint and speed.

    Raises:
        FiguresError: Nothing was measured at or above one.
    """
    for column, declared in file.declared.items():
        given = {row.conditions[column] for row in rows}
        above = [value for value in given if value >= declared]
        if not above:
            raise file.wrong(
                f"has no stop of joint '{rows[0].joint}' from {rows[0].speed:g} at a "
                f"{column} of {declared:g} or more"
            )
        wanted = {min(above)}
        if declared not in wanted:
            wanted |= {max((v for v in given if v < declared), default=declared)}
        rows = [row for row in rows if row.conditions[column] in wanted]
    return rows


def measured_stops(
    file: TableFile, model: RobotModel, velocity: Mapping[str, float]
) -> list[MeasuredStop]:
    """Rows of a file.

    Raises:
        FiguresError: A column or a value is wrong; with its line.
    """
    try:
        text = read_text(file.path, MOST_TABLE_BYTES)
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "it is not UTF-8"
        raise file.wrong(f"cannot be read: {reason}") from None
    reader = csv.DictReader(text.split("\n"), skipinitialspace=True, strict=True)
    try:
        columns = [name.strip() for name in reader.fieldnames or []]
        reader.fieldnames = columns
        measures = check_columns(file, columns)
        rows = [
            measured_stop(file, row, reader.line_num, measures, model, velocity)
            for row in reader
        ]
    except csv.Error as error:
        raise file.wrong(f"is no table: {error}", reader.line_num) from None
    if not rows:
        raise file.wrong("has no rows")
    return rows


def measured_stop(
    file: TableFile,
    row: Mapping[str, str],
    line: int,
    measures: Sequence[str],
    model: RobotModel,
    velocity: Mapping[str, float],
) -> MeasuredStop:
    """A row of a file, see `read_stop_tables`.

    Args:
        file: The file.
        row: Text by column.
        line: Its line.
        measures: Columns of speed, time and travel.
        model: The robot.
        velocity: Top speed of each joint [rad/s or m/s].

    Raises:
        FiguresError: A value is wrong.
    """

    def number(column: str) -> float:
        try:
            value = float(row[column])
        except (TypeError, ValueError):
            text = shown(repr(row[column]))
            raise file.wrong(f"{column} is {text}, no number", line) from None
        if not (isfinite(value) and value >= 0.0):
            raise file.wrong(f"{column} is {value}; it must be >= 0", line)
        return value

    in_speed, in_time, in_travel = measures
    joint = (row["joint"] or "").strip()
    if joint not in model.q_names:
        known = did_you_mean(joint, model.q_names)
        raise file.wrong(f"no joint is named '{shown(joint)}'; {known}", line)
    slides = model.joints[joint].kind is JointKind.PRISMATIC
    if slides != (in_travel == "travel_m"):
        moves, right = ("slides", "travel_m") if slides else ("turns", IN_ANGLES)
        raise file.wrong(
            f"joint '{joint}' {moves}; its way is in {right}, not in {in_travel}", line
        )
    speed = number(in_speed)
    if in_speed == "speed_percent":
        speed *= velocity[joint] / 100.0
    time, travel = (number(c) * UNITS[c] for c in (in_time, in_travel))
    if min(speed, time, travel) <= 0.0:
        raise file.wrong("speed, time and way of a stop must be > 0", line)
    if travel > speed * time:
        raise file.wrong(
            f"joint '{joint}' starts to stop at {speed:g} and cannot get {travel:g} "
            f"far in {time:g} s",
            line,
        )
    conditions = {column: number(column) for column in CONDITIONS if column in row}
    return MeasuredStop(joint, speed, conditions, time, travel)


def check_columns(file: TableFile, columns: Sequence[str]) -> list[str]:
    """Names of the columns of speed, time and travel.

    Raises:
        FiguresError: One is unknown, is missing or is there twice.
    """
    for name in columns:
        if name not in COLUMNS:
            known = did_you_mean(name, COLUMNS)
            raise file.wrong(f"there is no column '{shown(name)}'; {known}", 1)
    found = []
    for group in (("joint",), SPEEDS, TIMES, TRAVELS):
        given = [name for name in columns if name in group]
        if len(given) != 1:
            has = " and ".join(given) if given else "none"
            raise file.wrong(f"needs one column of {', '.join(group)}; has {has}", 1)
        found.append(given[0])
    for column in file.declared:
        if column not in columns:
            what = column.removesuffix("_percent")
            raise file.wrong(f"has no column {column}, yet a {what} is declared", 1)
    return found[1:]
