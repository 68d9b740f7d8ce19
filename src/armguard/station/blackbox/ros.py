"""Messages for other people's programs, as ROS 2 writes them (CDR, little-endian)."""

import struct
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from armguard.station.blackbox.mcap_file import Topic

# Every message begins with how it is encoded; numbers stand at multiples of their size
# counted from behind it.
HEAD = b"\x00\x01\x00\x00"

SEPARATOR = "=" * 80

TIME = "int32 sec\nuint32 nanosec\n"
PARTS = {
    "builtin_interfaces/Time": TIME,
    "builtin_interfaces/Duration": TIME,
    "std_msgs/Header": "builtin_interfaces/Time stamp\nstring frame_id\n",
    "std_msgs/ColorRGBA": "float32 r\nfloat32 g\nfloat32 b\nfloat32 a\n",
    "geometry_msgs/Point": "float64 x\nfloat64 y\nfloat64 z\n",
    "geometry_msgs/Vector3": "float64 x\nfloat64 y\nfloat64 z\n",
    "geometry_msgs/Quaternion": "float64 x\nfloat64 y\nfloat64 z\nfloat64 w\n",
    "geometry_msgs/Pose": "geometry_msgs/Point position\n"
    "geometry_msgs/Quaternion orientation\n",
    "sensor_msgs/CompressedImage": "std_msgs/Header header\nstring format\n"
    "uint8[] data\n",
    "visualization_msgs/UVCoordinate": "float32 u\nfloat32 v\n",
    "visualization_msgs/MeshFile": "string filename\nuint8[] data\n",
    "visualization_msgs/Marker": "std_msgs/Header header\nstring ns\nint32 id\n"
    "int32 type\nint32 action\ngeometry_msgs/Pose pose\n"
    "geometry_msgs/Vector3 scale\nstd_msgs/ColorRGBA color\n"
    "builtin_interfaces/Duration lifetime\nbool frame_locked\n"
    "geometry_msgs/Point[] points\nstd_msgs/ColorRGBA[] colors\n"
    "string texture_resource\nsensor_msgs/CompressedImage texture\n"
    "visualization_msgs/UVCoordinate[] uv_coordinates\nstring text\n"
    "string mesh_resource\nvisualization_msgs/MeshFile mesh_file\n"
    "bool mesh_use_embedded_materials\n",
}

JOINTS = "std_msgs/Header header\nstring[] name\nfloat64[] position\n"
JOINTS += "float64[] velocity\nfloat64[] effort\n"
LOG = "builtin_interfaces/Time stamp\nuint8 level\nstring name\nstring msg\n"
LOG += "string file\nstring function\nuint32 line\n"


def definition(text: str) -> str:
    """A type with all the types it is made of, each once."""
    wanted, known = [text], dict[str, str]()
    while wanted:
        for line in wanted.pop().splitlines():
            part = line.split(" ", 1)[0].removesuffix("[]")
            if part in PARTS and part not in known:
                known[part] = PARTS[part]
                wanted.append(PARTS[part])
    return text + "".join(f"{SEPARATOR}\nMSG: {n}\n{t}" for n, t in known.items())


FRAMES = Topic(1, "/armguard/frames", "armguard", "", "")
JOINT_STATES = Topic(
    2, "/joint_states", "cdr", "sensor_msgs/msg/JointState", definition(JOINTS)
)
COMMANDS = Topic(
    3, "/armguard/commands", "cdr", "sensor_msgs/msg/JointState", definition(JOINTS)
)
WORDS = Topic(4, "/armguard/log", "cdr", "rcl_interfaces/msg/Log", definition(LOG))
NEAR = Topic(
    5,
    "/armguard/near",
    "cdr",
    "visualization_msgs/msg/MarkerArray",
    definition("visualization_msgs/Marker[] markers\n"),
)
LEVEL = Topic(6, "/armguard/level", "cdr", "std_msgs/msg/UInt8", "uint8 data\n")
CLEARANCE = Topic(
    7, "/armguard/clearance", "cdr", "std_msgs/msg/Float64", "float64 data\n"
)
TIME_LEFT = Topic(
    8, "/armguard/time_left", "cdr", "std_msgs/msg/Float64", "float64 data\n"
)
TOPICS = (
    FRAMES, JOINT_STATES, COMMANDS, WORDS, NEAR, LEVEL, CLEARANCE, TIME_LEFT,
)  # fmt: skip

