"""Responses of a robot to near bodies, one row and one kernel each."""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from armguard.guard.workspace import Workspace
from armguard.kernel import kernel
from armguard.record import records
from armguard.respond.finger_pace import slow_fingers
from armguard.respond.program import breaks_rows, scale_back
from armguard.respond.state import Behaviour, Response
from armguard.scene.settings import CHOICES, ResponseName
from armguard.scene.tables import SceneTables

# Changes the target of a robot, given with responses and workspace; returns whether the
# robot's quadratic program is to be solved.
Change = Callable[[int, Response, Workspace], bool]


@kernel
def go_on(r: int, a: Response, w: Workspace) -> bool:
    """Leave the target as it is: without a proof of it the robot stops."""
    return False


@kernel
def slow_down(r: int, a: Response, w: Workspace) -> bool:
    """Scale the target down until it satisfies the rows.

    A touching pair has to open even if the robot leaves its path for that.
    """
    slow_fingers(r, a, w, w.motion)
    scale_back(r, a, w.motion)
    return a.notes[r].overflows == 0 and breaks_rows(r, a.limits, a, w.motion)


@kernel
def solve_program(r: int, a: Response, w: Workspace) -> bool:
    """Leave the choice of a target to the quadratic program."""
    return True


class ResponseKind(NamedTuple):
    """Properties of a response to near bodies.

    A response changes the requested motion before the proof. It cannot make an unsafe
    motion safe: the proof reduces or stops any motion that is still unsafe.

    Attributes:
        words: What the robot does, in words.
        change: Kernel that changes the target of a robot that violates its rows.
        stops: Whether an unproven request ends in a stop, not in a slower motion.
        scales: Whether it keeps its path at a lower speed.
        solves: Whether a quadratic program finds the nearest velocity that satisfies
            all constraints.
    """

    words: str
    change: Change
    stops: bool = False
    scales: bool = False
    solves: bool = False


RESPONSES: Mapping[ResponseName, ResponseKind] = {
    "stop": ResponseKind("moves as requested, or stops", go_on, stops=True),
    "slow": ResponseKind("slows down on its path", slow_down, scales=True),
    "deflect": ResponseKind(
        "takes the nearest safe direction", solve_program, solves=True
    ),
    "field": ResponseKind(
        "is attracted by a goal and repelled by near bodies", solve_program, solves=True
    ),
}


def change_from(kind: int) -> Change:
    """Kernel that calls that of a robot's response, if it is in this row or below."""
    if kind == len(RESPONSES):
        return go_on
    name, change = list(RESPONSES)[kind], list(RESPONSES.values())[kind].change
    others = change_from(kind + 1)

    def choose(r: int, a: Response, w: Workspace) -> bool:
        if a.settings[r].kind == kind:
            return change(r, a, w)
        return others(r, a, w)

    # Code in object files is linked by its name.
    choose.__qualname__ = f"choose_{name}"
    return kernel(choose)


change_first = change_from(0)


@kernel
def change_target(r: int, a: Response, w: Workspace) -> bool:
    """Change the target of a robot that violates its rows, as its response does.

    Returns:
        Whether its quadratic program is to be solved.
    """
    return change_first(r, a, w)


def behaviours(tables: SceneTables) -> Any:
    """`Behaviour` of each robot, shape (r,)."""
    rows = records(len(tables.robots), Behaviour)
    for row, part in zip(rows, tables.robots, strict=True):
        chosen = part.response
        for name in rows.dtype.names:
            if name == "kind":
                row[name] = list(RESPONSES).index(chosen.kind)
            elif hasattr(chosen, name):
                value = getattr(chosen, name)
                row[name] = CHOICES[name].index(value) if name in CHOICES else value
            else:
                row[name] = getattr(RESPONSES[chosen.kind], name)
        if not chosen.evade:
            row["evade_time"] = 0.0
    return rows
