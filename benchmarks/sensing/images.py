"""Depth images: recorded ones of a folder, and a room that is computed.

Point clouds of 640 × 480 pixels are read as images: the depth of a pixel is the z of
its point, and the focal length is fitted to x / z. `perception_tutorial.bag` is from
MoveIt's tutorials, `table_*.pcd` from the data of the Point Cloud Library.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from struct import unpack

import numpy as np

from arrays import Floats

ROWS, COLUMNS = 480, 640
FOCAL, CENTRE = 525.0, (319.5, 239.5)


@dataclass(frozen=True)
class DepthImage:
    """A depth image of a camera with `FOCAL` and `CENTRE`.

    Attributes:
        name: Its name.
        depth: Depths, 0 where invalid, shape (ROWS, COLUMNS) [m].
        recorded: Whether a camera took it.
    """

    name: str
    depth: Floats
    recorded: bool

    def points(self, farthest: float) -> Floats:
        """Points of the valid pixels up to a depth, camera frame, shape (n, 3) [m]."""
        valid = (self.depth > 0.0) & (self.depth <= farthest)
        v, u = np.nonzero(valid)
        z = self.depth[valid].astype(np.float64)
        x, y = (u - CENTRE[0]) / FOCAL * z, (v - CENTRE[1]) / FOCAL * z
        return np.stack([x, y, z], axis=1)


def recorded(folder: Path) -> Iterator[DepthImage]:
    """Images of the recordings in a folder, those that are there."""
    for path in sorted(folder.glob("*.pcd")):
        yield image_of(path.stem, read_pcd(path))
    for path in sorted(folder.glob("*.bag")):
        yield image_of(path.stem, read_bag(path))


def image_of(name: str, points: Floats) -> DepthImage:
    """An image of points, shape (ROWS, COLUMNS, 3) [m].

    Raises:
        ValueError: The points are not those of a camera with `FOCAL` and `CENTRE`.
    """
    x, _, z = np.moveaxis(points, -1, 0)
    valid = np.isfinite(z) & (z > 0.0)
    slopes, columns = (x / np.where(valid, z, 1.0))[valid], np.nonzero(valid)[1]
    focal, middle = np.polyfit(slopes, columns, 1)
    if abs(focal - FOCAL) > 0.1 or abs(middle - CENTRE[0]) > 0.1:
        raise ValueError(f"{name} is of a focal length of {focal:.1f} pixels")
    return DepthImage(name, np.where(valid, z, 0.0).astype(np.float32), True)


def read_bag(path: Path) -> Floats:
    """Points of the first cloud of a ROS bag, shape (ROWS, COLUMNS, 3) [m]."""
    from rosbags.highlevel import AnyReader

    with AnyReader([path]) as reader:
        for connection, _, raw in reader.messages():
            if connection.msgtype == "sensor_msgs/msg/PointCloud2":
                cloud = reader.deserialize(raw, connection.msgtype)
                rows = cloud.data.reshape(cloud.height, cloud.width, -1)[..., :12]
                return np.ascontiguousarray(rows).view("<f4")
    raise ValueError(f"{path} has no cloud")


def read_pcd(path: Path) -> Floats:
    """Points of a compressed PCD file with label, x, y, z, of that shape [m]."""
    raw = path.read_bytes()
    at = raw.index(b"\n", raw.index(b"DATA binary_compressed")) + 1
    compressed, size = unpack("<II", raw[at : at + 8])
    numbers = np.frombuffer(unlzf(raw[at + 8 : at + 8 + compressed], size), "<f4")
    return np.moveaxis(numbers.reshape(-1, ROWS, COLUMNS)[1:4], 0, -1)


def unlzf(data: bytes, size: int) -> bytes:
    """Data that LibLZF compressed; size is that of the result [byte]."""
    out, at = bytearray(), 0
    while at < len(data):
        control = data[at]
        at += 1
        if control < 32:
            out += data[at : at + control + 1]
            at += control + 1
            continue
        length = (control >> 5) + 2
        if length == 9:
            length += data[at]
            at += 1
        begin = len(out) - ((control & 31) << 8) - data[at] - 1
        at += 1
        for k in range(length):
            out.append(out[begin + k])
    if len(out) != size:
        raise ValueError(f"{len(out)} bytes in place of {size}")
    return bytes(out)


def room(seed: int = 0) -> DepthImage:
    """A computed image of a table with boxes before a wall.

    A camera at a height of 1.2 m looks down by 40 degrees. 2 mm of noise at 1 m grow
    with the square of the depth; edges and a tenth of the image are invalid.
    """
    rng = np.random.default_rng(seed)
    v, u = np.mgrid[:ROWS, :COLUMNS]
    ways = np.stack(
        [(u - CENTRE[0]) / FOCAL, (v - CENTRE[1]) / FOCAL, np.ones_like(u, float)],
        axis=-1,
    )
    tilt = np.deg2rad(40.0)
    forward = np.array([np.cos(tilt), 0.0, -np.sin(tilt)])
    down = np.array([-np.sin(tilt), 0.0, -np.cos(tilt)])
    ways = ways @ np.stack([np.array([0.0, -1.0, 0.0]), down, forward])
    origin = np.array([-0.4, 0.0, 1.2])
    boxes = [(np.array([-9, -9, -1.0]), np.array([9, 9, 0.3]))]
    boxes.append((np.array([1.0, -9, -1]), np.array([2, 9, 9.0])))
    for _ in range(12):
        low = np.array([*rng.uniform((-0.1, -0.6), (0.8, 0.5)), 0.3])
        boxes.append((low, low + rng.uniform(0.04, 0.25, 3)))
    depth = np.full((ROWS, COLUMNS), np.inf)
    for low, high in boxes:
        with np.errstate(divide="ignore"):
            a, b = (low - origin) / ways, (high - origin) / ways
        enter = np.minimum(a, b).max(axis=-1)
        leave = np.maximum(a, b).min(axis=-1)
        depth = np.where(
            (enter < leave) & (enter > 0.0), np.minimum(depth, enter), depth
        )
    steps = np.abs(np.diff(depth, axis=1, prepend=depth[:, :1])) > 0.03
    depth = depth + rng.normal(0.0, 0.002, depth.shape) * depth**2
    depth[steps] = 0.0
    for _ in range(10):
        i, j = rng.integers(0, ROWS - 60), rng.integers(0, COLUMNS - 60)
        depth[i : i + 55, j : j + 55] = 0.0
    return DepthImage("computed room", depth.astype(np.float32), False)
