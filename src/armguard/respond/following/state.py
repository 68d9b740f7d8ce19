"""States of followers."""

from enum import IntEnum


class State(IntEnum):
    """What a follower does."""

    TO_GOAL = 0
    """Nothing that is sensed decides its motion."""

    FOLLOWING = 1
    """It follows a surface."""

    ARRIVED = 2
    """It is at the goal."""

    UNREACHABLE = 3
    """No way leads to the goal at the standoff."""

    LOCAL_MINIMUM = 4
    """It no longer comes nearer to the goal; whether a way exists is not known."""

    UNDECIDED = 5
    """A boundary was followed without a result."""
