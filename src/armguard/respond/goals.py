"""Where robots are to be led: goals and retreats, checked at the door."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armguard.errors import GoalError, NoRetreatError
from armguard.geometry.pose import Pose, check_transform
from armguard.respond.asked import as_vector
from armguard.respond.lead_state import (
    ALONG,
    BEGUN,
    BEST,
    COUNT,
    GOAL,
    HEAD,
    IDLE,
    IN_MINIMUM,
    JOINTS_GOAL,
    KEEP,
    LET_GO,
    NO_GOAL,
    PULL,
    STANDS,
    STAYS,
    STRAIGHT,
    SUSPENDED,
    THEN_SAFE,
    TOOL_BODY,
    TOOL_GOAL,
    TRAIL,
    WAY,
    Lead,
)
from armguard.respond.tool import Tool
from armguard.scene.tables import RobotPart, SceneTables

if TYPE_CHECKING:
    from armguard.respond.guard import Guard

Floats = NDArray[np.float64]

# Places of the way that led in from which a straight way is looked for, at most.
LOOKS = 16


def set_goal(
    r: int,
    tool: Tool,
    q: ArrayLike | None,
    pose: Pose | ArrayLike | None,
    lead: Lead,
) -> None:
    """Set or forget the goal of a robot's field.

    Args:
        r: The robot.
        tool: The tool a pose is for.
        q: Joint positions of the robot, shape (k,) [rad or m].
        pose: Pose of the tool in the world.
        lead: Written.

    Raises:
        GoalError: See `Guard.field_goal`.
        PoseError: See `Guard.field_goal`.
    """
    part = tool.tables.robots[r]
    if part.response.kind != "field":
        raise GoalError(
            f"robot '{part.name}' has the response '{part.response.kind}', which goes "
            "nowhere by itself; a goal needs 'field'"
        )
    if q is not None and pose is not None:
        raise GoalError(f"robot '{part.name}' was given q and a pose; give one of them")
    kind = NO_GOAL
    if q is not None:
        lead.aim[tool.own] = positions_of(part, q, tool.tables)
        kind = JOINTS_GOAL
    elif pose is not None:
        T = pose.matrix() if isinstance(pose, Pose) else check_transform("pose", pose)
        # The body is turned, which the link may be turned in.
        aim = np.column_stack([T[:3, :3] @ tool.R_body.T, T[:3, 3]])
        lead.tool_aim[r] = np.concatenate([aim.ravel(), tool.p_body])
        lead.notes[r, TOOL_BODY] = tool.body
        kind = TOOL_GOAL
    lead.notes[r, GOAL] = kind
    begin_anew(r, lead)


def begin_anew(r: int, lead: Lead) -> None:
    """Let a robot's field lead again, from standstill."""
    lead.notes[r, [SUSPENDED, IN_MINIMUM]] = 0
    lead.memory[r, [PULL, IDLE, STANDS]] = 0.0
    lead.memory[r, BEST] = np.inf


def engage_lead(r: int, lead: Lead) -> None:
    """Let a robot's field go on, and end its retreat."""
    if lead.notes[r, WAY] != STAYS or lead.notes[r, [SUSPENDED, IN_MINIMUM]].any():
        lead.notes[r, WAY] = STAYS
        begin_anew(r, lead)


def positions_of(part: RobotPart, q: ArrayLike, tables: SceneTables) -> Floats:
    """Joint positions a robot can be at, shape (k,).

    Raises:
        GoalError: They are none.
    """
    found, fault = as_vector(f"robot '{part.name}': q", q, part.joint_count)
    if found is None:
        raise GoalError(fault)
    own = slice(part.first_joint, part.first_joint + part.joint_count)
    for name, place, lower, upper in zip(
        part.joints, found, tables.lower[own], tables.upper[own], strict=True
    ):
        if not lower <= place <= upper:
            raise GoalError(
                f"joint '{part.name}/{name}' is to go to {place:.4f}; its limits are "
                f"[{lower:.4f}, {upper:.4f}]"
            )
    return found


def find_retreat(guard: "Guard", name: str | None, to: object, lead: Lead) -> None:
    """Set out the way back of a robot, or of all; see `Guard.retreat`.

    Raises:
        GoalError: See `Guard.retreat`.
        NoRetreatError: See `Guard.retreat`.
    """
    parts = guard.tables.robots
    chosen = [r for r, part in enumerate(parts) if name in (None, part.name)]
    if isinstance(to, str):
        if to != "path":
            raise GoalError(
                f"a retreat leads to '{to}'; it must be 'path' or positions"
            )
        for r in chosen:
            if lead.notes[r, COUNT] == 0:
                raise NoRetreatError(
                    f"nothing is known of the way that led robot '{parts[r].name}' in; "
                    "give the positions it is to retreat to"
                )
        for r in chosen:
            set_out(r, 0, False, lead)
        return
    if len(chosen) != 1:
        raise GoalError("positions are those of one robot; name it")
    r = chosen[0]
    safe = positions_of(parts[r], to, guard.tables)  # type: ignore[arg-type]
    keep = places_to_keep(guard, r, safe, lead)
    own = slice(parts[r].first_joint, parts[r].first_joint + parts[r].joint_count)
    lead.safe[own] = safe
    set_out(r, keep, True, lead)


def set_out(r: int, keep: int, then_safe: bool, lead: Lead) -> None:
    """Begin a retreat with the next cycle in which the robot is not being stopped."""
    notes = lead.notes[r]
    straight = then_safe and keep >= notes[COUNT]
    notes[WAY] = STRAIGHT if straight else ALONG
    notes[KEEP], notes[THEN_SAFE] = keep, then_safe
    notes[BEGUN] = notes[LET_GO] = 0


def places_to_keep(guard: "Guard", r: int, safe: Floats, lead: Lead) -> int:
    """Places of the way that led in beyond which a robot need not go back.

    From the last of them a straight way leads to the positions; if they are all that
    are known, it does so from where the robot is.

    Raises:
        NoRetreatError: From none of them.
    """
    part = guard.tables.robots[r]
    own = slice(part.first_joint, part.first_joint + part.joint_count)
    watch = guard._watch
    if not watch.sample_count.all():
        raise NoRetreatError("where the robots are is not known before the first cycle")
    here = watch.sample_q[:, 0].copy()
    there = here.copy()
    there[own] = safe
    first = guard.check_path([here, there])
    count = int(lead.notes[r, COUNT])
    if first.clear:
        return count
    looks = min(LOOKS, count)
    for k in range(looks):
        back = (k + 1) * count // looks - 1
        row = (lead.notes[r, HEAD] - 1 - back) % TRAIL
        here[own] = lead.trail[row, own]
        if guard.check_path([here, there]).clear:
            return count - 1 - back
    raise NoRetreatError(
        f"no free way leads robot '{part.name}' to these positions, neither from where "
        f"it is nor from {looks} places of the way that led in; {first.sentence}"
    )
