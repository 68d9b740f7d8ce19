"""Tables of measured stops as makers publish them: CSV files to `StopTable`s."""

import csv
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
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


@dataclass(frozen=True, slots=True)
class MeasuredStop:
    """One row of the file.

    Attributes:
        joint: The joint.
        speed: Its speed when the stop was ordered [rad/s or m/s].
        conditions: Load and extension in percent, None where the file has none.
        time: Time to rest [s].
        travel: Way to rest [rad or m].
    """

    joint: str
    speed: float
    conditions: tuple[float | None, float | None]
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
        speeds = sorted(by_speed)
        times: list[float] = []
        travels: list[float] = []
        for speed in speeds:
            rows = by_speed[speed]
            for k, declared in enumerate((file.load, file.extension)):
                if declared is not None:
                    rows = near_condition(file, rows, k, declared)
            times.append(max([*times[-1:], *(row.time for row in rows)]))
            travels.append(max([*travels[-1:], *(row.travel for row in rows)]))
        tables[joint] = StopTable(tuple(speeds), tuple(times), tuple(travels))
    return tables


def near_condition(
    file: TableFile, rows: Sequence[MeasuredStop], k: int, declared: float
) -> list[MeasuredStop]:
    """Rows at the next load or extension at or above the declared, and next below.

    Args:
        file: For messages.
        rows: Rows of one joint and speed.
        k: 0 for the load, 1 for the extension.
        declared: What the robot works at [percent].

    Raises:
        FiguresError: Nothing was measured at or above it.
    """
    given = {value for row in rows if (value := row.conditions[k]) is not None}
    above = [value for value in given if value >= declared]
    if not above:
        raise wrong(
            file,
            f"has no stop of joint '{rows[0].joint}' from {rows[0].speed:g} at a "
            f"{CONDITIONS[k]} of {declared:g} or more",
        )
    wanted = {min(above)}
    below = [value for value in given if value < declared]
    if below and declared not in wanted:
        wanted.add(max(below))
    return [row for row in rows if row.conditions[k] in wanted]


def measured_stops(
    file: TableFile, model: RobotModel, velocity: Mapping[str, float]
) -> Iterator[MeasuredStop]:
    """Rows of a file.

    Raises:
        FiguresError: A column or a value is wrong; with its line.
    """
    try:
        text = read_text(file.path, MOST_TABLE_BYTES)
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "it is not UTF-8"
        raise wrong(file, f"cannot be read: {reason}") from None
    reader = csv.DictReader(text.split("\n"), skipinitialspace=True, strict=True)
    try:
        yield from measured_rows(file, model, velocity, reader)
    except csv.Error as error:
        raise wrong(file, f"is no table: {error}", reader.line_num) from None


def measured_rows(
    file: TableFile,
    model: RobotModel,
    velocity: Mapping[str, float],
    reader: "csv.DictReader[str]",
) -> Iterator[MeasuredStop]:
    """Rows of a table, see `measured_stops`."""
    columns = [name.strip() for name in reader.fieldnames or []]
    reader.fieldnames = columns
    speed_column, time_column, travel_column = check_columns(file, columns)
    count = 0
    for row in reader:
        count += 1
        line = reader.line_num

        def number(column: str, row: dict[str, str] = row, line: int = line) -> float:
            try:
                value = float(row[column])
            except (TypeError, ValueError):
                raise wrong(
                    file, f"{column} is {shown(repr(row[column]))}, no number", line
                ) from None
            if not (isfinite(value) and value >= 0.0):
                raise wrong(file, f"{column} is {value}; it must be >= 0", line)
            return value

        joint = (row["joint"] or "").strip()
        if joint not in model.q_names:
            raise wrong(
                file,
                f"no joint is named '{shown(joint)}'; "
                f"{did_you_mean(joint, model.q_names)}",
                line,
            )
        slides = model.joints[joint].kind is JointKind.PRISMATIC
        if slides != (travel_column == "travel_m"):
            right = "travel_m" if slides else "angle_rad or angle_deg"
            raise wrong(
                file,
                f"joint '{joint}' {'slides' if slides else 'turns'}; its way is in "
                f"{right}, not in {travel_column}",
                line,
            )
        speed = number(speed_column)
        if speed_column == "speed_percent":
            speed *= velocity[joint] / 100.0
        time = number(time_column) * TIMES[time_column]
        travel = number(travel_column) * TRAVELS[travel_column]
        if min(speed, time, travel) <= 0.0:
            raise wrong(file, "speed, time and way of a stop must be > 0", line)
        if travel > speed * time:
            raise wrong(
                file,
                f"joint '{joint}' starts to stop at {speed:g} and cannot get "
                f"{travel:g} far in {time:g} s",
                line,
            )
        load, extension = (
            number(column) if column in columns else None for column in CONDITIONS
        )
        yield MeasuredStop(joint, speed, (load, extension), time, travel)
    if not count:
        raise wrong(file, "has no rows")


def check_columns(file: TableFile, columns: Sequence[str]) -> tuple[str, str, str]:
    """Names of the columns of speed, time and travel.

    Raises:
        FiguresError: One is unknown, is missing or is there twice.
    """
    for name in columns:
        if name not in COLUMNS:
            raise wrong(
                file,
                f"there is no column '{shown(name)}'; {did_you_mean(name, COLUMNS)}",
                1,
            )
    found = []
    for group in (("joint",), SPEEDS, tuple(TIMES), tuple(TRAVELS)):
        given = [name for name in columns if name in group]
        if len(given) != 1:
            has = " and ".join(given) if given else "none"
            raise wrong(file, f"needs one column of {', '.join(group)}; has {has}", 1)
        found.append(given[0])
    for column, declared in zip(CONDITIONS, (file.load, file.extension), strict=True):
        if declared is not None and column not in columns:
            what = column.removesuffix("_percent")
            raise wrong(file, f"has no column {column}, yet a {what} is declared", 1)
    return found[1], found[2], found[3]


def wrong(file: TableFile, sentence: str, line: int = 0) -> FiguresError:
    """An error about a file: `stop.csv:7: ...`."""
    where = f"{file.path.name}:{line}" if line else file.path.name
    return FiguresError(f"{where}: {sentence}", "tables")
