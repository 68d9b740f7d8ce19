"""What a robot does about what is near: one table, that scenes and tests read.

A response changes what is asked for before it is proven. It cannot make anything safe
that is not, and what it leaves unsafe is taken back or stopped by the proof.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armguard.respond.program import ROW_COUNT, scale_back
from armguard.respond.programs import Programs
from armguard.respond.solver import nearest_velocity
from armguard.scene.settings import ResponseName

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Response:
    """A way to answer what is near.

    Attributes:
        words: What it does, for people.
        change: Changes one robot's part of the target; False if it found no way.
        gives_way: Whether what cannot be proven is taken back before the robot is
            stopped for it.
    """

    words: str
    change: Callable[[Programs, int], bool]
    gives_way: bool


def as_asked(programs: Programs, r: int) -> bool:
    """Change nothing: what cannot be proven ends in a stop."""
    return True


def slow(programs: Programs, r: int) -> bool:
    """Keep the direction, take the speed back as far as the rows ask for."""
    p = programs
    scale_back(r, p.target, p.brake, p.rows, p.limits, p.found, p.lines)
    return True


def deflect(programs: Programs, r: int) -> bool:
    """Take the nearest velocity that keeps the rows."""
    p = programs
    own, count = p.parts[r], p.found[r, ROW_COUNT]
    rows = p.rows_of(r)[:count, own]
    found = nearest_velocity(
        p.target[own],
        p.low[own],
        p.high[own],
        np.ascontiguousarray(rows),
        p.limits_of(r)[:count],
    )
    if found is None:
        return False
    p.target[own] = found
    return True


RESPONSES: Mapping[ResponseName, Response] = {
    "stop": Response("stops where it may not go on", as_asked, gives_way=False),
    "slow": Response("slows down on its own way", slow, gives_way=True),
    "deflect": Response("takes the nearest safe way", deflect, gives_way=True),
}
