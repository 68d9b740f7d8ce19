"""Objects of a plan that are placed and removed."""

import numpy as np
from numpy.typing import NDArray

from armguard.batch.balls import SLACK, ball_around, ball_of
from armguard.batch.plan import Plan
from armguard.scene.standing import Standing

Floats = NDArray[np.float64]


def place_object(plan: Plan, item: Standing, T: Floats) -> None:
    """Place an object with its frame at T, shape (4, 4), whether present or not."""
    place_rows(plan, item, item.rows(np.eye(4) if item.body >= 0 else T), T[:3])


def place_rows(plan: Plan, item: Standing, rows: Floats, frame: Floats) -> None:
    """Place the primitives of an object, whether present or not.

    Args:
        plan: The plan.
        item: The object.
        rows: Rows of its primitives, in the frame of its body if it has one, shape
            (count, 16).
        frame: Frame of its body; not read if it has none, shape (3, 4) or (12,).
    """
    if item.body >= 0:
        plan.frames[item.body] = frame.reshape(12)
    for i, row in zip(range(item.first, item.first + item.count), rows, strict=True):
        plan.rows[i] = row
        if plan.ball[i] != i:
            ball = ball_of(plan.kinds[i], row)
            plan.rows[plan.ball[i], :4] = ball[3], *ball[:3]
    for part in parts_of(plan, item):
        first, end, ball = plan.parts[part, :3]
        if end > first + 1:
            inner = plan.rows[plan.ball[first:end]]
            around = ball_around(inner[:, [1, 2, 3, 0]])
            plan.rows[ball, :4] = around[3], *around[:3]
        refit(plan, part)
    plan.room[:] = 0


def remove_object(plan: Plan, item: Standing) -> None:
    """Remove an object: nothing is near a ball whose radius is minus infinity."""
    for part in parts_of(plan, item):
        plan.rows[plan.parts[part, 2], 0] = -np.inf
        refit(plan, part)
    plan.room[:] = 0


def parts_of(plan: Plan, item: Standing) -> list[int]:
    """Parts of an object."""
    return sorted(set(plan.part[item.places].tolist()) - {-1})


def refit(plan: Plan, part: int) -> None:
    """Fit the balls round a part that does not move to the part's own ball."""
    found = np.flatnonzero(plan.links[:, 1] == part)
    if part < len(plan.loose) or not len(found):
        return
    leaf, ball = int(found[0]), plan.rows[plan.parts[part, 2]]
    plan.nodes[leaf] = *ball[1:4], ball[0]
    above = np.flatnonzero(plan.links[:leaf, 0] > leaf)
    for node in above[::-1].tolist():
        inside, at = [], node + 1
        while at < plan.links[node, 0]:
            inside.append(at)
            at = int(plan.links[at, 0])
        balls = plan.nodes[inside]
        balls = balls[balls[:, 3] > -np.inf]
        plan.nodes[node] = 0.0, 0.0, 0.0, -np.inf
        if len(balls):
            plan.nodes[node] = ball_around(balls)
            plan.nodes[node, 3] += SLACK
