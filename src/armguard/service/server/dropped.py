"""What is wrong with a dropped message: values, places and the remedy, in words."""

import numpy as np

from armguard.recording.counters import DROPS
from armguard.scene.tables import SceneTables
from armguard.service.wire import Form, Kind
from armguard.service.wire.layout import (
    HAS_VELOCITY,
    HAS_WISH,
    HEADER,
    SEAL,
    STATE,
    TWIST,
    WISH,
)

# Where the payload of a message begins [bytes].
PAYLOAD = HEADER.size

# Causes that the content of a message explains.
EXPLAINED = ("robots", "joints", "wish_not_finite")


def sentence_of_drop(
    cause: str, kind: int, message: memoryview, tables: SceneTables
) -> str:
    """A cause of `DROPS` in words, with the values of the message that it is about.

    Args:
        cause: The cause.
        kind: Kind of the message.
        message: The message, let in as far as its kind.
        tables: The scene.
    """
    detail = ""
    if cause in EXPLAINED and kind == Kind.STATE:
        detail = detail_of_state(message, tables)
    elif cause in EXPLAINED and kind == Kind.WISH:
        detail = detail_of_desired_motion(message, PAYLOAD, tables)
    return f"{DROPS[cause]}{detail and f' ({detail})'}"


def detail_of_state(message: memoryview, tables: SceneTables) -> str:
    """Robots or numbers of a STATE that the scene does not have."""
    if len(message) < PAYLOAD + STATE.size + SEAL:
        return ""
    state = STATE.unpack_from(message, PAYLOAD)
    robots = len(tables.robots)
    if not 0 < state.robots < 1 << robots:
        return f"it has the bits {state.robots:#x}, the scene has {robots} robots"
    joints = sum(
        part.joint_count
        for k, part in enumerate(tables.robots)
        if state.robots >> k & 1
    )
    both = 2 if state.flags & HAS_VELOCITY else 1
    at = PAYLOAD + STATE.size
    if state.flags & HAS_WISH:
        return detail_of_desired_motion(message, at + 8 * both * joints, tables)
    found = (len(message) - SEAL - at) // 8
    parts = "positions and velocities" if both == 2 else "positions"
    return f"{found} numbers, and {both * joints} {parts} of its robots are needed"


def detail_of_desired_motion(
    message: memoryview, start: int, tables: SceneTables
) -> str:
    """Numbers of a desired motion that do not fit the scene or are not finite."""
    if len(message) < start + WISH.size + SEAL:
        return "too few numbers before the desired motion"
    head = WISH.unpack_from(message, start)
    numbers = np.frombuffer(message[start + WISH.size : -SEAL])
    names = tables.q_names
    if head.form == Form.TWISTS:
        names = tuple(f"tool {k:g}" for k in numbers[::TWIST] for _ in range(TWIST))
    elif len(numbers) != len(names):
        return f"{len(numbers)} numbers, the scene has {len(names)} joints"
    wrong = np.flatnonzero(~np.isfinite(numbers))
    if not len(wrong):
        return f"{len(numbers)} numbers, seven a twist with the index of its tool first"
    k = int(wrong[0])
    return f"number {k + 1}, of '{names[k]}', is {numbers[k]}"
