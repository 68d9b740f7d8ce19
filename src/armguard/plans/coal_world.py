"""A scene's primitives as Coal has them, on Pinocchio's kinematics.

None of this is shared with what proves: it judges that.
"""

from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armguard.errors import TrajectoryError
from armguard.geometry.shapes import Hull, ShapeKind
from armguard.scene.tables import SceneTables

Floats = NDArray[np.float64]

# Tolerance of Coal's solvers; with its own they err by 1e-6.
TOLERANCE = 1e-12
MOST_ITERATIONS = 1000


class CoalWorld:
    """Primitives of a scene, and how far joints may carry them.

    With exact shapes, these come behind the p primitives, in the order of the tables.

    Attributes:
        radii: Radius of a ball about the origin of each shape, shape (k,) [m].
        levers: How far one radian or metre of each joint carries any point of each
            shape at most, shape (k, n) [m].

    Args:
        tables: The scene.
        exact: Whether the exact shapes of links are in it as well.

    Raises:
        TrajectoryError: Pinocchio or Coal is missing, or the scene has a shape that
            this does not know.
    """

    def __init__(self, tables: SceneTables, *, exact: bool = False) -> None:
        try:
            import coal
            import pinocchio
        except ImportError:
            raise TrajectoryError(
                "a recheck needs Pinocchio and Coal: pip install 'armguard[bench]'"
            ) from None
        self._coal, self._pin = coal, pinocchio
        if tables.exact.of_primitive[:, 1].any() and not exact:
            raise TrajectoryError(
                "a recheck measures primitives, and this scene has exact shapes too, "
                "which may prove more; there is no recheck of it"
            )
        self._tables = tables
        self._model = pinocchio.Model()
        self._geometry = pinocchio.GeometryModel()
        joints, frames = self._add_joints()
        self._bodies, self._rows, kinds = tables.bodies, tables.local_rows, tables.kinds
        if exact:
            of, second = tables.exact.of_primitive, tables.exact
            bodies = np.zeros(len(second.kinds), dtype=np.int32)
            for i in np.flatnonzero(of[:, 1]).tolist():
                bodies[of[i, 0] : of[i].sum()] = tables.bodies[i]
            self._bodies = np.concatenate((self._bodies, bodies))
            self._rows = np.concatenate((self._rows, second.rows))
            kinds = np.concatenate((kinds, second.kinds))
        self.radii = np.zeros(len(kinds))
        for i, body in enumerate(self._bodies.tolist()):
            shape, at, self.radii[i] = self._shape(i, ShapeKind(int(kinds[i])))
            above = 0 if body < 0 else joints[body]
            frame = at if body < 0 else frames[body] * at
            self._geometry.addGeometryObject(
                pinocchio.GeometryObject(str(i), above, frame, shape)
            )
        self._data = self._model.createData()
        self._placed = self._geometry.createData()
        moving = np.flatnonzero(tables.joint_kind != 0)
        self._source, self._gain = tables.q_index[moving], tables.gain[moving]
        self._request = coal.DistanceRequest()
        self._request.enable_signed_distance = True
        self._request.gjk_tolerance = self._request.epa_tolerance = TOLERANCE
        self._request.gjk_max_iterations = MOST_ITERATIONS
        self._request.epa_max_iterations = MOST_ITERATIONS
        self._result = coal.DistanceResult()
        self.levers = self._levers()

    def place(self, q: Floats) -> Floats:
        """Move all shapes; returns their origins, shape (k, 3) [m].

        Args:
            q: Joint positions, shape (n,) [rad or m].
        """
        self.move(q)
        return np.array([at.translation for at in self._placed.oMg])

    def move(self, q: Floats) -> None:
        """Move all shapes; see `place`."""
        own = q[self._source] * self._gain[:, 0] + self._gain[:, 1]
        self._pin.updateGeometryPlacements(
            self._model, self._data, self._geometry, self._placed, own
        )

    def poses(self, primitives: Iterable[int]) -> list[Any]:
        """Where some primitives were placed, as Coal has it, one for each."""
        return [self._pose(i) for i in primitives]

    def distance(self, i: int, j: int) -> float:
        """Signed distance of two primitives where they were placed [m]."""
        return self.distance_at(i, self._pose(i), j, self._pose(j))

    def distance_at(self, i: int, at_i: Any, j: int, at_j: Any) -> float:
        """Signed distance of two primitives at any poses, see `poses` [m]."""
        one, other = (self._geometry.geometryObjects[k].geometry for k in (i, j))
        self._result.clear()
        return float(
            self._coal.distance(one, at_i, other, at_j, self._request, self._result)
        )

    def _pose(self, i: int) -> Any:
        """Where a primitive was placed, as Coal has it."""
        at = self._placed.oMg[i]
        return self._coal.Transform3s(at.rotation, at.translation)

    def _add_joints(self) -> tuple[list[int], list[Any]]:
        """Add all joints; returns the joint of each body, and its frame there."""
        pin, t = self._pin, self._tables
        joints, frames = list[int](), list[Any]()
        for b, up in enumerate(t.parent):
            rows = t.T_parent_joint[b].reshape(3, 4)
            at = pin.SE3(rows[:, :3].copy(), rows[:, 3].copy())
            above = 0
            if up >= 0:
                above, at = joints[up], frames[up] * at
            if t.joint_kind[b] == 0:
                joints.append(above)
                frames.append(at)
                continue
            kind = pin.JointModelRevoluteUnaligned
            if t.joint_kind[b] == 2:
                kind = pin.JointModelPrismaticUnaligned
            joint = self._model.addJoint(above, kind(t.axis[b]), at, str(b))
            joints.append(joint)
            frames.append(pin.SE3.Identity())
        return joints, frames

    def _shape(self, i: int, kind: ShapeKind) -> tuple[Any, Any, float]:
        """Coal's shape of a row, its frame, and the radius of a ball about that.

        Raises:
            TrajectoryError: It is of a kind that this does not know.
        """
        row, first = self._rows[i], len(self._tables.kinds)
        coal, pin, R = self._coal, self._pin, np.eye(3)
        centre, radius = row[1:4].copy(), float(row[0])
        if kind is ShapeKind.CAPSULE:
            axis = row[4:7] - row[1:4]
            length = float(np.linalg.norm(axis))
            if length > 0.0:
                up = np.array([0.0, 0.0, 1.0])
                R = pin.Quaternion.FromTwoVectors(up, axis / length).matrix()
                centre = centre + axis / 2.0
                solid, radius = coal.Capsule(radius, length), radius + length / 2.0
                return solid, pin.SE3(R, centre), radius
        if kind in (ShapeKind.SPHERE, ShapeKind.CAPSULE):
            return coal.Sphere(radius), pin.SE3(R, centre), radius
        if kind is ShapeKind.BOX:
            solid, reach = coal.Box(*(2.0 * row[4:7])), float(np.linalg.norm(row[4:7]))
        elif kind is ShapeKind.CYLINDER:
            solid = coal.Cylinder(row[4], 2.0 * row[5])
            reach = float(np.hypot(row[4], row[5]))
        elif i >= first and isinstance(
            hull := self._tables.exact.shapes[i - first], Hull
        ):
            solid, reach = self._hull(hull), np.linalg.norm(hull.vertices, axis=1).max()
        else:
            name = self._tables.labels[i] if i < first else f"exact shape {i - first}"
            raise TrajectoryError(
                f"'{name}' is a {kind.name.lower()}; a recheck knows "
                "spheres, capsules, boxes and cylinders"
            )
        solid.setSweptSphereRadius(radius)
        R = np.ascontiguousarray(row[7:16].reshape(3, 3))
        return solid, pin.SE3(R, centre), radius + float(reach)

    def _hull(self, hull: Hull) -> Any:
        """A hull as Coal has it, of its corners.

        Raises:
            TrajectoryError: Its corners lie in a plane.
        """
        corners = self._coal.StdVec_Vec3s()
        for corner in hull.vertices:
            corners.append(corner)
        try:
            return self._coal.ConvexBase.convexHull(corners, False, "Qt")
        except RuntimeError:
            raise TrajectoryError("Coal knows no hull of corners in a plane") from None

    def _levers(self) -> Floats:
        """See `levers`: lengths of all frames on the way from a joint to a shape.

        A sliding joint carries points by its own way, and lengthens what is before it
        by the farthest it may be.
        """
        t = self._tables
        reach = np.maximum(np.abs(t.lower), np.abs(t.upper))
        levers = np.zeros((len(self._bodies), len(t.q_names)))
        for i, own in enumerate(self._bodies):
            body = int(own)
            at = self._geometry.geometryObjects[i].placement.translation
            length = float(np.linalg.norm(self._rows[i][1:4])) + 2.0 * self.radii[i]
            length = max(length, float(np.linalg.norm(at)) + self.radii[i])
            while body >= 0:
                if t.joint_kind[body] != 0:
                    gain, j = abs(t.gain[body, 0]), t.q_index[body]
                    slides = t.joint_kind[body] == 2
                    levers[i, j] += gain * (1.0 if slides else length)
                    if slides:
                        length += gain * reach[j] + abs(t.gain[body, 1])
                length += float(np.linalg.norm(t.T_parent_joint[body][[3, 7, 11]]))
                body = int(t.parent[body])
        return levers


