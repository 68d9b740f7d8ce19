"""Figures that look like figures in other units, and how a wrong figure is told."""

from collections.abc import Mapping
from typing import Any

from armguard.errors import ModelError
from armguard.robot.model import JointKind, RobotModel

# Beyond these a figure is taken for one in other units: [rad, rad/s, rad/s²] of joints
# that turn or [m, m/s, m/s²] of those that slide, then [s], [m] and [rad]. The fastest
# arms there are stay well below.
JOINT_CEILINGS = {
    "velocity": 35.0,
    "deceleration": 200.0,
    "acceleration": 1000.0,
    "settle": 0.5,
    "brake_deceleration": 1000.0,
    "position_error": 0.2,
    "velocity_error": 2.0,
    "tracking_error": 2.0,
}
CEILINGS = {
    "ramp": (1.0, "milliseconds", "seconds"),
    "settle_time": (10.0, "milliseconds", "seconds"),
    "brake_delay": (2.0, "milliseconds", "seconds"),
    "sensing": (1.0, "milliseconds", "seconds"),
    "command": (1.0, "milliseconds", "seconds"),
    "stale": (2.0, "milliseconds", "seconds"),
    "model_error": (0.5, "millimetres", "metres"),
    "base_error": (0.5, "millimetres", "metres"),
    "base_turn": (0.5, "degrees", "radians"),
}


class FiguresError(ModelError):
    """A figure is missing, or cannot be true.

    Attributes:
        figure: Its name, an attribute of `StoppingFigures`; "" if it is about several.
        joint: The joint it is wrong for, "" if for all.
    """

    def __init__(self, message: str, figure: str = "", joint: str = "") -> None:
        super().__init__(message)
        self.figure = figure
        self.joint = joint


def check_plausible(model: RobotModel, figures: Mapping[str, Any]) -> None:
    """No figure looks like one in other units.

    Raises:
        FiguresError: One does.
    """
    for key, ceiling in JOINT_CEILINGS.items():
        for name, value in zip(model.q_names, figures[key], strict=True):
            if value > ceiling:
                slides = model.joints[name].kind is JointKind.PRISMATIC
                looks, give = ("millimetres", "metres") if slides else (
                    "degrees", "radians"
                )  # fmt: skip
                raise FiguresError(
                    f"{key} of joint '{name}' is {value:g}, which looks like {looks}; "
                    f"give {give}",
                    key,
                    name,
                )
    for key, (ceiling, looks, give) in CEILINGS.items():
        if figures[key] > ceiling:
            raise FiguresError(
                f"{key} is {figures[key]:g}, which looks like {looks}; give {give}", key
            )
