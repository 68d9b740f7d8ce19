"""What one robot's operator is to see, hear and feel."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Cue:
    """Cues of one robot, from the pairs that are near or about to be.

    Attributes:
        urgency: For light and sound: 0 if nothing is about to happen, 1 where the robot
            does not follow its operator any more [-].
        time_to_contact: Nothing of the robot can touch before that [s]; infinite if
            nothing is near.
        escape: Joint motion that leads away, a unit vector in the order of the robot's
            joints, or zeros, shape (n,).
        tool_escape: Where the tool's origin goes on it, world, shape (3,) [m/rad].
        force: On the tool, away from what is near, for a haptic device; world, shape
            (3,) [N].
        torque: The same about the tool's origin, shape (3,) [N m].
    """

    urgency: float
    time_to_contact: float
    escape: Floats
    tool_escape: Floats
    force: Floats
    torque: Floats

    def to_dict(self) -> dict[str, object]:
        """As plain numbers and lists."""
        return {
            "urgency": self.urgency,
            "time_to_contact": self.time_to_contact,
            "escape": self.escape.tolist(),
            "tool_escape": self.tool_escape.tolist(),
            "force": self.force.tolist(),
            "torque": self.torque.tolist(),
        }
