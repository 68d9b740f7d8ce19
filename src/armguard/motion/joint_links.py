"""Links of a scene for its joint-space table: chains, cells' joints and parts.

A link with more joints than the table divides is described in one of two ways: by its
primitives, with the further joints anywhere within their limits, or by a ball that
contains the link at all positions of these joints.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import pi, sin
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.shapes import ROW_WIDTH, ShapeKind
from armguard.index.joint_bounds import MOST_JOINTS, JointLinks
from armguard.index.joint_cells import FARTHEST
from armguard.motion.chains import Anchor, Chains, anchor, chains, strokes
from armguard.motion.outermost import true_limits
from armguard.robot.kinematics import FIXED, PRISMATIC
from armguard.scene.tables import SceneTables

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

# How far beyond its limit a joint that rests there may be measured [rad or m].
BEYOND = 0.01


@dataclass(frozen=True, slots=True)
class Part:
    """A primitive of a link, or the ball around it.

    Attributes:
        kind: Its kind.
        row: Its row in the frame of the last body of the link's path.
        capsule: Capsule around it, in that frame.
    """

    kind: int
    row: Floats
    capsule: Anchor


@dataclass(frozen=True, slots=True)
class TabledLink:
    """A link, as a joint-space table knows it.

    Attributes:
        body: Its body.
        path: Bodies from the root to the one that carries the parts.
        joints: Places in q: those of the path, then other joints with a part in the
            link's reach.
        parts: Its primitives, or one ball.
    """

    body: int
    path: list[int]
    joints: list[int]
    parts: list[Part]


def joint_links(tables: SceneTables) -> JointLinks:
    """Links of a scene's robots.

    Args:
        tables: The scene.
    """
    found = chains(tables)
    limits = true_limits(tables)
    lower, upper = limits[0] - BEYOND, limits[1] + BEYOND
    robots = np.asarray(tables.robot_of_primitive)
    bodies = tables.bodies[: tables.moving_count][robots >= 0]
    links = [
        tabled_link(int(body), tables, found, lower, upper)
        for body in np.unique(bodies)
    ]
    link_of = np.full(len(tables.kinds), -1, dtype=np.int32)
    for number, link in enumerate(links):
        own = (tables.bodies[: len(robots)] == link.body) & (robots >= 0)
        link_of[np.flatnonzero(own)] = number
    parts = [part for link in links for part in link.parts]
    return JointLinks(
        link_of=link_of,
        **joint_fields(links, tables, found, lower, upper),
        **chain_fields(links, tables),
        first_part=ends_of([len(link.parts) for link in links]),
        kinds=np.array([part.kind for part in parts], dtype=np.int32),
        rows=np.array([part.row for part in parts]).reshape(-1, ROW_WIDTH),
        ends=np.array([[*p.capsule.start, *p.capsule.end] for p in parts]).reshape(
            -1, 6
        ),
        radii=np.array([part.capsule.radius for part in parts]),
    )


def fixed_primitives(tables: SceneTables) -> Ints:
    """Primitives with a bit in a joint-space table: static ones that never move."""
    static = np.arange(tables.moving_count, tables.modelled, dtype=np.int32)
    if not len(tables.top_speeds):
        return static
    return static[np.asarray(tables.top_speeds)[static] <= 0.0]


def tabled_link(
    body: int, tables: SceneTables, found: Chains, lower: Floats, upper: Floats
) -> TabledLink:
    """A link with its primitives, or with the ball around them if that is tighter."""
    chain = found.joints[body, : found.length[body]].tolist()
    places = distinct(tables.q_index[chain])
    divided = places[:MOST_JOINTS]
    own = np.flatnonzero(tables.bodies[: tables.moving_count] == body)
    exact = [
        Part(kind, row, anchor(kind, row))
        for kind, row in zip(
            tables.kinds[own].tolist(), tables.local_rows[own], strict=True
        )
    ]
    cut = next(
        (k for k, b in enumerate(chain) if tables.q_index[b] not in divided), len(chain)
    )
    tail = chain[cut:]
    if not tail:
        return TabledLink(body, path_to(body, tables), places, exact)
    half = 0.5 * (upper - lower)[tables.q_index[tail]] * np.abs(tables.gain[tail, 0])
    chords = [
        way if tables.joint_kind[b] == PRISMATIC else 2.0 * sin(0.5 * min(way, pi))
        for b, way in zip(tail, half.tolist(), strict=True)
    ]
    swept = float((found.levers[own, cut : len(chain)] @ chords).max())
    stroke = strokes(tail, tables.joint_kind, tables.gain, tables.q_index, lower, upper)
    radius = max(reach_beyond(p.capsule, tail, tables, stroke) for p in exact)
    if not radius < swept:
        return TabledLink(body, path_to(body, tables), places, exact)
    row = np.zeros(ROW_WIDTH)
    row[0], row[1:4] = radius, tables.T_parent_joint[tail[0], [3, 7, 11]]
    ball = Part(int(ShapeKind.SPHERE), row, anchor(int(ShapeKind.SPHERE), row))
    path = path_to(int(tables.parent[tail[0]]), tables)
    sliding = [b for b in tail if tables.joint_kind[b] == PRISMATIC]
    joints = distinct(tables.q_index[[*chain[:cut], *sliding]])
    return TabledLink(body, path, joints, [ball])


def distinct(places: Ints) -> list[int]:
    """Numbers in the order in which each occurs first."""
    return list(dict.fromkeys(places.tolist()))


def path_to(body: int, tables: SceneTables) -> list[int]:
    """Bodies from the root to a body."""
    path = [body]
    while tables.parent[path[0]] >= 0:
        path.insert(0, int(tables.parent[path[0]]))
    return path


def reach_beyond(
    capsule: Anchor, tail: Sequence[int], tables: SceneTables, stroke: Sequence[float]
) -> float:
    """Greatest distance of a capsule's points from the frame of a chain's first joint.

    The further joints may be anywhere within their limits.

    Args:
        capsule: Capsule in the frame of the chain's last body.
        tail: Bodies of the chain.
        tables: The scene.
        stroke: Greatest shift by each of their joints [m].
    """
    ends = np.array([capsule.start, capsule.end])
    reach = float(np.linalg.norm(ends, axis=1).max()) + capsule.radius + sum(stroke)
    for body in tail[1:]:
        reach += float(np.linalg.norm(tables.T_parent_joint[body, [3, 7, 11]]))
    return reach


def joint_fields(
    links: Sequence[TabledLink],
    tables: SceneTables,
    found: Chains,
    lower: Floats,
    upper: Floats,
) -> dict[str, NDArray[Any]]:
    """Fields of `JointLinks` from `joints` to `levers`, by name."""
    width = max(max((len(link.joints) for link in links), default=0), 1)
    shape = len(links), width
    joints = np.full(shape, -1, dtype=np.int32)
    fields = {name: np.zeros(shape) for name in ("lower", "upper", "period", "levers")}
    for number, link in enumerate(links):
        own = np.flatnonzero(tables.bodies[: tables.moving_count] == link.body)
        joints[number, : len(link.joints)] = link.joints
        for s, place in enumerate(link.joints):
            gains = tables.gain[tables.q_index == place, 0]
            whole = bool((gains == np.round(gains)).all())
            ends, period = (float(lower[place]), float(upper[place])), 0.0
            if not np.isfinite(ends).all():
                ends = (-pi, pi) if whole else (-FARTHEST, FARTHEST)
                period = 2.0 * pi if whole else 0.0
            chain = found.joints[link.body, : found.length[link.body]]
            moved = np.flatnonzero(tables.q_index[chain] == place)
            ways = np.abs(tables.gain[chain[moved], 0])
            lever = float((found.levers[own][:, moved] @ ways).max(initial=0.0))
            # What may be anywhere is not worth a cell.
            bounded = np.isfinite(lever) and ends[1] < FARTHEST
            fields["lower"][number, s], fields["upper"][number, s] = ends
            fields["period"][number, s] = period
            fields["levers"][number, s] = lever if bounded else 0.0
    return {"joints": joints, **fields}


def chain_fields(
    links: Sequence[TabledLink], tables: SceneTables
) -> dict[str, NDArray[Any]]:
    """Fields of `JointLinks` from `first_body` to `axis`, by name."""
    bodies = [body for link in links for body in link.path]
    slot = [
        link.joints.index(int(tables.q_index[b]))
        if tables.joint_kind[b] != FIXED
        else -1
        for link in links
        for b in link.path
    ]
    parent = [k - 1 for link in links for k in range(len(link.path))]
    return {
        "first_body": ends_of([len(link.path) for link in links]),
        "parent": np.array(parent, dtype=np.int32),
        "joint_kind": tables.joint_kind[bodies],
        "slot": np.array(slot, dtype=np.int32),
        "gain": tables.gain[bodies],
        "T_parent_joint": tables.T_parent_joint[bodies],
        "axis": tables.axis[bodies],
    }


def ends_of(counts: Sequence[int]) -> Ints:
    """Where each of some groups begins in their sequence, and its end, (k + 1,)."""
    return np.cumsum([0, *counts]).astype(np.int32)
