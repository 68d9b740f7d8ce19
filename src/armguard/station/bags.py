"""Bags of ROS 1 and ROS 2 as motion: joint positions by name, on one clock."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from armguard.errors import TrajectoryError, did_you_mean
from armguard.scene.trajectory import Trajectory
from armguard.station.bag_cut import CutBag
from armguard.station.bag_messages import READERS, motion_of
from armguard.station.bag_streams import NANO, Stream, check_time, merged

# What a bag may be: a file of ROS 1, one of ROS 2, or a folder with `metadata.yaml`.
SUFFIXES = (".bag", ".db3", ".mcap")


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
        TrajectoryError: It is no bag, it has no such topic, or several and nobody said
            which, or its time goes back.
    """
    notes: list[str] = []
    with opened(path, notes) as reader:
        chosen = chosen_topics(path.name, reader.connections, topics)
        streams, told = streams_of(path.name, reader, chosen)
    notes += told
    for stream in streams:
        notes += check_time(path.name, stream)
    streams = [stream for stream in streams if len(stream.stamps)]
    if not streams:
        raise TrajectoryError(
            f"{path.name}: topic {' and '.join(chosen)} has no joint positions"
        )
    names, q, stamps, ages = merged(streams)
    return Trajectory(
        names=names,
        q=q,
        stamps=(stamps - stamps[0]) / NANO,
        source=path.name,
        others=True,
        notes=(*notes, *ages),
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
    try:
        reader = AnyReader([path], default_typestore=known)
        reader.open()
    except Exception as error:
        cut = cut_bag(path, known)
        if cut is None:
            raise unreadable(path, error) from error
        notes.append(
            f"{path.name} has no end, as of a recorder that was killed: "
            f"{cut.count} messages are before it"
        )
        yield cut
        return
    try:
        yield reader
    except TrajectoryError:
        raise
    except Exception as error:
        # A damaged bag makes its reader raise anything, struct.error for one.
        raise unreadable(path, error) from error
    finally:
        reader.close()


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


def cut_bag(path: Path, typestore: Any) -> CutBag | None:
    """What is there of a file of ROS 2 that was cut off; None if that is nothing."""
    if path.suffix.lower() != ".mcap":
        return None
    try:
        cut = CutBag(path, typestore)
    except Exception:
        # Nor is what stands before a cut always whole.
        return None
    return cut if cut.count else None


def unreadable(path: Path, error: Exception) -> TrajectoryError:
    """What to say of a bag that cannot be read."""
    if isinstance(error, OSError):
        return TrajectoryError(f"'{path}' cannot be read: {error.strerror or error}")
    told = (
        str(error) if type(error).__name__.startswith(("AnyReader", "Reader")) else ""
    )
    told = told or f"{type(error).__name__}: {error}"
    hint = "; `ros2 bag reindex`, `rosbag reindex` or `mcap recover` may mend it"
    if "Profile" in told:
        told, hint = "it was not written by ROS 2", "; convert it with `ros2 bag`"
    return TrajectoryError(
        f"'{path.name}' cannot be read as a bag: {told.rstrip('.')}{hint}"
    )


def chosen_topics(
    name: str, connections: Sequence[Any], topics: Sequence[str]
) -> dict[str, str]:
    """Topics to read, and the robot each is of, or ""."""
    able = {c.topic: c.msgtype for c in connections if c.msgtype in READERS}
    every = {c.topic: c.msgtype for c in connections}
    if not able:
        there = ", ".join(f"{t} ({kind})" for t, kind in every.items()) or "nothing"
        raise TrajectoryError(f"{name}: no topic has joint positions; there is {there}")
    if not topics:
        if len(able) > 1:
            there = "\n".join(f"  --topic {t}  ({kind})" for t, kind in able.items())
            raise TrajectoryError(
                f"{name}: several topics have joint positions; name one, or one for "
                f"each robot:\n{there}"
            )
        return dict.fromkeys(able, "")
    chosen = {}
    for asked in topics:
        robot, _, topic = asked.rpartition("=")
        if topic not in able:
            kind = every.get(topic)
            if kind is not None:
                raise TrajectoryError(
                    f"{name}: topic '{topic}' is {kind}, which has no joint positions; "
                    f"{did_you_mean(topic, able)}"
                )
            raise TrajectoryError(
                f"{name}: there is no topic '{topic}'; {did_you_mean(topic, able)}"
            )
        chosen[topic] = robot
    return chosen


def streams_of(
    name: str, reader: Any, chosen: dict[str, str]
) -> tuple[list[Stream], list[str]]:
    """All samples of some topics, apart by who sends which joints.

    Nodes that each measure a part of a machine often share a topic: what names other
    joints is another stream.
    """
    connections = [c for c in reader.connections if c.topic in chosen]
    streams: dict[tuple[str, frozenset[str]], Stream] = {}
    empty, count = dict.fromkeys(chosen, 0), dict.fromkeys(chosen, 0)
    for connection, received, raw in reader.messages(connections=connections):
        topic = connection.topic
        message = reader.deserialize(raw, connection.msgtype)
        count[topic] += 1
        at = f"{name}: {topic}, message {count[topic]}"
        joints, stamps, rows = motion_of(message, connection.msgtype, received, at)
        if not len(rows):
            empty[topic] += 1
            continue
        key = (topic, frozenset(joints))
        if key not in streams:
            streams[key] = Stream(topic, tuple(joints), connection.msgtype)
        streams[key].add(joints, stamps, rows, received)
    notes = [
        f"{topic}: {number} messages without positions were passed over"
        for topic, number in empty.items()
        if number
    ]
    found = list(streams.values())
    by_topic: dict[str, set[str]] = {}
    for stream in found:
        by_topic.setdefault(stream.topic, set()).update(stream.joints)
    for stream in found:
        others = [joints for t, joints in by_topic.items() if t != stream.topic]
        robot = chosen[stream.topic]
        if not robot and any(by_topic[stream.topic] & joints for joints in others):
            # Two arms of one make, each in a namespace of its own.
            robot = stream.topic.strip("/").split("/")[0]
        stream.name_robot(robot)
    return found, notes
