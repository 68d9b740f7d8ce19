"""What the page's light, sentence and sounds are told of a cycle."""

import math
import time
from collections.abc import Mapping
from typing import Any

from armguard.guard.levels import ORDERED, Level, Reason
from armguard.respond import Action
from armguard.respond.command import Blocked, Held
from armguard.station.palette import (
    LEVEL_COLOURS,
    LEVEL_WORDS,
    Rgb,
    hexadecimal,
)
from armguard.station.view.judged import Judged

ACTION_WORDS = {
    Action.FOLLOW: "follows",
    Action.HOLD: "held",
    Action.STOP: "stop",
    Action.BRAKE: "brake",
    Action.HARDWARE_STOP: "hard stop",
}

# How a robot goes on that waits for a person, beside being engaged.
GO_ON = {
    Blocked.STOPPED: "let go of it once, lead it away",
    Blocked.FAR_START: "command a position near it",
    Blocked.LOCAL_MINIMUM: "lead it elsewhere",
}


def state_message(
    cycle: Judged,
    age: float,
    grey: str = "",
    recorded: str = "",
    remark: str = "",
    changed: bool = False,
) -> dict[str, Any]:
    """The message of a cycle.

    Args:
        cycle: The cycle.
        age: Time since it was written [s].
        grey: Why it is not to be taken for the present; empty if it is.
        recorded: When it was recorded, in words; empty where it is live.
        remark: Why the service stops all robots beside the verdict; empty if it does
            not.
        changed: Whether objects were changed within the last second.
    """
    verdict, command = cycle.verdict, cycle.command
    cues, scale = verdict.cues, verdict.speed_scale
    actions = {} if command is None else command.actions
    blocked = {} if command is None else command.blocked
    held = {} if command is None else command.held
    level = max(
        verdict.level,
        Level.STOP if remark or held else Level.CLEAR,
        Level.CAUTION if changed else Level.CLEAR,
    )
    waits = bool(held) and level < Level.BRAKE
    slack = verdict.slack
    return {
        "cycle": cycle.frame.cycle,
        "level": int(level),
        "name": "HELD" if waits else level.name,
        "word": "HELD" if waits else LEVEL_WORDS[level],
        "colour": hexadecimal(LEVEL_COLOURS[level]),
        "ink": hexadecimal(ink_on(LEVEL_COLOURS[level])),
        "held": bool(held),
        "why": sentence(cycle, held),
        "remark": remark if not held else "",
        "changed": "objects were changed" if changed else "",
        "slack_ms": finite(slack.s * 1e3),
        "slack_mm": finite(slack.m * 1e3),
        "age": age,
        "wall": cycle.frame.wall,
        "grey": grey,
        "recorded": recorded,
        "robots": [
            robot_card(
                name,
                Level.STOP if remark and own < Level.STOP else own,
                actions.get(name),
                scale[name],
                f"since {since(cycle, held[name])}: {held[name].cause}"
                if name in held
                else remark or blocked_sentence(own, blocked.get(name, Blocked.NOT)),
                name in held,
                cues[name].urgency,
            )
            for name, own in verdict.levels.items()
        ],
    }


def sentence(cycle: Judged, held: Mapping[str, Held]) -> str:
    """Robots that wait for a person: why, since when, how to go on; then the rest."""
    verdict = cycle.verdict
    groups: dict[tuple[str, str, str], list[str]] = {}
    for name, one in held.items():
        how = "press Engage all"
        if one.reason is Reason.STOP_ORDERED and one.until_engaged:
            why = "STOPPED BY A PERSON"
        else:
            why = f"HELD: {one.cause}"
            if not one.until_engaged:
                how = f"{GO_ON[one.blocked]}, or {how}"
        groups.setdefault((why, since(cycle, one), how), []).append(name)
    said = [
        ("" if len(names) == len(verdict.levels) else f"{' and '.join(names)} ")
        + f"{why}, since {when} – {how}"
        for (why, when, how), names in groups.items()
    ]
    if not said or verdict.reason not in (Reason.OK, *ORDERED):
        said.append(verdict.why)
    return "; ".join(said)


def since(cycle: Judged, held: Held) -> str:
    """When a robot began to wait, on this machine's wall clock."""
    frame = cycle.frame
    now = held.since if frame.now is None else frame.now
    return time.strftime("%H:%M:%S", time.localtime(frame.wall - (now - held.since)))


def robot_card(
    name: str,
    level: Level,
    action: Action | None,
    scale: float,
    why: str,
    waits: bool,
    urgency: float,
) -> dict[str, Any]:
    """What the card of a robot shows.

    Args:
        name: The robot.
        level: What it should do.
        action: What it is told; None where nothing is.
        scale: Share of the speed that it may have [-].
        why: Why it does not follow, or how near it is to that.
        waits: Whether it waits for a person.
        urgency: How much its operator is to be warned [-].
    """
    shown = max(level, Level.STOP) if waits else level
    return {
        "name": name,
        "level": int(level),
        "colour": hexadecimal(LEVEL_COLOURS[shown]),
        "word": robot_word(level, action, scale),
        "blocked": why,
        "urgency": urgency,
    }


def robot_word(level: Level, action: Action | None, scale: float) -> str:
    """What a robot does, in a word or two that do not contradict its level."""
    if action is None or (action is Action.FOLLOW and level >= Level.STOP):
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
