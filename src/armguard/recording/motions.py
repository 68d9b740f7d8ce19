"""Motion from whatever holds some: tables, bags of ROS, our own recordings."""

from array import array
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, BinaryIO

import numpy as np

from armguard.errors import TrajectoryError, did_you_mean
from armguard.recording.bag_streams import (
    KINDS,
    NANO,
    PLANNED,
    Stream,
    in_order,
    merged,
    points_of,
)
from armguard.recording.frames import Kind
from armguard.scene import Scene, Trajectory, load_trajectory
from armguard.scene.trajectory_file import READERS, check_motion

# What a bag may be: a file of ROS 1, one of ROS 2, or a folder with `metadata.yaml`.
SUFFIXES = (".bag", ".db3", ".mcap")

# How ROS 2 writes down the types in an MCAP file, if it does.
ENCODINGS = ("ros2msg", "ros2idl", "omgidl", "")


def load_motion(path: Path, topics: Sequence[str] = ()) -> Trajectory:
    """Read a motion from a file or a folder.

    Args:
        path: What `load_trajectory` reads, a bag, or a recording of ours.
        topics: Topics of a bag, see `read_bag`.

    Raises:
        TrajectoryError: It holds no motion.
        RecordingError: It is a recording of ours, and damaged.
    """
    if not path.exists():
        raise TrajectoryError(f"'{path}' cannot be read: there is no such file")
    if is_bag(path) or path.is_dir():
        motion = read_recording(path) if not topics else None
        if motion is None:
            motion = read_bag(path, topics)
        check_motion(motion)
        return motion
    if topics:
        raise TrajectoryError(f"'{path.name}' is no bag; it has no topics")
    if path.suffix.lower() not in READERS:
        known = ", ".join([*READERS, *SUFFIXES])
        raise TrajectoryError(
            f"'{path.name}' is no motion file; it must end in {known}, or be a bag's "
            "folder"
        )
    return load_trajectory(path)


def read_recording(path: Path) -> Trajectory | None:
    """A recording of ours as motion; None if it is none.

    Of each cycle it has the positions that were judged, at the newest stamp of any
    robot, or at the cycle's own time where there were none.

    Raises:
        RecordingError: It is a recording of ours, and damaged.
    """
    try:
        from armguard.recording import open_recording
    except ImportError:
        return None
    if path.is_dir() and not any(path.glob("recording-*.mcap")):
        return None
    recording = open_recording(path)
    if not recording.names:
        return None
    rows, stamps = array("d"), array("d")
    for frame in recording.frames():
        if frame.kind is Kind.CYCLE and len(frame.q) == len(recording.names):
            rows.frombytes(frame.q.tobytes())
            own = frame.now if np.isnan(frame.stamps).all() else frame.stamps
            stamps.append(frame.monotonic if own is None else float(np.nanmax(own)))
    t = np.frombuffer(stamps)
    q = np.frombuffer(rows).reshape(len(t), len(recording.names))
    newest = np.maximum.accumulate(t) if len(t) else t
    late = int((t < newest).sum())
    notes = [*recording.problems]
    if late:
        notes.append(
            f"{late} cycles had a stamp older than one before and are left out"
        )
    kept = t == newest
    return Trajectory(
        names=recording.names,
        q=q[kept],
        stamps=t[kept] - t[0] if len(t) else t,
        source=path.name,
        others=True,
        notes=tuple(notes),
    )


def motion_notes(motion: Trajectory, scene: Scene) -> list[str]:
    """What a reader had to decide, and what of the file was not used."""
    notes = list(motion.notes)
    unused = motion.unused(scene)
    if unused:
        notes.append(
            "not in the scene, and left out: " + ", ".join(f"'{n}'" for n in unused)
        )
    return notes


def is_bag(path: Path) -> bool:
    """Whether a path looks like a bag."""
    return path.suffix.lower() in SUFFIXES or (path / "metadata.yaml").is_file()


