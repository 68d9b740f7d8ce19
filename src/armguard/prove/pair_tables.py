"""Two links of one robot as flat tables: the joints between them, and their shapes."""

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import pi
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.shapes import (
    ROW_WIDTH,
    PlacedShape,
    Shape,
    ShapeKind,
    shape_row,
)
from armguard.lanes import WIDTH
from armguard.motion.chains import anchor
from armguard.motion.joint_rows import JointRow
from armguard.prove.box_bound import HOLD_POINTS, BoxBounds, LinkPair, bound_boxes
from armguard.record import dtype_of, records
from armguard.robot.kinematics import FIXED, KinematicTable
from armguard.robot.limits import joint_limits
from armguard.robot.model import FittedLink, RobotModel
from armguard.table import Ledger

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

# A mimic joint that follows an unlimited one comes round after a whole number of turns
# of it if its multiplier is a fraction with a denominator up to this [-].
MOST_TURNS = 64


@dataclass(frozen=True, slots=True)
class SideShapes:
    """A link, described in one way or several.

    Attributes:
        link: Its name.
        unions: Unions of shapes that hold it, or its surface; the exact one first.
    """

    link: str
    unions: tuple[tuple[PlacedShape, ...], ...]

    @classmethod
    def of(cls, fit: FittedLink) -> "SideShapes":
        """By its exact shapes, and by its primitives if these are others."""
        return cls(fit.link, (fit.exact, fit.shapes) if fit.exact else (fit.shapes,))

    def joined(self, union: tuple[PlacedShape, ...]) -> "SideShapes":
        """The same, described in one more way unless that is empty."""
        return SideShapes(self.link, (*self.unions, union) if union else self.unions)


@dataclass(frozen=True, slots=True, kw_only=True)
class PairTables:
    """Two links of one robot, in the frame of the body that carries both.

    Attributes:
        joints: Joints that move the two against each other, length n.
        lower: Their least positions, shape (n,) [rad or m].
        upper: Their greatest positions; of a joint without limits a turn, shape (n,).
        kinematics: Fields of `LinkPair` from `parent` to `lengths`.
        surfaces: Its fields from `kinds` to `models`.
        shapes: The shapes, whose numbers the rows lead to.
    """

    joints: tuple[str, ...]
    lower: Floats
    upper: Floats
    kinematics: dict[str, NDArray[Any]]
    surfaces: dict[str, NDArray[Any]]
    shapes: tuple[Shape, ...]

    def bounds(self, centres: Floats, halves: Floats, *, full: bool) -> Any:
        """`BoxBounds` of boxes of positions, shape (k,), see `bound_boxes`.

        Args:
            centres: Their middles, shape (k, n) [rad or m].
            halves: Their half widths, shape (k, n) [rad or m].
            full: Whether more than the lower bound is wanted.
        """
        out: Any = np.empty(len(centres), dtype_of(BoxBounds))
        bodies, shapes = len(self.kinematics["parent"]), len(self.surfaces["kinds"])
        depth = self.kinematics["chains"].shape[1]
        links = LinkPair(
            **self.kinematics,
            **self.surfaces,
            T=np.zeros((bodies, 12)),
            axes=np.zeros((bodies, 6)),
            middle=np.zeros(bodies),
            width=np.zeros(bodies),
            rows=np.zeros((shapes, ROW_WIDTH)),
            levers=np.zeros((shapes, depth)),
            reaches=np.zeros((shapes, depth)),
            sway=np.zeros(shapes),
            balls=np.zeros((shapes, 4)),
            placed=np.zeros(shapes, dtype=np.int32),
            moves=np.zeros(max(len(self.joints), 1)),
            lever_rows=records(depth, JointRow),
            hessian=np.zeros((depth, WIDTH * depth)),
        )
        boxes = np.ascontiguousarray(centres), np.ascontiguousarray(halves)
        bound_boxes(*boxes, int(full), Ledger(links).lines, out)
        return out


def pair_tables(
    model: RobotModel, table: KinematicTable, side_a: SideShapes, side_b: SideShapes
) -> PairTables:
    """Tables of two links of one robot.

    Args:
        model: The robot.
        table: Its bodies.
        side_a: One link.
        side_b: The other.
    """
    sides = (side_a, side_b)
    chains = [chain_of(table, side.link) for side in sides]
    shared = 0
    while shared < min(map(len, chains)) and chains[0][shared] == chains[1][shared]:
        shared += 1
    chains = [chain[shared:] for chain in chains]
    used = sorted({int(table.q_index[b]) for chain in chains for b in chain})
    joints = tuple(model.q_names[j] for j in used)
    lower, upper = (limit[used] for limit in joint_limits(model))
    own_gains = [
        [float(table.gain[b, 0]) for c in chains for b in c if table.q_index[b] == j]
        for j in used
    ]
    free = ~(np.isfinite(lower) & np.isfinite(upper))
    half_turn = pi * np.array([whole_turns(gains) for gains in own_gains])
    return PairTables(
        joints=joints,
        lower=np.where(free, -half_turn, lower),
        upper=np.where(free, half_turn, upper),
        kinematics=chain_tables(table, chains, used),
        surfaces=shape_tables(table, sides),
        shapes=tuple(s.shape for side in sides for u in side.unions for s in u),
    )


def chain_of(table: KinematicTable, link: str) -> list[int]:
    """Bodies with a joint from the root to a link."""
    chain = []
    body = table.body_of_link[link]
    while body >= 0:
        if table.joint_kind[body] != FIXED:
            chain.append(body)
        body = int(table.parent[body])
    return chain[::-1]