# Levels of a log, as ROS 2 counts them.
INFO, WARN, ERROR = 20, 30, 40

# Types of markers.
LINES, LABEL = 5, 9

# How thick a line is, and how large a letter [m].
THICK, LETTER = 0.004, 0.04


class Cdr:
    """A message that is being written."""

    def __init__(self) -> None:
        self._out = bytearray()

    def put(self, form: str, *values: float) -> None:
        """Numbers of one type, each at a multiple of its size."""
        size = struct.calcsize(form)
        self._out += bytes(-len(self._out) % size)
        self._out += struct.pack(f"<{len(values)}{form}", *values)

    def text(self, value: str) -> None:
        """A string."""
        data = value.encode() + b"\0"
        self.put("I", len(data))
        self._out += data

    def texts(self, values: Sequence[str]) -> None:
        """A sequence of strings."""
        self.put("I", len(values))
        for value in values:
            self.text(value)

    def doubles(self, values: ArrayLike) -> None:
        """A sequence of float64."""
        row = np.asarray(values, dtype="<f8")
        self.put("I", len(row))
        if len(row):
            self._out += bytes(-len(self._out) % 8) + row.tobytes()

    def header(self, time: int, frame: str) -> None:
        """When and in which frame; the time in nanoseconds."""
        self.put("i", time // 10**9)
        self.put("I", time % 10**9)
        self.text(frame)

    def done(self) -> bytes:
        """The message."""
        return HEAD + bytes(self._out)


def joints(
    time: int, names: Sequence[str], position: ArrayLike, velocity: ArrayLike
) -> bytes:
    """A `sensor_msgs/msg/JointState`."""
    out = Cdr()
    out.header(time, "world")
    out.texts(names)
    out.doubles(position)
    out.doubles(velocity)
    out.doubles(())
    return out.done()


def log(time: int, level: int, sentence: str) -> bytes:
    """A `rcl_interfaces/msg/Log`."""
    out = Cdr()
    out.put("i", time // 10**9)
    out.put("I", time % 10**9)
    out.put("B", level)
    for text in ("armguard", sentence, "", ""):
        out.text(text)
    out.put("I", 0)
    return out.done()


def number(form: str, value: float) -> bytes:
    """A message of one number."""
    out = Cdr()
    out.put(form, value)
    return out.done()


class Line(NamedTuple):
    """A line between the witness points of a near pair.

    Attributes:
        start: Point on A [m].
        end: Point on B [m].
        colour: Red, green, blue, each in [0, 1].
    """

    start: Sequence[float]
    end: Sequence[float]
    colour: tuple[float, float, float]


def markers(time: int, lines: Sequence[Line], label: str) -> bytes:
    """A `visualization_msgs/msg/MarkerArray`: lines, and a label at the first one."""
    out = Cdr()
    out.put("I", 2 if lines else 1)
    if lines:
        middle = [0.5 * (a + b) for a, b in zip(*lines[0][:2], strict=True)]
        put_marker(out, time, LABEL, 1, middle, (), label)
    put_marker(out, time, LINES, 0, (0.0, 0.0, 0.0), lines, "")
    return out.done()


def put_marker(
    out: Cdr,
    time: int,
    kind: int,
    number: int,
    place: Sequence[float],
    lines: Sequence[Line],
    label: str,
) -> None:
    """One `visualization_msgs/msg/Marker`; an empty one takes the last one away."""
    out.header(time, "world")
    out.text("near pairs")
    out.put("i", number, kind, 0 if lines or label else 2)
    out.put("d", *place, 0.0, 0.0, 0.0, 1.0)
    size = LETTER if kind == LABEL else THICK
    out.put("d", size, size, size)
    out.put("f", 1.0, 1.0, 1.0, 1.0)
    out.put("i", 0)
    out.put("I", 0)
    out.put("B", 0)
    out.put("I", 2 * len(lines))
    for line in lines:
        out.put("d", *line.start, *line.end)
    out.put("I", 2 * len(lines))
    for line in lines:
        out.put("f", *line.colour, 1.0, *line.colour, 1.0)
    out.text("")
    out.header(time, "world")
    out.text("")
    out.put("I", 0)
    out.put("I", 0)
    out.text(label)
    out.text("")
    out.text("")
    out.put("I", 0)
    out.put("B", 0)
