"""Joint limits in the order of q, and the configuration a robot is at home in."""

from collections.abc import Mapping
from numbers import Real

import numpy as np
from numpy.typing import NDArray

from armguard.errors import ModelError, did_you_mean
from armguard.geometry.pose import LOOKS_LIKE_DEGREES
from armguard.robot.model import Joint, JointKind, RobotModel

# A sliding joint so many times beyond its limits is in millimetres [-].
FAR_BEYOND_LIMITS = 10.0

# Nothing near an arm is so far away or so long in metres [m].
LOOKS_LIKE_MILLIMETRES = 20.0

# Names of SRDF group states that say where a robot is at home, the first found wins;
# if there is none of these, the file's first state does.
HOME_STATES = ("home", "ready", "default", "rest", "neutral", "half_sitting")


def joint_limits(
    model: RobotModel,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Lower and upper limits in the order of `q_names`, each shape (n,)."""
    joints = [model.joints[name] for name in model.q_names]
    return np.array([j.lower for j in joints]), np.array([j.upper for j in joints])


def other_unit(joint: Joint, value: float) -> str:
    """In words, that a position outside its limits is in another unit; "" if not so.

    Args:
        joint: The joint.
        value: Its position [rad or m].
    """
    most = max(joint.upper, -joint.lower)
    if joint.kind is JointKind.REVOLUTE and abs(value) > max(LOOKS_LIKE_DEGREES, most):
        return "which looks like degrees; give radians"
    if joint.kind is JointKind.PRISMATIC and abs(value) > FAR_BEYOND_LIMITS * most:
        return "which looks like millimetres; give metres"
    return ""


def home_configuration(
    model: RobotModel, chosen: Mapping[str, float] | None = None
) -> dict[str, float]:
    """Home position of every joint: chosen, else the SRDF's, else nearest to zero.

    Args:
        model: The robot.
        chosen: Positions the user gives, by joint name [rad or m].

    Raises:
        ModelError: A chosen joint does not exist, or is outside its limits.
    """
    chosen = chosen or {}
    for name, value in chosen.items():
        if name not in model.q_names:
            raise ModelError(
                f"home names the joint '{name}', which robot '{model.name}' does not "
                f"move; {did_you_mean(name, model.q_names)}"
            )
        joint = model.joints[name]
        given: object = value
        if isinstance(given, bool) or not isinstance(given, Real):
            raise ModelError(
                f"home puts joint '{name}' at {given!r}; it must be a number [rad or m]"
            )
        if not joint.lower <= value <= joint.upper:
            hint = other_unit(joint, float(value))
            raise ModelError(
                f"home puts joint '{name}' at {value:g}{hint and f', {hint}'}; its "
                f"limits are [{joint.lower:g}, {joint.upper:g}]"
            )
    state: Mapping[str, float] = {}
    for name in (*HOME_STATES, *model.group_states):
        if name in model.group_states:
            state = model.group_states[name]
            break
    home = {}
    for name in model.q_names:
        joint = model.joints[name]
        value = state.get(name, 0.0)
        home[name] = float(chosen.get(name, min(max(value, joint.lower), joint.upper)))
    return home
