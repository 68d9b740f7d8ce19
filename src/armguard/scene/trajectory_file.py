"""Motion files: tables of text, arrays, and what ROS and MoveIt write."""

import csv
from io import BytesIO
from itertools import takewhile
from pathlib import Path
from zipfile import ZipFile, is_zipfile

import numpy as np
from numpy.lib.format import read_array
from ruamel.yaml import YAMLError

from armguard.bounded import read_bytes, read_text, shown
from armguard.errors import TrajectoryError
from armguard.scene.trajectory import Trajectory
from armguard.scene.trajectory_ros import read_trajectory
from armguard.scene.trajectory_times import (
    TIME_COLUMN,
    check_times,
    seconds,
    unit_of,
)
from armguard.scene.yaml_source import MOST_YAML_BYTES, parse_yaml, sentence_of_yaml

# Largest table of text [byte], most lines, and most characters of a line.
MOST_CSV_BYTES = 100_000_000
MOST_LINES = 500_000
MOST_IN_LINE = 20_000

# The remedy for a line that does not fit the header.
AS_THE_HEADER = (
    "write one number a column, with a decimal point, separated as the header is"
)

# What a first column without a name holds: the row's number, as pandas writes it.
INDEX_COLUMNS = ("", "Unnamed: 0")

# Largest file of arrays, and what it may unpack to [byte].
MOST_NPZ_BYTES = 256_000_000
MOST_UNPACKED = 256_000_000

# What others call the arrays, ours first.
NAMES = ("names", "joint_names", "joints")
POSITIONS = ("q", "qpos", "positions", "joint_positions")
VELOCITIES = ("velocities", "joint_velocities")
ACCELERATIONS = ("accelerations", "joint_accelerations")


def load_trajectory(path: str | Path) -> Trajectory:
    """Read a motion: CSV, NPZ, or a trajectory or MoveIt's motion request in YAML.

    CSV: a header of joint names, one configuration a row; a column `t`, `time` or
    `stamp` is time. NPZ: arrays `names`, `q` and, if there is time, `t`; `velocities`
    and `accelerations` of that shape may be there too. YAML and JSON: a
    `JointTrajectory` or `RobotTrajectory` as ROS prints it.

    Raises:
        TrajectoryError: The file cannot be read as any of these.
    """
    path = Path(path)
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        known = ", ".join(READERS)
        raise TrajectoryError(
            f"'{path.name}' is no motion file; it must end in one of {known}"
        )
    try:
        trajectory = reader(path)
    except UnicodeDecodeError:
        raise TrajectoryError(
            f"'{path.name}' is no text in UTF-8; save it as {path.suffix[1:].upper()} "
            "in UTF-8"
        ) from None
    except OSError as error:
        raise TrajectoryError(f"'{path}' cannot be read: {error.strerror}") from None
    check_motion(trajectory)
    return trajectory


def check_motion(trajectory: Trajectory) -> None:
    """Refuse a motion that is empty, or whose times are not finite or go back."""
    source, stamps = trajectory.source, trajectory.stamps
    if len(trajectory.q) == 0:
        raise TrajectoryError(
            f"{source}: there is no configuration in it; give at least one"
        )
    if stamps is not None:
        check_times(source, stamps)