def read_bag(path: Path, topics: Sequence[str] = ()) -> Trajectory:
    """Read a bag as motion.

    Positions are taken at the stamps in the messages' headers. What comes from several
    senders, such as one per arm, is put on one clock: at each stamp of any of them the
    newest sample of each; the notes say how old these are.

    Args:
        path: A bag of ROS 1, or a file or folder of ROS 2.
        topics: Topics to read: '/joint_states', or 'left=/panda_1/joint_states', which
            puts the robot's name before its joints' names. By default the only one with
            joint positions.

    Raises:
        TrajectoryError: It is no bag, it has no such topic, or several and none was
            named, or its time goes back.
    """
    notes: list[str] = []
    with opened(path, notes) as reader:
        chosen = chosen_topics(path.name, reader.connections, topics)
        streams = streams_of(path.name, reader, chosen, notes)
    found = [in_order(path.name, stream, notes) for stream in streams]
    if not found:
        raise TrajectoryError(
            f"{path.name}: topic {' and '.join(chosen)} has no joint positions"
        )
    names, q, stamps = merged(found, notes)
    return Trajectory(
        names=names,
        q=q,
        stamps=(stamps - stamps[0]) / NANO,
        source=path.name,
        others=True,
        notes=tuple(notes),
    )


@contextmanager
def opened(path: Path, notes: list[str]) -> Iterator[Any]:
    """A bag's reader.

    Args:
        path: The bag.
        notes: Gets a sentence if a part of it is missing.

    Raises:
        TrajectoryError: The file cannot be read as a bag.
    """
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    except ImportError:
        raise TrajectoryError(
            f"'{path.name}' is a bag of ROS: pip install 'armguard[ros]' reads it"
        ) from None
    path = bag_of(path, notes)
    # Bags of Humble and earlier do not hold what their messages look like.
    known = get_typestore(Stores.ROS2_HUMBLE)
    with ExitStack() as stack:
        try:
            try:
                reader = stack.enter_context(AnyReader([path], default_typestore=known))
            except Exception:
                copy = Path(stack.enter_context(TemporaryDirectory()), path.name)
                count = copy_whole(path, copy)
                if not count:
                    raise
                notes.append(
                    f"{path.name} has no end, as of a recorder that was killed: "
                    f"{count} messages are before it"
                )
                reader = stack.enter_context(AnyReader([copy], default_typestore=known))
            yield reader
        except TrajectoryError:
            raise
        except Exception as error:
            # A damaged bag makes its reader raise anything, struct.error for one.
            raise unreadable(path, error) from error


def bag_of(path: Path, notes: list[str]) -> Path:
    """A bag's folder or file; the file of a folder whose recorder was killed."""
    if not path.is_dir() or (path / "metadata.yaml").is_file():
        return path
    files = [f for f in sorted(path.iterdir()) if f.suffix in SUFFIXES]
    if len(files) == 1:
        notes.append(f"{path.name} has no metadata.yaml: {files[0].name} is read alone")
        return files[0]
    there = ", ".join(file.name for file in files) or "no bag"
    raise TrajectoryError(
        f"'{path.name}' is a folder without metadata.yaml: no bag; in it is {there}"
    )


def copy_whole(path: Path, copy: Path) -> int:
    """Copy the messages before the cut of an MCAP file without an end.

    Of messages only those with joint positions are copied: the rest may be large.

    Returns:
        Messages before the cut; 0 if it is no MCAP file of ROS 2.
    """
    if path.suffix.lower() != ".mcap":
        return 0
    from mcap.writer import Writer

    channels: dict[int, int] = {}
    count = 0
    with path.open("rb") as file, copy.open("wb") as out:
        writer = Writer(out)
        writer.start(profile="ros2")
        for schema, channel, message in before_cut(file):
            count += 1
            if channel.id not in channels:
                kind = writer.register_schema(schema.name, schema.encoding, schema.data)
                channels[channel.id] = writer.register_channel(
                    channel.topic, channel.message_encoding, kind
                )
            if schema.name in KINDS:
                number, time = channels[channel.id], message.log_time
                writer.add_message(number, time, message.data, time)
        writer.finish()
    return count


