"""What the page's light, sentence and sounds are told of a cycle."""

import math
from typing import Any

from armguard.guard.levels import Level
from armguard.respond import Action
from armguard.respond.command import Blocked
from armguard.station.palette import (
    LEVEL_COLOURS,
    LEVEL_WORDS,
    Rgb,
    hexadecimal,
)
from armguard.station.view.judged import Judged

ACTION_WORDS = {
    Action.FOLLOW: "follows",
    Action.STOP: "stop",
    Action.BRAKE: "brake",
    Action.HARDWARE_STOP: "hard stop",
}


def state_message(
    cycle: Judged, age: float, grey: str = "", recorded: str = "", remark: str = ""
) -> dict[str, Any]:
    """The message of a cycle.

    Args:
        cycle: The cycle.
        age: Time since it was written [s].
        grey: Why it is not to be taken for the present; empty if it is.
        recorded: When it was recorded, in words; empty where it is live.
        remark: What the service says beside the verdict; empty if nothing.
    """
    verdict, command = cycle.verdict, cycle.command
    level = verdict.level
    cues, scale = verdict.cues, verdict.speed_scale
    actions = {} if command is None else command.actions
    blocked = {} if command is None else command.blocked
    slack = verdict.slack
    return {
        "cycle": cycle.frame.cycle,
        "level": int(level),
        "name": level.name,
        "word": LEVEL_WORDS[level],
        "colour": hexadecimal(LEVEL_COLOURS[level]),
        "ink": hexadecimal(ink_on(LEVEL_COLOURS[level])),
        "why": verdict.why,
        "remark": remark,
        "slack_ms": finite(slack.s * 1e3),
        "slack_mm": finite(slack.m * 1e3),
        "age": age,
        "wall": cycle.frame.wall,
        "grey": grey,
        "recorded": recorded,
        "robots": [
            {
                "name": name,
                "level": int(own),
                "colour": hexadecimal(LEVEL_COLOURS[own]),
                "word": robot_word(own, actions.get(name), scale[name]),
                "blocked": blocked_sentence(own, blocked.get(name, Blocked.NOT)),
                "urgency": cues[name].urgency,
            }
            for name, own in verdict.levels.items()
        ],
    }


def robot_word(level: Level, action: Action | None, scale: float) -> str:
    """What a robot does, in a word or two."""
    if action is None:
        return LEVEL_WORDS[level].lower()
    if action is Action.FOLLOW and scale < 1.0:
        return f"{ACTION_WORDS[action]} {scale * 100:.0f} %"
    return ACTION_WORDS[action]


def blocked_sentence(level: Level, blocked: Blocked) -> str:
    """Why a robot does not follow, or how near it is to that."""
    if blocked is not Blocked.NOT:
        return blocked.sentence
    return {
        Level.CLEAR: "nothing is near",
        Level.CAUTION: "something is near",
        Level.SLOW: "a stop would come soon",
    }.get(level, LEVEL_WORDS[level].lower())


def ink_on(colour: Rgb) -> Rgb:
    """Black or white, whichever is easier to read on a colour."""
    r, g, b = ((c / 255.0) ** 2.2 for c in colour)
    light = 0.2126 * r + 0.7152 * g + 0.0722 * b
    # Contrast to black against contrast to white, as WCAG has it.
    return (0, 0, 0) if (light + 0.05) / 0.05 > 1.05 / (light + 0.05) else (255,) * 3


def finite(value: float) -> float | None:
    """A number, or None where JSON has no word for it."""
    return value if math.isfinite(value) else None