def read_csv(path: Path) -> Trajectory:
    """CSV with a header of joint names.

    Separated by commas, semicolons, tabs, bars or blanks, whichever the header has.
    Lines that begin with `#` are remarks; the header may be one, as NumPy writes it.
    """
    text, name = read_text(path, MOST_CSV_BYTES), path.name
    count = text.count("\n")
    if count > MOST_LINES:
        raise TrajectoryError(
            f"'{name}' has {count:,} lines; the limit is {MOST_LINES:,}: split it"
        )
    every = enumerate(map(str.strip, text.split("\n")), start=1)
    lines = [(k, line) for k, line in every if line]
    for k, line in lines:
        if len(line) > MOST_IN_LINE:
            raise TrajectoryError(
                f"{name}:{k}: the line has more than {MOST_IN_LINE:,} characters"
            )
    first, names, separator = header_of(name, lines)
    values = [
        row_of(split(line, separator), names, f"{name}:{k}", separator)
        for k, line in lines
        if k > first and not line.startswith("#")
    ]
    table = np.array(values, dtype=np.float64).reshape(len(values), len(names))
    counted = len(table) and (table[:, 0] - table[0, 0] == range(len(table))).all()
    if names[0] in INDEX_COLUMNS and counted:
        names, table = names[1:], table[:, 1:]
    if not all(names):
        raise TrajectoryError(
            f"{name}:{first}: the first line must hold the joint names; column "
            f"{names.index('') + 1} has none"
        )
    time = [k for k, column in enumerate(names) if TIME_COLUMN.fullmatch(column)]
    if len(time) > 1:
        raise TrajectoryError(
            f"{name}:{first}: columns '{names[time[0]]}' and '{names[time[1]]}' are "
            "both times; delete one"
        )
    joints = [k for k in range(len(names)) if k not in time]
    if not joints:
        raise TrajectoryError(f"{name}:{first}: there is no joint in the header")
    return Trajectory(
        names=tuple(names[k] for k in joints),
        q=table[:, joints],
        stamps=seconds(name, names[time[0]], table[:, time[0]]) if time else None,
        source=name,
        unit_known=bool(time and unit_of(names[time[0]])),
    )


def header_of(name: str, lines: list[tuple[int, str]]) -> tuple[int, list[str], str]:
    """Number of the header's line, its names, and what separates them."""
    remarks = list(takewhile(lambda line: line[1].startswith("#"), lines))
    number, text = next(iter(lines[len(remarks) :]), (1, ""))
    if remarks and all(map(is_number, split(text, separator_of(text)))):
        number, text = remarks[-1][0], remarks[-1][1].lstrip("# ")
    separator = separator_of(text)
    header = split(text, separator)
    if not text or all(map(is_number, header)):
        held = "; it holds numbers" if text else ""
        raise TrajectoryError(
            f"{name}:{number if text else 1}: the first line must hold the joint names"
            f"{held}"
        )
    twice = [cell for cell in header if header.count(cell) > 1]
    if twice:
        raise TrajectoryError(
            f"{name}:{number}: column '{shown(twice[0])}' is there twice; delete one"
        )
    return number, header, separator


def separator_of(text: str) -> str:
    """What separates the cells of a line."""
    sign = max(",;\t|", key=text.count)
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


def row_of(cells: list[str], names: list[str], at: str, separator: str) -> list[float]:
    """Numbers of a line."""
    if len(cells) != len(names):
        raise TrajectoryError(
            f"{at}: {len(cells)} columns; the header has {len(names)}; {AS_THE_HEADER}"
        )
    if separator == ";":
        # Where numbers have a decimal comma, columns are parted by semicolons.
        cells = [cell.replace(",", ".") for cell in cells]
    try:
        return [float(cell) for cell in cells]
    except ValueError:
        k = next(k for k, cell in enumerate(cells) if not is_number(cell))
        raise TrajectoryError(
            f"{at}: '{shown(cells[k])}' is no number, in column '{shown(names[k])}'; "
            f"{AS_THE_HEADER}"
        ) from None


def is_number(text: str) -> bool:
    """Whether a cell is a number."""
    try:
        float(text)
    except ValueError:
        return False
    return True


