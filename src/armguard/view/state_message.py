"""The message of a cycle to the page: its light, its sentences, its sounds."""

import math
import time
from collections.abc import Mapping
from typing import Any

from armguard.guard.levels import ORDERED, Level, Reason
from armguard.guard.verdict import Verdict
from armguard.recording.palette import (
    STATE_COLOURS,
    STATE_WORDS,
    Rgb,
    hexadecimal,
    state_of,
)
from armguard.respond import Action
from armguard.respond.command import Blocked, Held
from armguard.view.world import Cycle

ACTION_WORDS = {
    Action.FOLLOW: "follows",
    Action.HOLD: "held",
    Action.STOP: "stop",
    Action.BRAKE: "brake",
    Action.HARDWARE_STOP: "hard stop",
}

# How a robot goes on that waits for a person, beside being engaged.
GO_ON = {
    Blocked.STOPPED: "release it once, lead it away",
    Blocked.FAR_START: "command a position near it",
    Blocked.LOCAL_MINIMUM: "lead it elsewhere",
}

# What a robot that follows its operator has to expect.
AHEAD = {
    Level.CLEAR: "nothing within the margin",
    Level.CAUTION: "a body is near",
    Level.SLOW: "a stop is needed soon",
}


def state_message(
    cycle: Cycle,
    age: float,
    grey: str = "",
    recorded: str = "",
    remark: str = "",
    changed: bool = False,
) -> dict[str, Any]:
    """The message of a cycle.

    The light, the sentence and the cards are all made of this one cycle. The light has
    the highest level of the service, the verdict and all robots, and the sentence
    gives the reason of that level.

    Args:
        cycle: The cycle.
        age: Time since it was written [s].
        grey: Why it is not to be taken for the present; empty if it is.
        recorded: When it was recorded, in words; empty where it is live.
        remark: Why the service stops all robots beside the verdict; empty if it does
            not.
        changed: Whether objects were changed within the last second.
    """
    verdict, command, frame = cycle.verdict, cycle.command, cycle.frame
    held = {} if command is None else command.held
    level = max(
        cycle.level,
        Level.STOP if remark else Level.CLEAR,
        Level.CAUTION if changed else Level.CLEAR,
    )
    state = state_of(level, bool(held))
    why = sentence(cycle, held, remark, changed)
    full = (command or verdict).explain()
    return {
        "cycle": frame.cycle,
        "level": int(level),
        "name": state.name,
        "word": STATE_WORDS[state],
        "colour": hexadecimal(STATE_COLOURS[state]),
        "ink": hexadecimal(ink_on(STATE_COLOURS[state])),
        "held": bool(held),
        "why": why,
        "explanation": full if full.startswith(why) else f"{why}\n\n{full}",
        "changed": changed,
        "measures": measures(verdict, level),
        "age": age,
        "wall": frame.wall,
        "grey": grey,
        "recorded": recorded,
        "robots": [robot_card(cycle, name, remark) for name in verdict.levels],
    }


def robot_card(cycle: Cycle, name: str, remark: str) -> dict[str, Any]:
    """The card of a robot: its level, its action, and why it does not follow.

    Args:
        cycle: The cycle.
        name: The robot.
        remark: Why the service stops all robots beside the verdict.
    """
    verdict, command = cycle.verdict, cycle.command
    level = verdict.levels[name]
    if remark:
        level = max(level, Level.STOP)
    action, held, blocked = None, None, Blocked.NOT
    if command is not None:
        action, blocked = command.actions[name], command.blocked[name]
        held = command.held.get(name)
    if held is not None:
        why = f"since {since(cycle, held)}: {held.cause}"
    elif remark or blocked is not Blocked.NOT:
        why = remark or blocked.sentence
    else:
        stops = verdict.reason.level >= Level.STOP
        why = AHEAD.get(level, verdict.reason.sentence if stops else "stopped")
    shown = level if held is None else max(level, Level.STOP)
    return {
        "name": name,
        "level": int(level),
        "shown": int(shown),
        "colour": hexadecimal(STATE_COLOURS[state_of(level, held is not None)]),
        "word": robot_word(level, action, verdict.speed_scale[name]),
        "blocked": why,
        "urgency": verdict.cues[name].urgency,
    }


