"""Colours of levels as pages write them, and what else tells levels apart in print.

Each colour comes with its word, and in areas with a pattern.
"""

from armguard.guard.levels import Level
from armguard.station import palette
from armguard.station.palette import LEVEL_COLOURS, hexadecimal

COLOURS: dict[Level, str] = {
    level: hexadecimal(colour) for level, colour in LEVEL_COLOURS.items()
}

# Letters on a colour.
ON_COLOUR: dict[Level, str] = {
    level: "#ffffff" if level >= Level.STOP and level != Level.RECOVER else "#1b1f24"
    for level in Level
}

PATTERNS: dict[Level, str] = {
    Level.CLEAR: "",
    Level.CAUTION: ".",
    Level.SLOW: "/",
    Level.STOP: "",
    Level.RECOVER: "\\",
    Level.BRAKE: "x",
    Level.HARDWARE_STOP: "+",
}

WORDS: dict[Level, str] = {
    level: level.name.lower().replace("_", " ") for level in Level
}

INK = "#1b1f24"
FAINT = "#5b6570"
LINE = "#d5dae0"
BLUE = hexadecimal(palette.BLUE)
GREEN = hexadecimal(palette.GREEN)
ORANGE = hexadecimal(palette.ORANGE)
VERMILLION = hexadecimal(palette.VERMILLION)
