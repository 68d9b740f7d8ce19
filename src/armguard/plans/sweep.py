"""Swept volumes: convex pieces that hold all that links pass through along a plan.

A piece holds one primitive over a part of a segment, which has four steps. Within a
step a point leaves the chord of its path by at most an eighth of the greatest second
derivative of that path. Of two joints that carry a point, the one nearer to the point
adds to that derivative by both their ways, times the distance of the point from its
axis. The hull of the primitive at all ends of steps, grown by that chord error, holds
all of it; the piece is cut out by planes around that hull. Parts are halved until the
chord error of the whole part, sixteen times that of a step, is small enough. A width of
the tube, that is a following error and skew, is added to the growth.

In the frame of a link the joints of both carry a point: those of its own link, and in
reverse order those of the other one. Joints that carry both do not count.
"""

import ctypes
from collections.abc import Container, Iterable, Iterator
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from armguard.errors import TrajectoryError
from armguard.geometry.convex_hull import convex_hull
from armguard.geometry.proximity import measure_all
from armguard.geometry.shapes import Hull, ShapeKind, shape_row
from armguard.geometry.witness import WITNESS_WIDTH
from armguard.plans.coal_world import bodies_above
from armguard.plans.pieces import Piece
from armguard.prove.tube import Tube
from armguard.robot.kinematics import PRISMATIC
from armguard.scene.poses import body_poses
from armguard.scene.tables import LinkFrame, SceneTables

Floats = NDArray[np.float64]

# First parts turn at most this much in all, and none is halved more often [rad or m].
TURN, HALVINGS = 0.3, 30

# Steps of a part, and the share of the tolerance for its chord error [-]; the rest is
# for planes, and for segments that become one.
STEPS, CHORD = 4, 0.5

# Segments become one where joints leave its chord by this share of the tolerance, times
# 1 rad or m for each metre [-].
THINNED = 0.2

# What pieces are grown for rounding [m].
ROUNDING = 1e-7

# Planes around a piece, beside those along the faces of a primitive: this length [m]
# divided by the tolerance, and within these bounds.
PLANES, FEWEST, MOST = 0.8, 60, 600

# Corners that rows of some kinds hold.
CORNERS = {ShapeKind.SPHERE: 1, ShapeKind.CAPSULE: 2, ShapeKind.TRIANGLE: 3}

# Faces of a hull that have planes of their own, the largest.
FACES = 24


def sweep(
    tube: Tube,
    tables: SceneTables,
    *,
    tolerance: float = 0.005,
    links: Container[str] | None = None,
    relative_to: str | None = None,
) -> Iterator[Piece]:
    """Pieces that together hold all that moving links pass through.

    Args:
        tube: Where the joints may be, see `Plan.widened`.
        tables: The scene; nothing is held.
        tolerance: How far pieces may reach beyond what they hold, about, without the
            width of the tube [m].
        links: 'robot/link' of those that are swept; all if left out.
        relative_to: 'robot/link' in whose frame the pieces are; the world if left out.

    Raises:
        TrajectoryError: The tolerance is not above 0, or a link has a shape that only
            a function describes.
    """
    if not tolerance > 0.0:
        raise TrajectoryError(f"the tolerance is {tolerance}; it must be > 0")
    frame = None if relative_to is None else tables.links[relative_to]
    coarse_grippers = {part.coarse for part in tables.holds.grippers}
    chosen = [
        Swept(i, tables, frame)
        for i in range(tables.moving_count)
        if tables.robot_of_primitive[i] >= 0
        and tables.body_names[i] not in coarse_grippers
        and (links is None or tables.body_names[i] in links)
    ]
    directions = around(int(np.clip(PLANES / tolerance, FEWEST, MOST)))
    tube = tube.thinned(THINNED * tolerance)
    waiting = [(int(s), a, b, chosen, 0) for s, a, b in tube.tiles(TURN)[::-1]]
    while waiting:
        segment, low, high, own, halved = waiting.pop()
        part = Part(tube, (segment, low, high), tables, frame)
        coarse = []
        for one in own:
            chord, wide = part.errors(one)
            if STEPS**2 * chord > CHORD * tolerance and halved < HALVINGS:
                coarse.append(one)
            else:
                yield part.piece(one, chord + wide + ROUNDING, directions)
        if coarse:
            middle = 0.5 * (low + high)
            waiting.append((segment, middle, high, coarse, halved + 1))
            waiting.append((segment, low, middle, coarse, halved + 1))


