"""The reason of a verdict in one sentence, with names and numbers."""

from collections.abc import Sequence
from math import isfinite

from armguard.guard import layout
from armguard.guard.answer import Answer
from armguard.guard.levels import OF_OBJECTS, ORDERED, Reason
from armguard.guard.pace import clock_sentence, late_sentence

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
    Reason.CYCLE_LATE,
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


def sentence_of(reason: Reason, answer: Answer, disproved: Sequence[str]) -> str:
    """Reason of the level in one sentence.

    Args:
        reason: The reason.
        answer: The answer of the cycle.
        disproved: Joints that have not stopped as declared.
    """
    if reason in ABOUT_PAIRS and answer.nearest >= 0:
        return pair_sentence(reason, answer)
    if answer.data[layout.JOINT] >= 0.0:
        return joint_sentence(reason, answer)
    return input_sentence(reason, answer, subject_of(reason, answer, disproved))


def subject_of(reason: Reason, answer: Answer, disproved: Sequence[str]) -> str:
    """Name of the joint, object or robot of a fault; "" if it concerns all, or none."""
    names = answer.names
    joint, r = int(answer.data[layout.JOINT]), int(answer.data[layout.ROBOT])
    if joint >= 0:
        return names.tables.q_names[joint]
    if reason in LAGS and disproved:
        return disproved[0]
    if reason in OF_OBJECTS:
        return names.tables.body_names[int(answer.data[layout.VALUE])]
    known = 0 <= r < len(names.robots)
    return names.robots[r] if known and reason not in OF_ALL else ""


def pair_sentence(reason: Reason, answer: Answer) -> str:
    """Sentence of a reason that the nearest pair explains."""
    nearest = answer.pair(answer.nearest)
    if reason is Reason.UNPROVEN:
        near = (answer.pair(k) for k in range(len(answer.near)))
        pairs = tuple(pair for pair in near if pair.unproven) or (nearest,)
        distances = "; ".join(pair.distance_sentence for pair in pairs)
        return f"{reason.sentence}: {distances}"
    budget, sentence = answer.budget, nearest.why
    if budget is not None and not nearest.contract:
        sentence = f"{nearest.distance_sentence}, {budget.sentence}"
    robots = answer.names.robots
    sides = [robots[r] for r in answer.robots_of(answer.nearest) if r >= 0 and robots]
    for name in answer.unbounded:
        if name in sides:
            sentence += f"; nothing is proven about the motion of '{name}', mode fixed"
    if reason in (Reason.NEAR, Reason.TOO_CLOSE):
        return sentence
    return f"{reason.sentence}: {sentence}"


def input_sentence(reason: Reason, answer: Answer, subject: str) -> str:
    """Sentence of a reason about a robot, an object or the cycle."""
    sentence, value = reason.sentence, float(answer.data[layout.VALUE])
    about = f"'{subject}': " if subject else ""
    tables = answer.names.tables
    if reason is Reason.CYCLE_LATE and isfinite(value):
        return late_sentence(value, tables.period, tables.late)
    if reason in IN_MILLISECONDS:
        return f"{about}{sentence} ({value * 1e3:.1f} ms){clock_sentence(value)}"
    return about + sentence


def joint_sentence(reason: Reason, answer: Answer) -> str:
    """Sentence of a reason about a joint."""
    k, value = int(answer.data[layout.JOINT]), float(answer.data[layout.VALUE])
    names, sentence = answer.names, reason.sentence
    joint = f"joint '{names.tables.q_names[k]}'"
    if reason in AT_SPEED:
        return f"{joint} at {value:.2f} a second: {sentence}"
    if reason is Reason.DRIVE_LAGS:
        return f"{joint}: {sentence}, at least {value * 1e3:.1f} ms"
    if reason is Reason.STATE_FROZEN:
        return f"{joint}: {sentence} ({value:.4f})"
    if reason is Reason.STAMP_REPEATED:
        return f"{joint}: {sentence} ({value:.6f} s)"
    if reason is Reason.NOT_FINITE:
        return f"{joint} is at {value}; it must be finite"
    return (
        f"{joint} is at {value:.4f}; its limits are "
        f"[{names.tables.lower[k]:.4f}, {names.tables.upper[k]:.4f}]"
    )
