"""A verdict in words: one short line, or the full text with all terms."""

from collections.abc import Sequence
from math import isfinite

import numpy as np

from armguard.guard.answer import Answer
from armguard.guard.given import top_speeds
from armguard.guard.layout import IN_HEADER
from armguard.guard.levels import OF_OBJECTS, ORDERED, Level, Reason
from armguard.guard.near_pair import NearPair
from armguard.guard.pace import clock_sentence, late_sentence
from armguard.motion.pair_state import UNPROVEN

# Reasons that the nearest pair explains.
ABOUT_PAIRS = (
    Reason.NEAR,
    Reason.SHORT_TIME,
    Reason.TOO_CLOSE,
    Reason.NO_PROOF,
    Reason.BUDGET_SPENT,
    Reason.CONTRACT_EXCEEDED,
    Reason.STOPPING,
    Reason.RESTING,
    Reason.UNPROVEN,
)

# Reasons whose value is a time.
IN_MILLISECONDS = (
    Reason.STAMP_AHEAD,
    Reason.STATE_STALE,
    Reason.CELLS_AHEAD,
)

# The action of a level, in a word. The word of `RECOVER` is that of its reason.
ACTIONS = {
    Level.CLEAR: "clear",
    Level.CAUTION: "caution",
    Level.SLOW: "slowing",
    Level.STOP: "stop",
    Level.RECOVER: "stopped",
    Level.BRAKE: "brake",
    Level.HARDWARE_STOP: "hardware stop",
}

# What decides a stop for a pair beside its distances.
DECIDING = {
    Reason.NO_PROOF: "no proof that it keeps its buffer",
    Reason.BUDGET_SPENT: "proof budget of the cycle used up, raise it",
    Reason.CONTRACT_EXCEEDED: "contact deeper or faster than its contract allows",
}

# Near pairs and unproven pairs that an explanation names.
NAMED = 8

# Greatest rounding error of a sum of terms [m].
TOLERANCE = 1e-9

# Remedies of faults of a joint that the sentence of their reason does not hold.
REMEDIES = {
    Reason.NOT_FINITE: "check the sensor",
    Reason.STATE_JUMPED: "check units, joint order and stamps",
    Reason.TOO_FAST: "check its unit, rad/s or m/s",
    Reason.NOT_FOLLOWED: "send the robot each command, and nothing else",
    Reason.STATE_FROZEN: "check that each cycle has a new measurement",
    Reason.STATE_DISAGREES: "check the unit of `velocity`, rad/s or m/s, or omit it",
    Reason.STAMP_REPEATED: "stamp each measurement when it is taken",
}

# Remedy for a joint outside its limits, where the positions show no other mistake.
OUTSIDE = (
    "move the joint back inside by hand or with the robot's own controller, "
    "or check units and order"
)

# Reasons explained by a joint that has not stopped as declared.
LAGS = (Reason.STOP_LAGS, Reason.BRAKE_LAGS)

# Reasons about the speed of a joint.
AT_SPEED = (
    Reason.STATE_JUMPED,
    Reason.TOO_FAST,
    Reason.NOT_FOLLOWED,
    Reason.STATE_DISAGREES,
)

# Reasons that are about the whole cycle, not about one robot.
OF_ALL = (Reason.WRONG_INPUT, Reason.CYCLE_LATE, Reason.TIME_STILL, *ORDERED)


def sentence_of(
    level: Level, reason: Reason, answer: Answer, disproved: Sequence[str], fault: str
) -> str:
    """A verdict in one short line: pair, distance, action, remedy.

    Args:
        level: Its level.
        reason: Its reason.
        answer: The answer of the cycle.
        disproved: Joints that have not stopped as declared.
        fault: Fault of the input in words, or "".
    """
    action = ACTIONS[level]
    if fault and reason is not Reason.OUT_OF_LIMITS:
        return f"{action}: {fault}"
    if reason is Reason.OK and level is Level.CLEAR:
        return f"clear: nothing within {answer.names.tables.margin * 1e3:.0f} mm"
    k = deciding(reason, answer)
    if reason in ABOUT_PAIRS and k >= 0:
        return pair_sentence(action, reason, answer.pair(k))
    if answer.data[IN_HEADER.joint] >= 0.0:
        return joint_sentence(action, reason, answer, fault or OUTSIDE)
    return input_sentence(action, reason, answer, subject_of(reason, answer, disproved))


def subject_of(reason: Reason, answer: Answer, disproved: Sequence[str]) -> str:
    """Name of the joint, object or robot of a fault; "" if it concerns all, or none."""
    names = answer.names
    joint, r = (
        int(answer.data[IN_HEADER.joint]),
        int(answer.data[IN_HEADER.robot]),
    )
    if joint >= 0:
        return names.tables.q_names[joint]
    if reason in LAGS and disproved:
        return disproved[0]
    if reason in OF_OBJECTS:
        return names.tables.body_names[int(answer.data[IN_HEADER.value])]
    known = 0 <= r < len(names.robots)
    return names.robots[r] if known and reason not in OF_ALL else ""


def deciding(reason: Reason, answer: Answer) -> int:
    """Index of the near pair that a verdict is about, -1 for none."""
    if reason is Reason.UNPROVEN:
        unproven = np.flatnonzero(answer.near["proof"] == UNPROVEN)
        if len(unproven):
            return int(unproven[answer.near["distance"][unproven].argmin()])
    return answer.deciding(reason)


def pair_sentence(action: str, reason: Reason, pair: NearPair) -> str:
    """Line of a reason that a pair explains."""
    return f"{pair.distance_sentence}: {pair_demand(action, reason, pair)}"