def read_npz(path: Path) -> Trajectory:
    """NPZ with `names`, `q` and perhaps `t`, or under what others call these."""
    name, data = path.name, read_bytes(path, MOST_NPZ_BYTES)
    try:
        held = arrays_of(data)
    except Exception as error:  # zip files, their compression and NumPy have their own
        why = shown(str(error) or type(error).__name__)
        if "Object arrays" in why:
            why = "an array holds Python objects; write names as np.array(names)"
        raise TrajectoryError(f"'{name}' is no NPZ file: {why}") from None
    names = tuple(str(joint) for joint in np.atleast_1d(array_of(held, NAMES, name)))
    q = array_of(held, POSITIONS, name)
    if q.dtype.kind not in "fiu":
        raise TrajectoryError(f"{name}: q holds {q.dtype}; it must hold numbers")
    if q.ndim != 2 or q.shape[1] != len(names):
        hint = "; it is (k, n), turn it" if q.shape[:1] == (len(names),) else ""
        raise TrajectoryError(
            f"{name}: q has shape {q.shape}; it must be (n, {len(names)}){hint}"
        )
    keys = [key for key in held if TIME_COLUMN.fullmatch(key)]
    if len(keys) > 1:
        raise TrajectoryError(
            f"{name}: arrays '{keys[0]}' and '{keys[1]}' are both times; leave one out"
        )
    key = keys[0] if keys else ""
    stamps = held.get(key)
    if stamps is not None:
        if stamps.shape != (len(q),) or stamps.dtype.kind not in "fiu":
            raise TrajectoryError(
                f"{name}: {key} has shape {stamps.shape} of {stamps.dtype}; it must be "
                f"({len(q)},) of numbers"
            )
        stamps = seconds(name, key, np.asarray(stamps, dtype=np.float64))
    return Trajectory(
        names=names,
        q=np.asarray(q, dtype=np.float64),
        stamps=stamps,
        source=name,
        unit_known=unit_of(key) is not None,
        velocities=rates_of(held, VELOCITIES, q, name),
        accelerations=rates_of(held, ACCELERATIONS, q, name),
    )


def rates_of(
    held: dict[str, np.ndarray], keys: tuple[str, ...], q: np.ndarray, file: str
) -> np.ndarray | None:
    """The array of velocities or accelerations; None if there is none."""
    key = next((key for key in keys if key in held), "")
    if not key:
        return None
    found = held[key]
    if found.shape != q.shape or found.dtype.kind not in "fiu":
        raise TrajectoryError(
            f"{file}: {key} has shape {found.shape} of {found.dtype}; it must be "
            f"{q.shape} of numbers, as q is"
        )
    return np.asarray(found, dtype=np.float64)


def arrays_of(data: bytes) -> dict[str, np.ndarray]:
    """Arrays of an NPZ archive, unpacked only if they are not too large together.

    Raises:
        ValueError: It is none, an array is too large or holds Python objects, or its
            header and its size disagree.
    """
    if not is_zipfile(BytesIO(data)):
        raise ValueError("it was not written by np.savez")
    held = {}
    with ZipFile(BytesIO(data)) as archive:
        total = sum(member.file_size for member in archive.infolist())
        if total > MOST_UNPACKED:
            limit = f"{MOST_UNPACKED / 1e6:g} MB"
            raise ValueError(
                f"it unpacks to {total / 1e6:.0f} MB; the limit is {limit}"
            )
        for name in archive.namelist():
            with archive.open(name) as member:
                held[name.removesuffix(".npy")] = read_array(member, allow_pickle=False)
                if member.read(1):
                    raise ValueError("an array has more bytes than its header says")
    return held


def array_of(
    held: dict[str, np.ndarray], keys: tuple[str, ...], file: str
) -> np.ndarray:
    """The array that goes by one of these names."""
    for key in keys:
        if key in held:
            return held[key]
    there = ", ".join(f"'{key}'" for key in held) or "nothing"
    raise TrajectoryError(
        f"{file}: there is no array '{keys[0]}', only {there}; an NPZ holds "
        "`names`, `q` and perhaps `t`"
    )


def read_yaml(path: Path) -> Trajectory:
    """A trajectory with `joint_names` and `points`, or a request with a goal."""
    try:
        _, values = parse_yaml(read_text(path, MOST_YAML_BYTES))
    except YAMLError as error:
        raise TrajectoryError(f"'{path.name}' {sentence_of_yaml(error)}") from None
    return read_trajectory(path.name, values)


READERS = {
    ".csv": read_csv,
    ".npz": read_npz,
    ".yaml": read_yaml,
    ".yml": read_yaml,
    ".json": read_yaml,
}
