"""What a client tells that hears nothing: every robot stops."""

from collections.abc import Callable
from math import inf, nan

import numpy as np
from numpy.typing import NDArray

from armguard.station.client.answer import (
    NANO,
    STOP_ACTION,
    STOP_LEVEL,
    Answer,
    RobotNumbers,
)
from armguard.station.client.fields import BODY, FIELDS
from armguard.station.client.welcome import Welcome
from armguard.station.wire.layout import HEADER, NOBODY, ROBOT, SEAL, SUMMARY
from armguard.station.wire.words import Cause

Floats = NDArray[np.float64]

# What a robot is told by a client that has heard nothing.
STOPPED = RobotNumbers(STOP_LEVEL, STOP_ACTION, 0, 0, 0.0, 1.0, inf, 0, 0, nan)


def stop_answer(
    cause: Cause, position: Floats, welcome: Welcome, clock: Callable[[], float]
) -> Answer:
    """The answer of a client that has none: every robot stops.

    Args:
        cause: Why.
        position: Where robots are, NaN where that is not known, shape (n,).
        welcome: What the service told about itself.
        clock: Its clock [s].
    """
    now, joints, robots = clock(), len(welcome.names), len(welcome.robots)
    head = 0, 0, 0, 0, 0, 0, 0, 0, round(now / NANO)
    nothing = -1, 0, 0, 0, 0, now, nan, nan, NOBODY, NOBODY, *(nan,) * 8
    summary = 0, cause, STOP_LEVEL, STOP_ACTION, 0, joints, robots, 0, 0
    message = (
        HEADER.pack(*head)
        + BODY.pack(*nothing)
        + SUMMARY.pack(*summary)
        + ROBOT.pack(*STOPPED) * robots
        + bytes(8 * joints)
        + np.asarray(position, np.float64).tobytes()
        + bytes(SEAL)
    )
    return Answer(message, FIELDS.unpack_from(message), welcome, clock)
