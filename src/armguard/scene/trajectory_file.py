"""Motion files: which reader a file needs, and what holds for all of them."""

from pathlib import Path

import numpy as np

from armguard.errors import TrajectoryError
from armguard.scene.trajectory import Trajectory
from armguard.scene.trajectory_csv import read_csv
from armguard.scene.trajectory_npz import read_npz
from armguard.scene.trajectory_yaml import read_yaml

READERS = {
    ".csv": read_csv,
    ".npz": read_npz,
    ".yaml": read_yaml,
    ".yml": read_yaml,
    ".json": read_yaml,
}


def load_trajectory(path: str | Path) -> Trajectory:
    """Read a motion: CSV, NPZ, or a trajectory or MoveIt's motion request in YAML.

    CSV: a header of joint names, one configuration a row; a column `t`, `time` or
    `stamp` is time. NPZ: arrays `names`, `q` and, if there is time, `t`. YAML and JSON:
    `joint_names` and `points`, as ROS prints a trajectory.

    Raises:
        TrajectoryError: The file cannot be read as any of these.
    """
    path = Path(path)
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        raise TrajectoryError(
            f"'{path.name}' is no motion file; it must end in "
            f"{', '.join(list(READERS)[:-1])} or {list(READERS)[-1]}"
        )
    try:
        trajectory = reader(path)
    except UnicodeDecodeError:
        raise TrajectoryError(f"'{path.name}' is no text in UTF-8") from None
    except OSError as error:
        raise TrajectoryError(f"'{path}' cannot be read: {error.strerror}") from None
    check_motion(trajectory)
    return trajectory


def check_motion(trajectory: Trajectory) -> None:
    """Refuse a motion that is empty, or whose time goes back."""
    source = trajectory.source
    if len(trajectory.q) == 0:
        raise TrajectoryError(f"{source}: there is no configuration in it")
    stamps = trajectory.stamps
    if stamps is None:
        return
    back = np.flatnonzero(~(np.diff(stamps) >= 0.0))
    if len(back):
        k = int(back[0])
        raise TrajectoryError(
            f"{source}: time goes from {stamps[k]:g} s to {stamps[k + 1]:g} s at "
            f"configuration {k + 2}; it must not go back"
        )
