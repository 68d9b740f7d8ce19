"""Trajectories as ROS prints them, and requests of MoveIt."""

from typing import Any

import numpy as np

from armguard.bounded import shown
from armguard.errors import TrajectoryError, did_you_mean
from armguard.scene.trajectory import Trajectory

# What reading a value of another form raises.
WRONG_FORM = (KeyError, TypeError, ValueError, AttributeError, OverflowError)

# Where messages have their `JointTrajectory`: `RobotTrajectory`, and goals of actions.
HOLDERS = ("joint_trajectory", "trajectory")


def read_trajectory(name: str, values: Any) -> Trajectory:
    """A trajectory with `joint_names` and `points`, or a request with a goal.

    Raises:
        TrajectoryError: It is neither.
    """
    held = values
    while isinstance(held, dict) and "points" not in held:
        key = next((key for key in HOLDERS if key in held), "")
        if not key:
            return read_request(name, values)
        held = held[key]
    if isinstance(held, dict):
        return read_points(name, held)
    return read_request(name, values)


def read_points(name: str, values: dict[str, Any]) -> Trajectory:
    """`trajectory_msgs/JointTrajectory`: waypoints that were planned."""
    try:
        joints = tuple(str(joint) for joint in values["joint_names"])
        points = [[float(x) for x in point["positions"]] for point in values["points"]]
        times = [since_start(point["time_from_start"]) for point in values["points"]]
    except WRONG_FORM as error:
        raise TrajectoryError(
            f"'{name}' is no trajectory with joint_names and points, each with "
            f"positions and time_from_start: {shown(str(error))}"
        ) from None
    for k, point in enumerate(points):
        if len(point) != len(joints):
            raise TrajectoryError(
                f"{name}: point {k + 1} has {len(point)} positions; there are "
                f"{len(joints)} joints"
            )
    q = np.array(points, dtype=np.float64).reshape(len(points), len(joints))
    velocities, accelerations = (
        rates_of_points(name, values["points"], key, len(joints))
        for key in ("velocities", "accelerations")
    )
    return Trajectory(
        joints,
        q,
        np.array(times),
        name,
        velocities=velocities,
        accelerations=accelerations,
    )


def rates_of_points(
    name: str, points: list[Any], key: str, count: int
) -> np.ndarray | None:
    """Velocities or accelerations of points, NaN where a point has none, (k, count).

    Returns:
        None where no point has any.

    Raises:
        TrajectoryError: A point has another count of them than there are joints.
    """
    found = np.full((len(points), count), np.nan)
    for k, point in enumerate(points):
        given = point.get(key)
        if not given:
            continue
        try:
            row = [float(x) for x in given]
        except WRONG_FORM:
            row = []
        if len(row) != count:
            raise TrajectoryError(
                f"{name}: point {k + 1} has {len(given)} {key}, or some that are no "
                f"numbers; give one for each of the {count} joints, or none"
            )
        found[k] = row
    return None if np.isnan(found).all() else found


def since_start(value: Any) -> float:
    """A duration: seconds, or ROS's pair of seconds and nanoseconds [s]."""
    if not isinstance(value, dict):
        return float(value)
    whole: Any = value.get("sec", value.get("secs", 0))
    rest: Any = value.get("nanosec", value.get("nsecs", 0))
    return float(whole) + 1e-9 * float(rest)


def read_request(name: str, request: Any) -> Trajectory:
    """A MoveIt motion request: its start state, and its joint goal.

    Joints the goal does not name stay where they start. The way between is not part
    of a request.
    """
    try:
        state = request["start_state"]["joint_state"]
        start = dict(zip(state["name"], map(float, state["position"]), strict=True))
        goal = dict(start)
        for constraints in request["goal_constraints"]:
            for joint in constraints["joint_constraints"]:
                goal[joint["joint_name"]] = float(joint["position"])
    except WRONG_FORM as error:
        raise TrajectoryError(
            f"'{name}' is no trajectory with joint_names and points, and no MoveIt "
            "motion request with a start_state and joint goal_constraints: "
            f"{shown(str(error))}"
        ) from None
    unknown = [joint for joint in goal if joint not in start]
    if unknown:
        raise TrajectoryError(
            f"{name}: the goal names joint '{unknown[0]}', which has no start; "
            f"{did_you_mean(unknown[0], start)}"
        )
    names = tuple(start)
    q = np.array([[state[n] for n in names] for state in (start, goal)])
    return Trajectory(names, q, None, name, ends_only=True)
