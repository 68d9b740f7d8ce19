"""Motion from whatever holds some: tables, bags of ROS, our own recordings."""

from collections.abc import Sequence
from pathlib import Path

from armguard.errors import TrajectoryError
from armguard.scene import Scene, Trajectory, load_trajectory
from armguard.scene.trajectory_file import READERS, check_motion
from armguard.station.bags import SUFFIXES, is_bag, read_bag


def load_motion(path: Path, topics: Sequence[str] = ()) -> Trajectory:
    """Read a motion from a file or a folder.

    Args:
        path: What `load_trajectory` reads, or a bag.
        topics: Topics of a bag, see `read_bag`.

    Raises:
        TrajectoryError: It holds no motion.
    """
    if not path.exists():
        raise TrajectoryError(f"'{path}' cannot be read: there is no such file")
    if is_bag(path) or path.is_dir():
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


def motion_notes(motion: Trajectory, scene: Scene) -> list[str]:
    """What a reader had to decide, and what of the file was not used."""
    notes = list(motion.notes)
    unused = motion.unused(scene)
    if unused:
        notes.append(
            "not in the scene, and left out: " + ", ".join(f"'{n}'" for n in unused)
        )
    return notes