def whole_turns(gains: Sequence[float]) -> float:
    """Turns of an unlimited joint after which all that follow it stand as before."""
    turns = 1
    for gain in gains:
        fraction = Fraction(gain).limit_denominator(MOST_TURNS)
        if abs(float(fraction) - gain) > 1e-12:
            return float("inf")
        turns = int(np.lcm(turns, fraction.denominator))
    return float(turns)


def chain_tables(
    table: KinematicTable, chains: Sequence[Sequence[int]], used: Sequence[int]
) -> dict[str, NDArray[Any]]:
    """Bodies of both chains behind body 0, and the chains by their numbers there."""
    bodies = [0, *chains[0], *chains[1]]
    count = len(bodies)
    numbers = np.full((2, max(len(chains[0]), len(chains[1]), 1)), -1, dtype=np.int32)
    parent = np.arange(-1, count - 1, dtype=np.int32)
    for side, chain in enumerate(chains):
        first = 1 + side * len(chains[0])
        numbers[side, : len(chain)] = range(first, first + len(chain))
        if chain:
            parent[first] = 0
    kinds, gain, axis = (
        np.array(column[bodies])
        for column in (table.joint_kind, table.gain, table.axis)
    )
    frames = table.T_parent_joint[bodies]
    place = {j: k for k, j in enumerate(used)}
    q_index = np.array([place.get(int(table.q_index[b]), -1) for b in bodies], np.int32)
    # Body 0 is whatever carries both: the chains stand in its frame.
    kinds[0], q_index[0] = FIXED, -1
    frames[0] = np.eye(4)[:3].reshape(12)
    lengths = np.array([len(chain) for chain in chains], dtype=np.int32)
    return {
        "parent": parent,
        "joint_kind": kinds,
        "q_index": q_index,
        "gain": gain,
        "T_parent_joint": frames,
        "axis": axis,
        "chains": numbers,
        "lengths": lengths,
    }


def shape_tables(
    table: KinematicTable, sides: Sequence[SideShapes]
) -> dict[str, NDArray[Any]]:
    """Shapes of both links, and which pairs of them make each model."""
    placed: list[PlacedShape] = []
    side_of: list[int] = []
    frames: list[Floats] = []
    unions: list[list[range]] = [[], []]
    for number, side in enumerate(sides):
        T = table.T_body_link[side.link]
        for union in side.unions:
            unions[number].append(range(len(placed), len(placed) + len(union)))
            placed += union
            side_of += [number] * len(union)
            frames += [T @ s.pose.matrix() for s in union]
    models = [
        [(i, j) for i in one for j in other] for one in unions[0] for other in unions[1]
    ]
    kinds = np.array([int(s.shape.kind) for s in placed], dtype=np.int32)
    rows = np.array(
        [shape_row(s.shape, T) for s, T in zip(placed, frames, strict=True)]
    )
    hold = np.zeros((len(placed), HOLD_POINTS, 3))
    count = np.zeros(len(placed), dtype=np.int32)
    radius = np.zeros(len(placed))
    for k, (s, T) in enumerate(zip(placed, frames, strict=True)):
        points, radius[k] = hold_points(s.shape, rows[k], T)
        count[k] = len(points)
        hold[k, : len(points)] = points
    return {
        "kinds": kinds,
        "sides": np.array(side_of, dtype=np.int32),
        "local_rows": rows,
        "hold": hold.reshape(-1, 3),
        "hold_count": count,
        "hold_radius": radius,
        "pairs": np.array([pair for m in models for pair in m], dtype=np.int32),
        "models": np.cumsum([0, *map(len, models)]).astype(np.int32),
    }


def hold_points(shape: Shape, row: Floats, T: Floats) -> tuple[Floats, float]:
    """Points whose convex hull, grown by a radius, holds a shape, and the radius.

    Args:
        shape: The shape.
        row: Its row at its place.
        T: Its frame there, shape (4, 4).
    """
    kind = ShapeKind(shape.kind)
    signs = np.array(np.meshgrid(*[[-1.0, 1.0]] * 3)).reshape(3, 8).T
    R = row[7:16].reshape(3, 3)
    if kind in (ShapeKind.BOX, ShapeKind.ELLIPSOID):
        return row[1:4] + (signs * row[4:7]) @ R.T, float(row[0])
    if kind in (ShapeKind.CYLINDER, ShapeKind.CONE):
        across = max(row[4], row[6])
        return row[1:4] + (signs * [across, across, row[5]]) @ R.T, float(row[0])
    if kind is ShapeKind.HULL:
        vertices = np.asarray(getattr(shape, "vertices"))  # noqa: B009
        _, _, turned = np.linalg.svd(
            vertices - vertices.mean(axis=0), full_matrices=True
        )
        boxes = [corner_points(vertices, frame) for frame in (np.eye(3), turned)]
        best = min(boxes, key=lambda b: float(np.linalg.norm(b[0] - b[-1])))
        return best @ T[:3, :3].T + T[:3, 3], float(row[0])
    capsule = anchor(int(kind), row)
    return np.array([capsule.start, capsule.end]), capsule.radius


def corner_points(points: Floats, frame: Floats) -> Floats:
    """Corners of the box round points along the rows of a frame, shape (8, 3) [m]."""
    local = points @ frame.T
    low, high = local.min(axis=0), local.max(axis=0)
    chosen = np.array(np.meshgrid([0, 1], [0, 1], [0, 1], indexing="ij"))
    corners = np.where(chosen.reshape(3, 8).T == 0, low, high)
    return np.asarray(corners @ frame)
