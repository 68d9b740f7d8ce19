"""Motion from whatever holds some: tables, bags of ROS, our own recordings."""

from array import array
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from armguard.errors import TrajectoryError
from armguard.scene import Scene, Trajectory, load_trajectory
from armguard.scene.trajectory_file import READERS, check_motion
from armguard.station.bags import SUFFIXES, is_bag, read_bag
from armguard.station.frames import Kind


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
        from armguard.station.blackbox import open_recording
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
