"""In words, what two answers of one cycle differ in."""

import numpy as np
from numpy.typing import NDArray

from armguard.guard import layout
from armguard.guard.levels import Reason
from armguard.guard.verdict import Verdict, first_row_of
from armguard.respond import Guard
from armguard.station.frames import Frame

Floats = NDArray[np.float64]

# What the numbers of a command are, `n` of each; then `r` of each.
OF_JOINTS = ("velocity", "position", "asked velocity", "way to the asked position")
OF_ROBOTS = (
    "why it is blocked",
    "phase",
    "since when it is held",
    "why it is told something else",
)


def difference(frame: Frame, verdict: Verdict, told: Floats, guard: Guard) -> str:
    """The most telling difference between what was recorded and what came now.

    Args:
        frame: The cycle as it was recorded.
        verdict: What the guard says now.
        told: What it tells the robots now.
        guard: The guard.
    """
    was, now = frame.verdict, verdict.numbers
    if was[layout.REASON] != now[layout.REASON]:
        then = Reason(int(was[layout.REASON]))
        return f"it was {then.name} and is {verdict.reason.name} ({verdict.why})"
    n, names = len(guard.q_names), guard.q_names
    for k in np.flatnonzero(different(frame.told, told)).tolist():
        if k < 4 * n:
            what = f"{OF_JOINTS[k // n]} of {names[k % n]}"
        else:
            robots = [part.name for part in guard.tables.robots]
            kind, robot = divmod(k - 4 * n, len(robots))
            what = f"{OF_ROBOTS[kind]} of {robots[robot]}"
        return f"{what} was {frame.told[k]!r} and is {told[k]!r}"
    if len(frame.told) != len(told):
        return f"{len(frame.told)} numbers were told and are {len(told)}"
    ends = min(len(was), len(now), first_row_of(guard.tables))
    places = {
        value: name.lower().replace("_", " ")
        for name, value in vars(layout).items()
        if name.isupper() and name != "LAYOUT" and value < layout.TERMS
    }
    for k in np.flatnonzero(different(was[:ends], now[:ends])).tolist():
        if not frame.poses.size and k in (layout.NEAR_COUNT, layout.NEAREST):
            # Recorded without its other pairs.
            continue
        what = places.get(k, f"number {k} of the verdict")
        return f"{what} was {was[k]!r} and is {now[k]!r}"
    return "a near pair that is not the nearest, which the recording does not hold"


def different(a: Floats, b: Floats) -> NDArray[np.bool_]:
    """Where two vectors differ in a bit, as far as both go."""
    k = min(len(a), len(b))
    return np.asarray(
        np.ascontiguousarray(a[:k]).view(np.int64)
        != np.ascontiguousarray(b[:k]).view(np.int64)
    )