class Swept:
    """A primitive, in the frame of its body.

    Attributes:
        link: 'robot/link'.
        body: The body.
        joints: Bodies with a joint that carry it, its own first; then those that carry
            the frame, its own last.
        centre: Middle of a ball that holds it, shape (3,) [m].
        reach: Radius of that ball [m].
        faces: Normals of its flat faces, shape (f, 3).

    Args:
        primitive: Its number.
        tables: The scene.
        frame: The frame that it is swept in; the world if left out.

    Raises:
        TrajectoryError: Only a function knows how far it reaches.
    """

    def __init__(
        self, primitive: int, tables: SceneTables, frame: LinkFrame | None = None
    ) -> None:
        self.link = tables.body_names[primitive]
        self.body = int(tables.bodies[primitive])
        self._kind = ShapeKind(int(tables.kinds[primitive]))
        self._row = tables.local_rows[primitive]
        if self._kind is ShapeKind.SUPPORT:
            raise TrajectoryError(
                f"{self.link} has a shape that only a function describes; there is no "
                "sweep of it"
            )
        own = list(bodies_above(tables, self.body))
        other = [] if frame is None else list(bodies_above(tables, frame.body))
        self.joints = [body for body in own if body not in other]
        self.joints += [body for body in reversed(other) if body not in own]
        axes = np.concatenate((np.eye(3), -np.eye(3)))
        upper, lower = np.split(self.heights(axes), 2)
        self.centre = 0.5 * (upper - lower)
        self.reach = float(np.linalg.norm(0.5 * (upper + lower)))
        self.faces = self._faces()

    def heights(self, d: Floats) -> Floats:
        """How far it reaches along directions in the frame of its body, (k,) [m]."""
        return reach_along(self._kind, self._row, d)

    def meets(self, piece: Piece, T: Floats) -> bool:
        """Whether it may have a point in common with a piece.

        Args:
            piece: The piece.
            T: Frame of its body in that of the piece, shape (4, 4).
        """
        R, p = T[:3, :3], T[:3, 3]
        least = piece.normals @ p - self.heights(-piece.normals @ R)
        if (least > piece.heights).any():
            return False
        hull, found = Hull(points=piece.corners), np.zeros((1, WITNESS_WIDTH))
        own, own_frame = (int(self._kind), self._row), T[:3].reshape(1, 12)
        other, world = (int(hull.kind), shape_row(hull)), np.eye(4)[:3].reshape(1, 12)
        measure_all(*own, own_frame, *other, world, found)
        return not found[0, 0] > ROUNDING

    def _faces(self) -> Floats:
        """See `faces`."""
        if self._kind is ShapeKind.HULL:
            points = points_of(self._kind, self._row)
            hull = None if points is None else convex_hull(points)
            if hull is None:
                return np.zeros((0, 3))
            corners = hull.points[hull.simplices]
            edges = corners[:, 1:] - corners[:, :1]
            areas = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1)
            largest = np.argsort(-areas, kind="stable")[:FACES]
            return np.asarray(hull.equations[largest, :3])
        flat = {ShapeKind.BOX: [0, 1, 2], ShapeKind.CYLINDER: [2], ShapeKind.CONE: [2]}
        axes = self._row[7:16].reshape(3, 3).T[flat.get(self._kind, [])]
        return np.concatenate((axes, -axes))