def before_cut(file: BinaryIO) -> Iterator[tuple[Any, Any, Any]]:
    """Schema, channel and message of each message of ROS 2 before the cut."""
    from mcap.reader import NonSeekingReader

    # Where the file ends the library raises whatever it stumbles over.
    with suppress(Exception):
        reader = NonSeekingReader(file, validate_crcs=True)
        for schema, channel, message in reader.iter_messages(log_time_order=False):
            if schema is not None and schema.encoding in ENCODINGS:
                yield schema, channel, message


def unreadable(path: Path, error: Exception) -> TrajectoryError:
    """What to say of a bag that cannot be read."""
    if isinstance(error, OSError):
        return TrajectoryError(f"'{path}' cannot be read: {error.strerror or error}")
    kind = type(error).__name__
    text = str(error) if kind.startswith(("AnyReader", "Reader")) else ""
    text = text or f"{kind}: {error}"
    hint = "; `ros2 bag reindex`, `rosbag reindex` or `mcap recover` may repair it"
    if "Profile" in text:
        text, hint = "it was not written by ROS 2", "; convert it with `ros2 bag`"
    return TrajectoryError(
        f"'{path.name}' cannot be read as a bag: {text.rstrip('.')}{hint}"
    )


def chosen_topics(
    name: str, connections: Sequence[Any], topics: Sequence[str]
) -> dict[str, str]:
    """Topics to read, and the robot each is of, or ""."""
    every = {c.topic: c.msgtype for c in connections}
    able = {topic: kind for topic, kind in every.items() if kind in KINDS}
    if not able:
        there = ", ".join(f"{t} ({kind})" for t, kind in every.items()) or "nothing"
        raise TrajectoryError(f"{name}: no topic has joint positions; there is {there}")
    if not topics and len(able) > 1:
        there = "\n".join(f"  --topic {t}  ({kind})" for t, kind in able.items())
        raise TrajectoryError(
            f"{name}: several topics have joint positions; name one, or one for "
            f"each robot:\n{there}"
        )
    chosen = {}
    for asked in topics or able:
        robot, _, topic = asked.rpartition("=")
        if topic not in able:
            what = f"there is no topic '{topic}'"
            if topic in every:
                kind = every[topic]
                what = f"topic '{topic}' is {kind}, which has no joint positions"
            raise TrajectoryError(f"{name}: {what}; {did_you_mean(topic, able)}")
        chosen[topic] = robot
    return chosen


def streams_of(
    name: str, reader: Any, chosen: dict[str, str], notes: list[str]
) -> list[Stream]:
    """All samples of some topics, one stream for each set of joints.

    Nodes that each measure a part of a machine often share a topic: a message with
    other joints is of another stream.
    """
    connections = [c for c in reader.connections if c.topic in chosen]
    streams: dict[tuple[str, frozenset[str]], Stream] = {}
    empty, count = Counter[str](), Counter[str]()
    for connection, received, raw in reader.messages(connections=connections):
        topic, kind = connection.topic, connection.msgtype
        count[topic] += 1
        joints, points = points_of(reader.deserialize(raw, kind), kind, received)
        for _, row in points:
            if len(row) != len(joints):
                raise TrajectoryError(
                    f"{name}: {topic}, message {count[topic]}: {len(row)} positions "
                    f"for {len(joints)} joints"
                )
        empty[topic] += not points
        if points:
            key = (topic, frozenset(joints))
            stream = streams.setdefault(key, Stream(topic, joints, kind == PLANNED))
            stream.add(joints, points, received)
    notes += [
        f"{topic}: {empty[topic]} messages without positions were passed over"
        for topic in chosen
        if empty[topic]
    ]
    found = list(streams.values())
    for stream in found:
        others = {j for s in found if s.topic != stream.topic for j in s.joints}
        own = {j for s in found if s.topic == stream.topic for j in s.joints}
        stream.robot = chosen[stream.topic]
        if not stream.robot and own & others:
            # Two arms of one make, each in a namespace of its own.
            stream.robot = stream.topic.strip("/").split("/")[0]
    return found
