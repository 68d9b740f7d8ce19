"""Messages of ROS that hold joint positions, and what each of them says."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armguard.errors import TrajectoryError
from armguard.station.bag_streams import NANO

Floats = NDArray[np.float64]
Longs = NDArray[np.int64]

# Names, stamps [ns since 1970] and positions, one row for each stamp.
Motion = tuple[Sequence[str], Longs, Floats]

NOTHING: Motion = ((), np.zeros(0, np.int64), np.zeros((0, 0)))


def motion_of(message: Any, kind: str, received: int, at: str) -> Motion:
    """What a message says of joint positions.

    Args:
        message: The message.
        kind: Its type.
        received: When the bag got it [ns since 1970].
        at: Where it is, for errors.

    Raises:
        TrajectoryError: It has other than one position for each name.
    """
    names, stamps, rows = READERS[kind](message, received)
    if len(rows) and rows.shape[1] != len(names):
        raise TrajectoryError(
            f"{at}: {rows.shape[1]} positions for {len(names)} joints"
        )
    return names, stamps, rows


def header_stamp(message: Any, received: int) -> int:
    """When a message was made; when it was received if its header does not say."""
    stamp = message.header.stamp
    return (int(stamp.sec) * NANO + int(stamp.nanosec)) or received


def joint_state(message: Any, received: int) -> Motion:
    """`sensor_msgs/JointState`."""
    return one_row(message, message.name, message.position, received)


def controller_state(message: Any, received: int) -> Motion:
    """`control_msgs/JointTrajectoryControllerState`: what was measured.

    It is `feedback` since ROS 2 Iron and was `actual` before.
    """
    point = getattr(message, "feedback", None)
    if point is None or not len(point.positions):
        point = getattr(message, "actual", point)
    if point is None:
        return NOTHING
    return one_row(message, message.joint_names, point.positions, received)


def joint_trajectory(message: Any, received: int) -> Motion:
    """`trajectory_msgs/JointTrajectory`: waypoints, from the header's stamp on."""
    start = header_stamp(message, received)
    points = [point for point in message.points if len(point.positions)]
    stamps = [
        start
        + int(point.time_from_start.sec) * NANO
        + int(point.time_from_start.nanosec)
        for point in points
    ]
    rows = [np.asarray(point.positions, dtype=np.float64) for point in points]
    odd = [len(row) for row in rows if len(row) != len(message.joint_names)]
    if odd:
        return message.joint_names, np.zeros(1, np.int64), np.zeros((1, odd[0]))
    table = np.array(rows, dtype=np.float64) if rows else np.zeros((0, 0))
    return message.joint_names, np.array(stamps, np.int64), table


def one_row(
    message: Any, names: Sequence[str], positions: Any, received: int
) -> Motion:
    """A single sample; nothing if it has no positions."""
    if not len(positions):
        return NOTHING
    stamp = np.array([header_stamp(message, received)], np.int64)
    return names, stamp, np.asarray(positions, dtype=np.float64)[None, :]


PLANNED = "trajectory_msgs/msg/JointTrajectory"

READERS: dict[str, Callable[[Any, int], Motion]] = {
    "sensor_msgs/msg/JointState": joint_state,
    "control_msgs/msg/JointTrajectoryControllerState": controller_state,
    PLANNED: joint_trajectory,
}
