"""Colours of levels and of robots, and the word that goes with each.

All but a dark vermillion are of the palette of Okabe and Ito, whose colours differ for
people with red-green colour blindness; the lightness differs too, and each colour comes
with its word.
"""

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

LEVEL_COLOURS: dict[Level, Rgb] = {
    Level.CLEAR: SKY,
    Level.CAUTION: YELLOW,
    Level.SLOW: ORANGE,
    Level.STOP: VERMILLION,
    Level.RECOVER: PURPLE,
    Level.BRAKE: BROWN,
    Level.HARDWARE_STOP: BLACK,
}

LEVEL_WORDS: dict[Level, str] = {
    Level.CLEAR: "CLEAR",
    Level.CAUTION: "CAUTION",
    Level.SLOW: "SLOW",
    Level.STOP: "STOP",
    Level.RECOVER: "BACK OUT",
    Level.BRAKE: "BRAKE",
    Level.HARDWARE_STOP: "EMERGENCY STOP",
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


def hexadecimal(colour: Rgb) -> str:
    """A colour as a page writes it."""
    return "#{:02x}{:02x}{:02x}".format(*colour)
