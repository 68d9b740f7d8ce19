"""Clouds of points in files: PCD, PLY, and scan graphs of OctoMap."""

from pathlib import Path
from struct import Struct
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from armguard.errors import PoseError, RecordingError
from armguard.geometry.pose import Pose

Floats = NDArray[np.float64]

# Types of NumPy by the letter of a PCD file.
LETTERS = {"F": "f", "U": "u", "I": "i"}

# Points of a cloud at most, and bytes of a line of a header.
MOST_POINTS, MOST_LINE = 1 << 24, 4096

# A point of a scan graph, and a pose: counts of numbers before the numbers.
POINT = np.dtype([("count", "<u4"), ("xyz", "<f8", 3)])
POSE = Struct("<I3dI4d")


class Cloud(NamedTuple):
    """Points of a file.

    Attributes:
        xyz: The points in the sensor, NaN where none was measured: shape
            (rows, columns, 3) of an organised cloud, else (1, n, 3) [m].
        pose: Pose of the sensor in the world; None if the file has none.
    """

    xyz: Floats
    pose: Pose | None


def read_clouds(path: Path) -> list[Cloud]:
    """The clouds of a file: one of PCD and PLY, one of each scan of a graph.

    Raises:
        RecordingError: It cannot be read, or is no such file.
    """
    readers = {".pcd": read_pcd, ".ply": read_ply, ".graph": read_graph}
    try:
        return readers[path.suffix.lower()](path)
    except OSError as error:
        raise RecordingError(f"{path} cannot be read: {error.strerror}") from None
    except (ValueError, KeyError, IndexError, TypeError, PoseError) as error:
        raise RecordingError(f"{path} is no cloud of points: {error}") from None


def read_ply(path: Path) -> list[Cloud]:
    """The vertices of a PLY file.

    Raises:
        RecordingError: trimesh is not installed.
    """
    try:
        import trimesh
    except ImportError:
        raise RecordingError(
            f"'{path.name}' is a PLY file: pip install 'armguard[meshes]' reads it"
        ) from None
    with path.open("rb") as file:
        try:
            found = trimesh.load(file, file_type="ply", process=False)
        except Exception as error:
            # A damaged file makes its reader raise anything, struct.error for one.
            raise ValueError(f"{type(error).__name__}: {error}") from error
    return [Cloud(np.asarray(found.vertices, dtype=np.float64)[None], None)]


def read_pcd(path: Path) -> list[Cloud]:
    """The points of a PCD file: ASCII, binary or binary compressed."""
    with path.open("rb") as file:
        header: dict[str, list[str]] = {}
        while "DATA" not in header:
            line = file.readline(MOST_LINE)
            if not line:
                raise ValueError("its header has no DATA")
            words = line.decode("ascii", errors="replace").split("#")[0].split()
            if words:
                header[words[0]] = words[1:]
        data = file.read()
    columns, rows = int(header["WIDTH"][0]), int(header.get("HEIGHT", ["1"])[0])
    if not 0 <= rows * columns <= MOST_POINTS:
        raise ValueError(f"it has {rows} by {columns} points")
    counts = [int(c) for c in header.get("COUNT", ["1"] * len(header["FIELDS"]))]
    parts = zip(header["FIELDS"], header["TYPE"], header["SIZE"], counts, strict=True)
    kind = np.dtype([(n, f"<{LETTERS[t]}{s}", (c,)) for n, t, s, c in parts])
    values = pcd_values(header["DATA"][0], data, kind, rows * columns)
    xyz = np.stack([values[axis].reshape(-1) for axis in "xyz"], axis=1)
    place = [float(number) for number in header.get("VIEWPOINT", [])]
    pose = None
    if place and place != [0, 0, 0, 1, 0, 0, 0]:
        pose = Pose(xyz=place[:3], quat_wxyz=place[3:])
    return [Cloud(xyz.reshape(rows, columns, 3).astype(np.float64), pose)]


def pcd_values(
    form: str, data: bytes, kind: np.dtype[Any], count: int
) -> NDArray[Any] | dict[str, NDArray[Any]]:
    """Values of a PCD file by field.

    Args:
        form: The form of its data.
        data: All that follows the header.
        kind: Fields of a point.
        count: How many points it has.

    Raises:
        ValueError: The form is unknown, or the data are too few.
    """
    if form == "ascii":
        table = np.loadtxt(data.decode("ascii").splitlines(), ndmin=2)
        widths = [kind[name].shape[0] for name in kind.names or ()]
        ends = np.cumsum(widths)
        columns = (table[:count, e - w : e] for e, w in zip(ends, widths, strict=True))
        return dict(zip(kind.names or (), columns, strict=True))
    if form == "binary":
        return np.frombuffer(data, dtype=kind, count=count)
    if form != "binary_compressed":
        raise ValueError(f"its data are {form}")
    packed, size = np.frombuffer(data, dtype="<u4", count=2).tolist()
    if size > count * kind.itemsize:
        raise ValueError(f"it has {size} bytes for {count} points")
    plain, at = unpacked_lzf(data[8 : 8 + packed], size), 0
    found = {}
    # Its values are by field, then by point.
    for name in kind.names or ():
        field = kind[name]
        base = field.subdtype[0] if field.subdtype is not None else field
        numbers = count * field.shape[0]
        found[name] = np.frombuffer(plain, dtype=base, count=numbers, offset=at)
        at += count * field.itemsize
    return found


def unpacked_lzf(data: bytes, size: int) -> bytes:
    """Data that LibLZF has packed.

    Args:
        data: The packed data.
        size: Length of the result.

    Raises:
        ValueError: The data are damaged.
    """
    out, at = bytearray(), 0
    while at < len(data) and len(out) <= size:
        control = data[at]
        at += 1
        if control < 32:
            # Bytes as they are.
            out += data[at : at + control + 1]
            at += control + 1
            continue
        length = control >> 5
        if length == 7:
            length += data[at]
            at += 1
        start = len(out) - ((control & 31) << 8) - data[at] - 1
        at += 1
        if start < 0:
            raise ValueError("its data refer to bytes before the first")
        # A copy may reach into itself: then it repeats.
        piece = out[start : start + length + 2]
        out += (piece * (-(-(length + 2) // len(piece))))[: length + 2]
    if len(out) != size:
        raise ValueError(f"it has {len(out)} of {size} bytes")
    return bytes(out)


def read_graph(path: Path) -> list[Cloud]:
    """The scans of a graph of OctoMap, each with its pose.

    Raises:
        ValueError: It is none, or ends too early.
    """
    data, clouds, at = path.read_bytes(), [], 4
    for _ in range(int.from_bytes(data[:4], "little")):
        count = int.from_bytes(data[at : at + 4], "little")
        if at + 4 + count * POINT.itemsize + POSE.size > len(data):
            raise ValueError("it ends within a scan")
        points = np.frombuffer(data, dtype=POINT, count=count, offset=at + 4)
        at += 4 + count * POINT.itemsize
        three, *place = POSE.unpack_from(data, at)
        if (points["count"] != 3).any() or three != 3 or place[3] != 4:
            raise ValueError("its points have no three numbers")
        pose = Pose(xyz=place[:3], quat_wxyz=place[4:])
        clouds.append(Cloud(points["xyz"][None].copy(), pose))
        # The number of the scan follows its pose.
        at += POSE.size + 4
    if not clouds:
        raise ValueError("it has no scan")
    return clouds
