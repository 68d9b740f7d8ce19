"""A desk for a scene."""

import numpy as np
from numpy.typing import NDArray

from armguard.guard.answer import answer_of
from armguard.guard.levels import Level, Reason
from armguard.record import records
from armguard.respond.state import MOST_TWISTS, TOOL_POINT, TOOL_TWIST, TWIST_ROW
from armguard.respond.tool import tool_of
from armguard.scene.tables import SceneTables
from armguard.service.desk.desk import Arrival, Cycle, Desk, ToolTwist

Floats = NDArray[np.float64]


def desk_of(
    tables: SceneTables, tools: tuple[str, ...], message: Floats, answer: Floats
) -> Desk:
    """A desk for a scene, before any state has come in.

    Args:
        tables: The scene.
        tools: Names of tools in the order of their indices in messages.
        message: Where messages come in.
        answer: Where they go out.
    """
    n, r = len(tables.q_names), len(tables.robots)
    rows = np.zeros((max(len(tools), 1), TOOL_TWIST))
    for row, name in zip(rows, tools, strict=False):
        tool = tool_of(tables, name)
        row[:TOOL_POINT] = tool.robot, tool.body
        row[TOOL_POINT:] = tool.p_body
    names = bodies_of(tables)
    place = {name: k for k, name in enumerate(names)}
    levels = np.full(max(Reason) + 1, int(Level.STOP), dtype=np.int64)
    for reason in Reason:
        levels[reason] = reason.level
    return Desk(
        arrival=records((), Arrival),
        cycle=records((), Cycle),
        message=message,
        answer=answer,
        q=np.full(n, np.nan),
        velocity=np.zeros(n),
        stamps=np.full(r, np.nan),
        measured=np.zeros(r, dtype=np.int64),
        sender=np.zeros(r, dtype=np.int64),
        sequence=np.zeros(r, dtype=np.int64),
        heard=np.zeros(r, dtype=np.int64),
        first_joint=np.array([p.first_joint for p in tables.robots], dtype=np.int64),
        joint_count=np.array([p.joint_count for p in tables.robots], dtype=np.int64),
        desired=np.zeros(n),
        twists=records(MOST_TWISTS, ToolTwist),
        tools=rows,
        rows=np.zeros(MOST_TWISTS * TWIST_ROW),
        held=np.full(n, np.nan),
        asked=np.zeros(max(n, 6 * MOST_TWISTS)),
        **answer_of(tables),
        command=np.zeros(4 * n + 4 * r),
        body_of=np.array([place[b] for b in tables.body_names], dtype=np.int64),
        level_of=levels,
    )


def bodies_of(tables: SceneTables) -> tuple[str, ...]:
    """Names of bodies in the order of their indices in a COMMAND."""
    return tuple(dict.fromkeys(tables.body_names))