class Part:
    """A part of a segment: bodies at all ends of its steps, and the joints' ways.

    Args:
        tube: The tube.
        place: The segment, and the shares of it where the part begins and ends [-].
        tables: The scene.
        frame: The frame that pieces are in; the world if left out.
    """

    def __init__(
        self,
        tube: Tube,
        place: tuple[int, float, float],
        tables: SceneTables,
        frame: LinkFrame | None = None,
    ) -> None:
        self._tables = tables
        segment, low, high = place
        shares = np.linspace(low, high, STEPS + 1)
        steps = [part_of(tube.control[segment], a, b) for a, b in pairwise(shares)]
        # The longest way and bow of each joint in any step.
        self._way = np.max([np.abs(step[-1] - step[0]) for step in steps], axis=0)
        self._bow = np.max(
            [
                np.abs(step - np.linspace(step[0], step[-1], len(step)))
                for step in steps
            ],
            axis=(0, 1),
        )
        # These two do not get less where a part is halved.
        self._wide = tube.wide[segment] + (
            0.0 if tube.bow is None else tube.bow[segment]
        )
        self._times = tube.time(np.array([segment] * 2), np.array([low, high]))
        places = [step[0] for step in steps] + [steps[-1][-1]]
        poses = [body_poses(tables, q).reshape(-1, 3, 4) for q in places]
        self._ends = np.array(poses)
        # The frame at each end, that is the rotation and the origin.
        self._R, self._p = np.eye(3)[None], np.zeros((1, 3))
        if frame is not None:
            at, T = self._ends[:, frame.body], frame.T_body_link
            self._R = at[:, :, :3] @ T[:3, :3]
            self._p = at[:, :, :3] @ T[:3, 3] + at[:, :, 3]

    def errors(self, one: Swept) -> tuple[float, float]:
        """How far its points may leave chords of steps, and what a width adds [m]."""
        t = self._tables
        middle = self._middles(one)
        second = bent = wider = carried = 0.0
        # Of joints nearer to the primitive: the sums of their ways and of what these
        # add to the second derivative of a joint farther away.
        turning = 0.0
        for body in one.joints:
            j, gain = t.q_index[body], abs(float(t.gain[body, 0]))
            way, bow, wide = (
                gain * float(each[j]) for each in (self._way, self._bow, self._wide)
            )
            if t.joint_kind[body] == PRISMATIC:
                lever, pull = 1.0, way
            else:
                axes = self._ends[:, body, :, :3] @ t.axis[body]
                apart = middle - self._ends[:, body, :, 3]
                across = np.linalg.norm(np.cross(axes, apart), axis=1).max()
                lever = float(across) + one.reach + carried
                pull = way * lever
                second += way * pull + 2.0 * way * turning
            turning += pull
            bent, wider = bent + bow * lever, wider + wide * lever
            carried += (0.5 * way + bow + wide) * lever
        return second / 8.0 + bent, wider

    def piece(self, one: Swept, growth: float, directions: Floats) -> Piece:
        """The piece that holds a primitive in this part.

        Args:
            one: The primitive.
            growth: How far its points may leave their chords [m].
            directions: Normals of planes around it, shape (k, 3).
        """
        back = self._R.transpose(0, 2, 1)
        R = back @ self._ends[:, one.body, :, :3]
        p = np.einsum("kij,kj->ki", back, self._ends[:, one.body, :, 3] - self._p)
        flat = (one.faces @ R[k].T for k in (0, STEPS // 2, STEPS))
        normals = np.concatenate((directions, *flat))
        each = (one.heights(normals @ R[k]) + normals @ p[k] for k in range(STEPS + 1))
        heights = np.max(list(each), axis=0)
        start, end = map(float, self._times)
        inside = (R @ one.centre + p).mean(axis=0)
        return Piece(one.link, start, end, inside, normals, heights + growth)

    def _middles(self, one: Swept) -> Floats:
        """The middle of its ball at all ends, shape (STEPS + 1, 3) [m]."""
        at = self._ends[:, one.body]
        return np.asarray(at[:, :, :3] @ one.centre + at[:, :, 3])


def meeting(pieces: Iterable[Piece], link: str, tables: SceneTables) -> list[Piece]:
    """The pieces of a sweep relative to a link that the link itself may meet.

    Args:
        pieces: Pieces in the frame of the link.
        link: 'robot/link'.
        tables: The scene.

    Raises:
        TrajectoryError: The link has no shape, or one that only a function describes.
    """
    own = [Swept(i, tables) for i, name in enumerate(tables.body_names) if name == link]
    if not own:
        raise TrajectoryError(f"{link} has no shape that a sweep could meet")
    frame = tables.links[link]
    # Rows of a link that never moves are in the world.
    T = np.eye(4)
    if own[0].body < 0:
        T[:3] = body_poses(tables, tables.home)[frame.body].reshape(3, 4)
    T = np.ascontiguousarray(np.linalg.inv(T @ frame.T_body_link))
    return [piece for piece in pieces if any(one.meets(piece, T) for one in own)]


def part_of(control: Floats, low: float, high: float) -> Floats:
    """Bernstein control points of a curve between two shares of it, (degree + 1, n)."""
    for share, back in ((high, True), (low / high if high > 0.0 else 0.0, False)):
        rows, kept = control, []
        while len(rows):
            kept.append(rows[0 if back else -1])
            rows = (1.0 - share) * rows[:-1] + share * rows[1:]
        control = np.array(kept if back else kept[::-1])
    return control


def points_of(kind: ShapeKind, row: Floats) -> Floats | None:
    """Points whose hull is a primitive's core, shape (k, 3) [m]; None if it has none.

    A box has a shorter formula than that of its corners.
    """
    if kind in CORNERS:
        return row[1 : 1 + 3 * CORNERS[kind]].reshape(-1, 3)
    if kind is ShapeKind.HULL:
        # All x, then all y, then all z, where the row says.
        numbers = (ctypes.c_double * (3 * int(row[5]))).from_address(int(row[4]))
        local = np.array(numbers).reshape(3, -1).T
        return np.asarray(row[1:4] + local @ row[7:16].reshape(3, 3).T)
    return None


def reach_along(kind: ShapeKind, row: Floats, d: Floats) -> Floats:
    """Greatest d · x of the points x of a primitive, shape (k,) [m].

    Args:
        kind: Not of a shape that only a function describes, nor a half-space.
        row: Its row.
        d: Unit vectors, shape (k, 3).
    """
    points = points_of(kind, row)
    if points is not None:
        return np.asarray((d @ points.T).max(axis=1) + row[0])
    local = d @ row[7:16].reshape(3, 3)
    if kind is ShapeKind.BOX:
        core = np.abs(local) @ row[4:7]
    elif kind is ShapeKind.ELLIPSOID:
        core = np.linalg.norm(local * row[4:7], axis=1)
    else:
        out, up = np.hypot(local[:, 0], local[:, 1]), row[5] * local[:, 2]
        core = np.maximum(row[6] * out + up, row[4] * out - up)
    return np.asarray(d @ row[1:4] + core + row[0])


def around(count: int) -> Floats:
    """Unit vectors all around, on a spiral, shape (count, 3)."""
    z = 1.0 - (2.0 * np.arange(count) + 1.0) / count
    turn = np.pi * (1.0 + np.sqrt(5.0)) * np.arange(count)
    out = np.sqrt(1.0 - z * z)
    return np.column_stack((out * np.cos(turn), out * np.sin(turn), z))