def pair_demand(action: str, reason: Reason, pair: NearPair) -> str:
    """The action for a pair, and why."""
    if reason is Reason.STOPPING:
        return "still stopping"
    if reason is Reason.RESTING:
        return "stopped, only motion away is allowed"
    if reason is Reason.UNPROVEN:
        return "leaving, nothing is proven"
    if reason is Reason.SHORT_TIME and isfinite(pair.time_left):
        milliseconds = round(pair.time_left * 1e3)
        if milliseconds == 0:
            return f"{action}, no headroom left"
        return f"{action}, stop needed in {milliseconds} ms"
    return f"{action}, {DECIDING.get(reason, pair.demand)}"


def input_sentence(action: str, reason: Reason, answer: Answer, subject: str) -> str:
    """Line of a reason about a robot, an object or the cycle."""
    sentence, value = reason.sentence, float(answer.data[IN_HEADER.value])
    tables = answer.names.tables
    if reason is Reason.CYCLE_LATE and isfinite(value):
        sentence = late_sentence(value, tables.period, tables.late)
    if reason in IN_MILLISECONDS:
        sentence = f"{sentence} ({value * 1e3:.1f} ms){clock_sentence(value)}"
    if reason is Reason.CELLS_STALE:
        # Before the first cells there is no age.
        sentence += " and its sensors" + f" ({value:.1f} s)" * isfinite(value)
    if reason is Reason.TIME_BACKWARDS and value < 0.0:
        sentence = f"{sentence} (by {value * -1e3:.1f} ms)"
    if reason is Reason.TIME_STILL:
        sentence = f"{sentence} ({value:.6f} s)"
    said_already = sentence.startswith((action, "still "))
    if subject:
        return f"'{subject}': {sentence if said_already else f'{action}, {sentence}'}"
    return sentence if said_already else f"{action}: {sentence}"


def joint_sentence(action: str, reason: Reason, answer: Answer, advice: str) -> str:
    """Line of a reason about a joint, with advice where it is outside its limits."""
    k, value = (
        int(answer.data[IN_HEADER.joint]),
        float(answer.data[IN_HEADER.value]),
    )
    names = answer.names
    at, sentence = "", reason.sentence
    if reason in AT_SPEED:
        at = f" at {value:.2f} a second"
        if reason is Reason.TOO_FAST:
            sentence = f"{sentence}, {top_speeds(names.tables)[k]:g}"
    elif reason is Reason.DRIVE_LAGS:
        sentence = f"{sentence}, by at least {value * 1e3:.1f} ms"
    elif reason is Reason.STATE_FROZEN:
        at = f" at {value:.4f}"
    elif reason is Reason.STAMP_REPEATED:
        sentence = f"{sentence} ({value:.6f} s)"
    elif reason is Reason.NOT_FINITE:
        at, sentence = f" is at {value}", "it must be finite"
    else:
        lower, upper = names.tables.lower[k], names.tables.upper[k]
        at = f" is at {value:.4f}"
        sentence = f"its limits are [{lower:.4f}, {upper:.4f}]; {advice}"
    if reason in REMEDIES:
        sentence = f"{sentence}; {REMEDIES[reason]}"
    return f"joint '{names.tables.q_names[k]}'{at}: {action}, {sentence}"


def explanation_of(
    why: str, reason: Reason, answer: Answer, disproved: Sequence[str]
) -> str:
    """A verdict in full, in several lines.

    Args:
        why: The verdict in one line.
        reason: Its reason.
        answer: The answer of the cycle.
        disproved: Joints that have not stopped as declared.
    """
    lines = [why]
    k = answer.nearest
    if (first := deciding(reason, answer)) != k:
        lines += ["", "deciding pair:", f"  {answer.pair(first).explain()}"]
    if k >= 0:
        lines += ["", "least headroom:", f"  {answer.pair(k).explain()}"]
        lines += terms_of(answer.pair(k), answer)
    pairs = [answer.pair(i) for i in range(answer.near_count) if i != k]
    for title, some in (
        ("nothing is proven for:", [pair for pair in pairs if pair.unproven]),
        ("other near pairs:", [pair for pair in pairs if not pair.unproven]),
    ):
        if some:
            lines += ["", title, *(f"  {pair.why}" for pair in some[:NAMED])]
        if len(some) > NAMED:
            lines.append(f"  and {len(some) - NAMED} more")
    lines += ["", *robot_lines(answer)] if answer.names.robots else []
    if disproved:
        lines.append(f"slower than declared: joint {', '.join(disproved)}")
    return "\n".join(lines)


def terms_of(pair: NearPair, answer: Answer) -> list[str]:
    """Terms of what the nearest pair must keep; none where they are not computed."""
    budget = None if pair.contract else answer.budget
    if budget is None or not abs(budget.needed - pair.needed) <= TOLERANCE:
        return []
    return ["  of which", *(f"  {line}" for line in budget.explain().splitlines())]


def robot_lines(answer: Answer) -> list[str]:
    """One line for each robot: level, speed, age of its measurement, last stop."""
    lines = []
    for name, row in zip(answer.names.robots, answer.robots, strict=True):
        level, cause = Level(int(row["level"])), Reason(int(row["cause"]))
        said = [f"{level.name}, speed {row['scale']:.0%}"]
        if isfinite(row["age"]):
            said.append(f"measured {row['age'] * 1e3:.1f} ms before the cycle")
        if row["delay"] > 0.0:
            said.append(f"drives late by at least {row['delay'] * 1e3:.1f} ms")
        if cause and level >= Level.STOP:
            said.append(f"stopped because {cause.name}")
        if name in answer.unbounded:
            said.append("nothing is proven about its motion, mode fixed")
        lines.append(f"{name}: {', '.join(said)}")
    return lines