def sentence(
    cycle: Cycle, held: Mapping[str, Held], remark: str = "", changed: bool = False
) -> str:
    """Why the light has its level, the most urgent first.

    Robots that wait for a person come first: why, since when, how to go on. A reason
    of the verdict below a stop is left out beside a stop.

    Args:
        cycle: The cycle.
        held: Robots that wait for a person.
        remark: Why the service stops all robots beside the verdict.
        changed: Whether objects were changed within the last second.
    """
    verdict = cycle.verdict
    sentences = waiting(cycle, held)
    if remark and not held:
        sentences.append(remark)
    stopped = [name for name, own in verdict.levels.items() if own >= Level.STOP]
    if verdict.reason.level >= Level.STOP:
        said = verdict.reason in ORDERED or verdict.why in "; ".join(sentences)
        if not sentences or not said:
            sentences.append(verdict.why + cause_of_stop(verdict, "; ".join(sentences)))
    elif not sentences and stopped:
        sentences.append(f"{' and '.join(stopped)}: stopped")
    elif not sentences and not (changed and verdict.reason is Reason.OK):
        sentences.append(verdict.why)
    if changed:
        sentences.append("objects were changed")
    return "; ".join(sentences)


def cause_of_stop(verdict: Verdict, said: str) -> str:
    """Why robots that are still stopping were stopped, as the end of a sentence.

    Args:
        verdict: The verdict.
        said: Sentences before, whose causes are not repeated.
    """
    if verdict.reason is not Reason.STOPPING:
        return ""
    known = set(verdict.causes.values()) - {Reason.OK, Reason.STOPPING}
    unsaid = {cause.sentence for cause in known if cause.sentence not in said}
    causes = " and ".join(sorted(unsaid))
    return f" ({causes})" if causes else ""


def waiting(cycle: Cycle, held: Mapping[str, Held]) -> list[str]:
    """Why robots wait for a person, since when, and how each goes on.

    A fault of the input that is still there comes with its place and its remedy: until
    then no robot goes on.
    """
    groups: dict[str, list[str]] = {}
    verdict = cycle.verdict
    for name, one in held.items():
        why, how = f"HELD: {one.cause}", "press Engage all"
        if one.reason is verdict.reason and one.reason >= Reason.NOT_FINITE:
            fault = f"HELD since {since(cycle, one)}: {verdict.why} – then {how}"
            groups.setdefault(fault, []).append(name)
            continue
        if one.reason is Reason.STOP_ORDERED and one.until_engaged:
            why = "STOPPED BY A PERSON"
        elif not one.until_engaged:
            how = f"{GO_ON[one.blocked]}, or {how}"
        said = f"{why}, since {since(cycle, one)} – {how}"
        groups.setdefault(said, []).append(name)
    return [
        said
        if len(names) == len(cycle.verdict.levels)
        else f"{' and '.join(names)} {said}"
        for said, names in groups.items()
    ]


def since(cycle: Cycle, held: Held) -> str:
    """When a robot began to wait, on this machine's wall clock."""
    frame = cycle.frame
    now = held.since if frame.now is None else frame.now
    return time.strftime("%H:%M:%S", time.localtime(frame.wall - (now - held.since)))


def robot_word(level: Level, action: Action | None, scale: float) -> str:
    """Action of a robot in a word or two that do not contradict its level.

    Args:
        level: Its level.
        action: Its action; None where no motion was requested.
        scale: Share of the speed that it may have [-].
    """
    if action is None or (action is Action.FOLLOW and level >= Level.STOP):
        return STATE_WORDS[level].lower()
    percent = round(scale * 100)
    if action is Action.FOLLOW and percent < 100:
        return f"{ACTION_WORDS[action]} {percent} %"
    return ACTION_WORDS[action]


def ink_on(colour: Rgb) -> Rgb:
    """Black or white, whichever is easier to read on a colour."""
    r, g, b = ((c / 255.0) ** 2.2 for c in colour)
    light = 0.2126 * r + 0.7152 * g + 0.0722 * b
    # Contrast to black against contrast to white, as WCAG has it.
    return (0, 0, 0) if (light + 0.05) / 0.05 > 1.05 / (light + 0.05) else (255,) * 3


def measures(verdict: Verdict, level: Level) -> list[str]:
    """Time and distance that are left, in words; no time to a stop beside a stop."""
    left, said = verdict.headroom, []
    if math.isfinite(left.s) and level < Level.STOP:
        said.append(f"≥ {left.s * 1e3:.0f} ms to a stop")
    if math.isfinite(left.m):
        said.append(f"headroom {left.m * 1e3:.1f} mm")
    return said
