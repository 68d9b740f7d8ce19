"""Balls round primitives, and round groups of what does not move."""

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.shapes import ShapeKind

Floats = NDArray[np.float64]

# Ball, nodes in it with itself, and part or -1, of a node; see `Plan.nodes`.
Node = tuple[Floats, int, int]

# A bound may be wrong by less than this through rounding [m].
SLACK = 1e-9

# Into how many groups the parts of a ball are divided.
GROUPS = 4

# Most parts of a ball that are not divided.
LEAVES = 10


def ball_of(kind: int, row: Floats) -> Floats:
    """Centre and radius of a ball around a primitive, shape (4,) [m]."""
    centre, radius = row[1:4], float(row[0])
    if kind == ShapeKind.CAPSULE:
        centre = (row[1:4] + row[4:7]) / 2.0
        radius += float(np.linalg.norm(row[4:7] - row[1:4])) / 2.0
    elif kind == ShapeKind.TRIANGLE:
        corners = row[1:10].reshape(3, 3)
        centre = corners.mean(axis=0)
        radius += float(np.linalg.norm(corners - centre, axis=1).max())
    elif kind == ShapeKind.BOX:
        radius += float(np.linalg.norm(row[4:7]))
    elif kind in (ShapeKind.CYLINDER, ShapeKind.CONE):
        radius += float(np.hypot(max(row[4], row[6]), row[5]))
    elif kind == ShapeKind.ELLIPSOID:
        radius += float(row[4:7].max())
    elif kind == ShapeKind.HALF_SPACE:
        radius = np.inf
    elif kind != ShapeKind.SPHERE:
        radius += float(row[6])
    return np.array([*centre, radius])


def ball_around(balls: Floats) -> Floats:
    """Centre and radius of a ball around balls, shape (4,) [m]."""
    centre = (balls[:, :3].min(axis=0) + balls[:, :3].max(axis=0)) / 2.0
    reach = np.linalg.norm(balls[:, :3] - centre, axis=1) + balls[:, 3]
    return np.array([*centre, reach.max()])


def tree_of(balls: Floats, members: list[int], largest: float) -> list[Node]:
    """Balls round groups of parts that do not move, each before those in it.

    Args:
        balls: Balls of all parts, shape (t, 4) [m].
        members: Parts to group.
        largest: Members of a group that gets a ball.

    Returns:
        Ball, nodes in it with itself, and part or -1, of each node.
    """
    if len(members) <= LEAVES:
        nodes = [(balls[k], 1, k) for k in members]
        return [round_nodes(balls[members], nodes), *nodes]
    centres = balls[members, :3]
    order = np.argsort(centres[:, np.ptp(centres, axis=0).argmax()], kind="stable")
    named = len(members) <= largest
    halves = np.array_split(np.array(members)[order], 2)
    below = len(members) / GROUPS if named else largest
    nodes = [node for half in halves for node in tree_of(balls, half.tolist(), below)]
    if not named:
        return nodes
    return [round_nodes(balls[members], nodes), *nodes]


def round_nodes(balls: Floats, nodes: list[Node]) -> Node:
    """A node round some others, whose parts have these balls."""
    ball = ball_around(balls) + np.array([0.0, 0.0, 0.0, SLACK])
    return ball, len(nodes) + 1, -1


def trees(
    balls: Floats, members: list[int]
) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """`Plan.nodes` and `Plan.links`."""
    finite = [k for k in members if np.isfinite(balls[k, 3])]
    nodes = [(balls[k], 1, k) for k in members if not np.isfinite(balls[k, 3])]
    if finite:
        nodes += tree_of(balls, finite, len(finite) / GROUPS)
    links = [(at + inside, part) for at, (_, inside, part) in enumerate(nodes)]
    return (
        np.array([ball for ball, _, _ in nodes]).reshape(-1, 4),
        np.array(links, dtype=np.int32).reshape(-1, 2),
    )
