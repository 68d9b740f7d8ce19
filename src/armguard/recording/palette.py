"""States of robots, their colours and words, and the colours of robots.

All but a dark vermillion are of the palette of Okabe and Ito, whose colours differ for
people with red-green colour blindness; the lightness differs too, and each colour comes
with its word.
"""

from armguard.errors import NamedNumber
from armguard.guard.levels import Level

Rgb = tuple[int, int, int]

SKY: Rgb = (86, 180, 233)
YELLOW: Rgb = (240, 228, 66)
ORANGE: Rgb = (230, 159, 0)
VERMILLION: Rgb = (213, 94, 0)
PURPLE: Rgb = (204, 121, 167)
BLUE: Rgb = (0, 114, 178)
GREEN: Rgb = (0, 158, 115)
BROWN: Rgb = (125, 50, 0)
BLACK: Rgb = (0, 0, 0)


class State(NamedNumber):
    """What pages, plots and reports show of a robot: its level, or that it is held."""

    CLEAR = Level.CLEAR
    CAUTION = Level.CAUTION
    SLOW = Level.SLOW
    STOP = Level.STOP
    RECOVER = Level.RECOVER
    HELD = 35
    """At rest after a stop, until it is released, led away or engaged."""
    BRAKE = Level.BRAKE
    HARDWARE_STOP = Level.HARDWARE_STOP


# By state, and so by level as well. A robot that is held is stopped.
STATE_COLOURS: dict[int, Rgb] = {
    State.CLEAR: SKY,
    State.CAUTION: YELLOW,
    State.SLOW: ORANGE,
    State.STOP: VERMILLION,
    State.RECOVER: PURPLE,
    State.HELD: VERMILLION,
    State.BRAKE: BROWN,
    State.HARDWARE_STOP: BLACK,
}

STATE_WORDS: dict[int, str] = {
    State.CLEAR: "CLEAR",
    State.CAUTION: "CAUTION",
    State.SLOW: "SLOW",
    State.STOP: "STOP",
    State.RECOVER: "BACK OUT",
    State.HELD: "HELD",
    State.BRAKE: "BRAKE",
    State.HARDWARE_STOP: "EMERGENCY STOP",
}

# Robots differ by tints that no level has.
ROBOT_TINTS: tuple[Rgb, ...] = (
    (176, 196, 214),
    (214, 200, 176),
    (184, 208, 190),
    (206, 186, 206),
)

FIXTURE: Rgb = (150, 154, 160)
PLACED: Rgb = (122, 139, 160)
GRASPABLE: Rgb = (0, 130, 150)


def state_of(level: int, held: bool) -> State:
    """What is shown of robots of a level: at `BRAKE` that they are held is minor.

    Args:
        level: Their highest level.
        held: Whether one of them is held.
    """
    return State.HELD if held and level < Level.BRAKE else State(level)


def hexadecimal(colour: Rgb) -> str:
    """A colour as a page writes it."""
    return "#{:02x}{:02x}{:02x}".format(*colour)