def checked_pairs(tables: SceneTables) -> NDArray[np.intp]:
    """Pairs of primitives that are checked, shape (k, 2).

    Boxes in place of a gripper are left out: its links are there as well.
    """
    coarse = {part.coarse for part in tables.holds.grippers}
    groups = tables.groups
    return np.array(
        [
            (i, j)
            for i in range(tables.moving_count)
            for j in range(i + 1, len(tables.kinds))
            if tables.checked[groups[i], groups[j]]
            and not coarse & {tables.body_names[i], tables.body_names[j]}
        ],
        dtype=np.intp,
    ).reshape(-1, 2)


def shared_joints(tables: SceneTables) -> NDArray[np.bool_]:
    """Joints that carry both of two primitives alike, shape (p, p, n)."""
    count, joints = len(tables.kinds), len(tables.q_names)
    above = [set(bodies_above(tables, int(body))) for body in tables.bodies]
    found = np.zeros((count, count, joints), dtype=bool)
    for i in range(tables.moving_count):
        for j in range(count):
            both, one = above[i] & above[j], above[i] ^ above[j]
            for body in both:
                found[i, j, tables.q_index[body]] = True
            for body in one:
                # It also moves one of them alone, by another body that follows it.
                found[i, j, tables.q_index[body]] = False
    return found


def bodies_above(tables: SceneTables, body: int) -> Iterator[int]:
    """Bodies with a joint from a body to the root."""
    while body >= 0:
        if tables.joint_kind[body] != 0:
            yield body
        body = int(tables.parent[body])
