"""Stopping figures of the robots by name: published where we found them, else assumed.

Every figure says in `sources` where it is from. What holds the word "assumption:" we
could not trace to its maker: it is a careful guess, to be replaced by your robot's
manual or by a measurement of yours.
"""

from collections.abc import Mapping
from typing import Any

from armguard.robot.model import RobotModel
from armguard.robot.named import ROBOTS, robot_data
from armguard.robot.stopping.declared import ASSUMPTION
from armguard.robot.stopping.figures import StoppingFigures, stopping_figures

# Figures that no data file has.
NO_ERROR = ASSUMPTION + "0: the URDF is right, and the base stands where the scene says"
NO_ERRORS = dict.fromkeys(("model_error", "base_error", "base_turn"), NO_ERROR)


def named_figures(name: str, model: RobotModel) -> StoppingFigures | None:
    """Stopping figures of a robot by name, None if it has none.

    Args:
        name: Its name in `armguard.robot.named.ROBOTS`.
        model: The robot.
    """
    if name not in ROBOTS:
        return None
    data = robot_data(name)
    if isinstance(data["figures"], str):
        data = robot_data(data["figures"])
    rows = data["figures"]
    groups = data.get("joints", {})
    return stopping_figures(
        model,
        **{key: by_joint(row["value"], groups) for key, row in rows.items()},
        sources={**{key: row["source"] for key, row in rows.items()}, **NO_ERRORS},
    )


def by_joint(value: Any, groups: Mapping[str, list[str]]) -> Any:
    """A figure by joint name; in the data it is a number, or one or several a group."""
    if not isinstance(value, Mapping):
        return value
    found: dict[str, float] = {}
    for group, given in value.items():
        joints = groups[group]
        several = given if isinstance(given, list) else [given] * len(joints)
        found |= zip(joints, several, strict=True)
    return found
