"""Topics of a recording, and their messages as ROS 2 writes them (CDR, by rosbags)."""

from collections.abc import Sequence
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


class Topic(NamedTuple):
    """A channel; its number is the same in every file."""

    number: int
    name: str
    schema: str = ""  # type of its messages; "" for our own, which is none of ROS


class Stored(NamedTuple):
    """A message to be stored."""

    topic: int  # number of its channel
    time: int  # wall clock that never goes back [ns]
    data: bytes


FRAMES = Topic(1, "/armguard/frames")
JOINT_STATES = Topic(2, "/joint_states", "sensor_msgs/msg/JointState")
COMMANDS = Topic(3, "/armguard/commands", "sensor_msgs/msg/JointState")
WORDS = Topic(4, "/armguard/log", "rcl_interfaces/msg/Log")
NEAR = Topic(5, "/armguard/near", "visualization_msgs/msg/MarkerArray")
LEVEL = Topic(6, "/armguard/level", "std_msgs/msg/UInt8")
HEADROOM = Topic(7, "/armguard/headroom", "std_msgs/msg/Float64")
TIME_LEFT = Topic(8, "/armguard/time_left", "std_msgs/msg/Float64")
TOPICS = (
    FRAMES, JOINT_STATES, COMMANDS, WORDS, NEAR, LEVEL, HEADROOM, TIME_LEFT,
)  # fmt: skip

# Red, green and blue in [0, 1].
Colour = Sequence[float]

# Levels of a log, as ROS 2 counts them.
INFO, WARN, ERROR = 20, 30, 40

# Types of markers, and what is done with one.
LINES, LABEL = 5, 9
ADD, DELETE = 0, 2

# How thick a line is, and how large a letter [m].
THICK, LETTER = 0.004, 0.04

EMPTY = np.zeros(0, np.uint8)


@cache
def typestore() -> Any:
    """The types of ROS 2 Humble; those used here are the same in later releases."""
    from rosbags.typesys import Stores, get_typestore

    return get_typestore(Stores.ROS2_HUMBLE)


def definition(schema: str) -> str:
    """A type with all the types it is made of, as ROS 2 writes them."""
    text: str = typestore().generate_msgdef(schema, ros_version=2)[0]
    return text


def part(kind: str, *values: Any) -> Any:
    """A message, or a part of one, by its type and its fields in order."""
    return typestore().types[kind](*values)


def message(topic: Topic, time: int, *values: Any) -> Stored:
    """A message of a topic at a time [ns], by its fields in order."""
    data = typestore().serialize_cdr(part(topic.schema, *values), topic.schema)
    return Stored(topic.number, time, bytes(data))


def stamp(time: int) -> Any:
    """A time [ns]."""
    return part("builtin_interfaces/msg/Time", *divmod(time, 10**9))


def header(time: int) -> Any:
    """When, in the frame of the world; the time in nanoseconds."""
    return part("std_msgs/msg/Header", stamp(time), "world")


def joints(topic: Topic, time: int, names: Sequence[str], rows: Floats) -> Stored:
    """Positions and velocities of joints, shape (2, n)."""
    return message(topic, time, header(time), list(names), *rows, np.zeros(0))


def log(time: int, level: int, sentence: str) -> Stored:
    """A line of the log."""
    return message(WORDS, time, stamp(time), level, "armguard", sentence, "", "", 0)


def markers(time: int, ends: Floats, colours: Sequence[Colour], label: str) -> Stored:
    """Lines between two ends each, shape (k, 2, 3) [m], and a label at the first."""
    found = [marker(time, LINES, 0, np.zeros(3), ends, colours, "")]
    if len(ends):
        middle = ends[0].mean(axis=0)
        found.insert(0, marker(time, LABEL, 1, middle, ends[:0], (), label))
    return message(NEAR, time, found)


def marker(
    time: int,
    kind: int,
    number: int,
    place: Floats,
    ends: Floats,
    colours: Sequence[Colour],
    label: str,
) -> Any:
    """One marker; an empty one takes the last one away."""
    size = LETTER if kind == LABEL else THICK
    point, rgba = "geometry_msgs/msg/Point", "std_msgs/msg/ColorRGBA"
    turn = part("geometry_msgs/msg/Quaternion", 0.0, 0.0, 0.0, 1.0)
    return part(
        "visualization_msgs/msg/Marker",
        header(time),
        "near pairs",
        number,
        kind,
        ADD if len(ends) or label else DELETE,
        part("geometry_msgs/msg/Pose", part(point, *place.tolist()), turn),
        part("geometry_msgs/msg/Vector3", size, size, size),
        part(rgba, 1.0, 1.0, 1.0, 1.0),
        part("builtin_interfaces/msg/Duration", 0, 0),  # until another one comes
        False,  # not fixed to a moving frame
        [part(point, *end) for end in ends.reshape(-1, 3).tolist()],
        [part(rgba, *colour, 1.0) for colour in colours for _ in ("start", "end")],
        "",  # no texture
        part("sensor_msgs/msg/CompressedImage", header(time), "", EMPTY),
        [],
        label,
        "",  # no mesh
        part("visualization_msgs/msg/MeshFile", "", EMPTY),
        False,
    )
