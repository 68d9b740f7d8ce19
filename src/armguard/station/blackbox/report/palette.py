"""Colours of levels and what else tells them apart, for eyes and for printers.

All are of the palette of Okabe and Ito, which people tell apart who do not see red and
green; each comes with its word, and in areas with a pattern.
"""

from armguard.guard.levels import Level

COLOURS: dict[Level, str] = {
    Level.CLEAR: "#56b4e9",
    Level.CAUTION: "#f0e442",
    Level.SLOW: "#e69f00",
    Level.STOP: "#d55e00",
    Level.RECOVER: "#cc79a7",
    Level.BRAKE: "#7d3200",
    Level.HARDWARE_STOP: "#000000",
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
BLUE = "#0072b2"
GREEN = "#009e73"
ORANGE = "#e69f00"
VERMILLION = "#d55e00"
