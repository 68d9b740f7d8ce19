"""Frames of sensors in bags of ROS, clouds and images, as events to be played."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from armguard.errors import RecordingError, SceneError
from armguard.recording.bag_streams import MEASURED, NANO, nanoseconds
from armguard.recording.motions import is_bag, opened
from armguard.scene import Scene
from armguard.scene.sensor_kinds import Form
from armguard.scene.sensors import SceneSensor
from armguard.sense.clouds import read_clouds
from armguard.sense.frames_file import (
    DEPTH,
    JOINTS,
    POINTS,
    POSE,
    RANGE,
    Event,
    read_events,
)

# Clouds of points, images of depths.
CLOUDS, IMAGES = (".pcd", ".ply", ".graph"), (".png",)

# Forms of sensors whose frames a message may be, the first one first.
CLOUD, SCAN = "sensor_msgs/msg/PointCloud2", "sensor_msgs/msg/LaserScan"
DISTANCE, IMAGE = "sensor_msgs/msg/Range", "sensor_msgs/msg/Image"
FORMS: dict[str, tuple[Form, ...]] = {
    CLOUD: ("points", "image"),
    SCAN: ("points",),
    DISTANCE: ("beam",),
    IMAGE: ("image",),
}

# Numbers of a field of a cloud, and depths of an image, as NumPy has them.
NUMBERS = {7: "f4", 8: "f8"}
ENCODINGS = {"16UC1": "u2", "mono16": "u2", "32FC1": "f4"}


# Time between positions of robots at home, where a file has none [s].
STEP = 0.005


class Source(NamedTuple):
    """What is in a file that is played.

    Attributes:
        events: Its events.
        notes: Gets sentences about what is left out.
    """

    events: Iterator[Event]
    notes: list[str]


def sensor_source(path: Path, scene: Scene, topics: Sequence[str] = ()) -> Source:
    """The events of a file or a folder.

    Args:
        path: Our file of frames; a bag of ROS; a cloud (PCD, PLY, a graph of OctoMap);
            or a folder of clouds or of depth images.
        scene: The scene with the sensors.
        topics: Sensors of topics of a bag, as 'SENSOR=/topic'.

    Raises:
        RecordingError: There is no such file, or no sensor for it.
        SceneError: A topic names a sensor that the scene does not have.
    """
    notes: list[str] = []
    if not path.exists():
        raise RecordingError(f"{path} cannot be read: there is no such file")
    if is_bag(path):
        return Source(
            bag_events(path, scene, chosen_topics(scene, topics), notes), notes
        )
    if path.is_dir() or path.suffix.lower() in CLOUDS + IMAGES:
        return Source(file_events(path, scene), notes)
    return Source(read_events(path), notes)


def chosen_topics(scene: Scene, topics: Sequence[str]) -> dict[str, str]:
    """The sensor of each topic that was named.

    Raises:
        SceneError: The scene has no such sensor, or a text names no topic.
    """
    chosen = {}
    for text in topics:
        name, _, topic = text.partition("=")
        if name not in scene.sensors or not topic:
            raise SceneError(
                f"--topic {text}: it must be SENSOR=/topic, with a sensor of the "
                f"scene: {', '.join(scene.sensors)}"
            )
        chosen[topic] = name
    return chosen


def only_sensor(scene: Scene, forms: Sequence[Form], name: str = "") -> str | None:
    """The sensor of a name, or the only one of some forms; None without one."""
    able = [n for n, one in scene.sensors.items() if one.form in forms]
    if name in able:
        return name
    for form in forms:
        found = [n for n in able if scene.sensors[n].form == form]
        if len(found) == 1:
            return found[0]
    return None


class JointNames:
    """Joint positions of a scene by the names of messages.

    Attributes:
        q: The newest positions; home of joints that no message has [rad or m].

    Args:
        scene: The scene.
    """

    def __init__(self, scene: Scene) -> None:
        self.q = scene.home.copy()
        names = scene.q_names
        short = [name.split("/", 1)[1] for name in names]
        self._places = {name: k for k, name in enumerate(names)}
        for k, name in enumerate(short):
            if short.count(name) == 1:
                self._places.setdefault(name, k)

    def take(self, names: Sequence[str], positions: Sequence[float]) -> bool:
        """Take positions by name; whether any is of the scene."""
        found = False
        for name, value in zip(names, positions, strict=False):
            place = self._places.get(name)
            if place is not None:
                self.q[place], found = value, True
        return found


def bag_events(
    path: Path, scene: Scene, chosen: Mapping[str, str], notes: list[str]
) -> Iterator[Event]:
    """The events of a bag; stamps count from its first message.

    A topic is of the sensor that was named for it, of the one that its frame is named
    after, or of the only one that takes such frames.

    Raises:
        TrajectoryError: It cannot be read as a bag.
    """
    joints, sensors = JointNames(scene), dict[str, str | None](chosen)
    with opened(path, notes) as reader:
        able = [c for c in reader.connections if c.msgtype in (*FORMS, MEASURED)]
        moves = any(c.msgtype == MEASURED for c in able)
        start, last = None, -np.inf
        for connection, received, raw in reader.messages(connections=able):
            topic, kind = connection.topic, connection.msgtype
            message = reader.deserialize(raw, kind)
            time = nanoseconds(message.header.stamp) or received
            start = time if start is None else start
            stamp = (time - start) / NANO
            if kind == MEASURED:
                if joints.take(message.name, message.position) and stamp > last:
                    last = stamp
                    yield Event(JOINTS, "", stamp, [joints.q.copy()])
                continue
            if topic not in sensors:
                frame = str(message.header.frame_id).strip("/")
                sensors[topic] = only_sensor(scene, FORMS[kind], frame)
                if sensors[topic] is None:
                    notes.append(f"{topic} ({kind}) is left out: no sensor takes it")
            name = sensors[topic]
            if name is None:
                continue
            found = frame_of_message(message, kind, scene.sensors[name])
            if found is None:
                notes.append(f"{topic}: a message at {stamp:.3f} s is no such frame")
                continue
            if not moves:
                yield from at_home(scene, stamp, last, scene.sensors[name])
                last = stamp
            yield Event(found[0], name, stamp, [found[1]])


def at_home(
    scene: Scene, stamp: float, last: float, sensor: SceneSensor
) -> Iterator[Event]:
    """Joint positions of robots at home until a frame, after the last ones."""
    before = sensor.period + sensor.delay + 2.0 * sensor.jitter
    for time in np.arange(max(stamp - before, last + STEP), stamp, STEP):
        yield Event(JOINTS, "", float(time), [scene.home])
    if stamp > last:
        yield Event(JOINTS, "", stamp, [scene.home])


def frame_of_message(
    message: Any, kind: str, sensor: SceneSensor
) -> tuple[int, NDArray[Any]] | None:
    """The event and the values of a message; None if it is no frame of the sensor."""
    if sensor.form not in FORMS[kind]:
        return None
    try:
        if kind == DISTANCE:
            return RANGE, np.array(message.range, dtype=np.float64)
        if kind == IMAGE:
            return DEPTH, image_of(message)
        if kind == SCAN:
            return POINTS, scan_of(message, sensor.range[1])
        return as_frame(cloud_of(message), sensor)
    except (KeyError, ValueError, TypeError, OverflowError):
        # A message is untrusted input; one that is damaged is left out and noted.
        return None


def as_frame(xyz: NDArray[Any], sensor: SceneSensor) -> tuple[int, NDArray[Any]]:
    """A cloud as a frame; of a depth camera the depths of an organised one."""
    return (DEPTH, xyz[..., 2]) if sensor.image else (POINTS, xyz)


def image_of(message: Any) -> NDArray[Any]:
    """Depths of an image, shape (rows, columns)."""
    order = ">" if message.is_bigendian else "<"
    kind = np.dtype(order + ENCODINGS[message.encoding])
    rows, step = int(message.height), int(message.step)
    data = np.frombuffer(message.data, dtype=np.uint8)[: rows * step]
    lines = data.reshape(rows, step)[:, : int(message.width) * kind.itemsize]
    return np.ascontiguousarray(lines).view(kind).astype(kind.newbyteorder("="))


def cloud_of(message: Any) -> NDArray[Any]:
    """Points of a cloud, shape (rows, columns, 3) [m]."""
    order = ">" if message.is_bigendian else "<"
    fields = {field.name: field for field in message.fields}
    rows, columns = int(message.height), int(message.width)
    step, row = int(message.point_step), int(message.row_step)
    data = np.frombuffer(message.data, dtype=np.uint8)[: rows * row]
    lines = np.ascontiguousarray(data.reshape(rows, row)[:, : columns * step])
    kind = np.dtype(
        {
            "names": ["x", "y", "z"],
            "formats": [order + NUMBERS[fields[axis].datatype] for axis in "xyz"],
            "offsets": [fields[axis].offset for axis in "xyz"],
            "itemsize": step,
        }
    )
    points = lines.view(kind).reshape(rows, columns)
    return np.stack([points[axis] for axis in "xyz"], axis=2).astype(np.float64)


def scan_of(message: Any, reach: float) -> NDArray[Any]:
    """Points of a laser scan, shape (n, 3) [m].

    A ray that meets nothing within range has its point beyond the sensor's.

    Args:
        message: The scan.
        reach: Range of the sensor [m].
    """
    ranges = np.asarray(message.ranges, dtype=np.float64)
    angles = message.angle_min + message.angle_increment * np.arange(len(ranges))
    ranges = np.where(ranges < message.range_min, np.nan, ranges)
    ranges = np.where(ranges > message.range_max, 2.0 * reach, ranges)
    ways = np.stack([np.cos(angles), np.sin(angles), np.zeros(len(angles))], axis=1)
    return np.asarray(ranges[:, None] * ways)


def file_events(path: Path, scene: Scene) -> Iterator[Event]:
    """The events of clouds and depth images, one after the other.

    A pose beside a file, `NAME.txt` or `NAME.pose.txt` with four rows of four numbers,
    or in it, is that of a sensor in the world. The robots are at home.

    Raises:
        RecordingError: A file cannot be read, or no sensor takes it.
    """
    paths = sorted(path.iterdir()) if path.is_dir() else [path]
    paths = [one for one in paths if one.suffix.lower() in CLOUDS + IMAGES]
    if not paths:
        raise RecordingError(f"{path} has no frames: no file of {CLOUDS + IMAGES}")
    image = paths[0].suffix.lower() in IMAGES
    forms: tuple[Form, ...] = ("image",) if image else FORMS[CLOUD]
    name = only_sensor(scene, forms, path.stem)
    if name is None:
        kinds = "depth" if image else "points or depth"
        raise RecordingError(
            f"{path.name} is of no sensor: the scene needs one of kind {kinds}, or one "
            "with the name of the file"
        )
    sensor, stamp, last = scene.sensors[name], 0.0, -np.inf
    for one in paths:
        found = [(read_image(one), None)] if image else read_clouds(one)
        for values, own in found:
            pose = pose_beside(one)
            pose = own.matrix() if pose is None and own is not None else pose
            yield from at_home(scene, stamp, last, sensor)
            last = stamp
            if pose is not None:
                yield Event(POSE, name, stamp, [pose])
            frame = (DEPTH, values) if image else as_frame(values, sensor)
            yield Event(frame[0], name, stamp, [frame[1]])
            stamp += sensor.period


def pose_beside(path: Path) -> NDArray[np.float64] | None:
    """The pose beside a file, None without one.

    Raises:
        RecordingError: It is none.
    """
    stem = path.name.split(".", 1)[0]
    for end in (".pose.txt", ".txt"):
        beside = path.with_name(stem + end)
        if beside.is_file():
            try:
                return np.loadtxt(beside).reshape(4, 4)
            except ValueError as error:
                raise RecordingError(f"{beside} is no pose: {error}") from None
    return None


def read_image(path: Path) -> NDArray[Any]:
    """Depths of a PNG file of 16 bits, shape (rows, columns) [mm].

    Raises:
        RecordingError: It cannot be read, is no such image, or Pillow is missing.
    """
    try:
        from PIL import Image, UnidentifiedImageError
    except ImportError:
        raise RecordingError(
            f"'{path.name}' is an image: pip install 'armguard[ros]' reads it"
        ) from None
    try:
        with Image.open(path) as image:
            found = np.asarray(image)
    except (OSError, UnidentifiedImageError) as error:
        raise RecordingError(f"{path} is no image: {error}") from None
    if found.ndim != 2 or found.dtype.kind not in "iu":
        raise RecordingError(f"{path} has no depths: it must have one channel [mm]")
    # 65535 is what a camera of 16 bits writes where it measured nothing.
    return np.where(found == 65535, 0, found).astype(np.uint16)
