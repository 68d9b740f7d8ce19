"""Motion in YAML or JSON: a trajectory as ROS prints it, or MoveIt's motion request."""

from pathlib import Path
from typing import Any

import numpy as np
from ruamel.yaml import YAMLError

from armguard.bounded import read_text, shown
from armguard.errors import TrajectoryError, did_you_mean
from armguard.scene.trajectory import Trajectory
from armguard.scene.yaml_source import MOST_YAML_BYTES, TooLargeError, parse_yaml

# What reading a value of another form raises.
WRONG_FORM = (KeyError, TypeError, ValueError, AttributeError, OverflowError)


def read_yaml(path: Path) -> Trajectory:
    """A trajectory with `joint_names` and `points`, or a request with a goal."""
    try:
        _, values = parse_yaml(read_text(path, MOST_YAML_BYTES))
    except YAMLError as error:
        why = getattr(error, "problem", None) or shown(str(error))
        is_yaml = isinstance(error, TooLargeError)
        raise TrajectoryError(
            f"'{path.name}' {why if is_yaml else f'is no YAML: {why}'}"
        ) from None
    if isinstance(values, dict) and "points" in values:
        return read_points(path.name, values)
    return read_request(path.name, values)


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
    return Trajectory(joints, q, np.array(times), name)


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
