"""Pinocchio's kinematics with Coal's collision checks."""

from dataclasses import replace
from typing import Any

import coal
import numpy as np
import pinocchio as pin

from armguard.geometry.shapes import ShapeKind
from armguard.scene import SceneTables
from arrays import Floats
from peers import Pairs, checked_pairs
from peers.shapes import is_ball


def build_models(tables: SceneTables) -> tuple[Any, Any]:
    """Pinocchio's model and geometry model of a scene's flat tables."""
    model = pin.Model()
    joint_of_body: list[int] = []
    placement_of_body: list[Any] = []
    for b in range(len(tables.parent)):
        frame = transform(tables.T_parent_joint[b])
        up = tables.parent[b]
        if tables.joint_kind[b] == 0:
            joint_of_body.append(0 if up < 0 else joint_of_body[up])
            placement_of_body.append(frame if up < 0 else placement_of_body[up] * frame)
            continue
        axis = tables.axis[b]
        joint = (
            pin.JointModelRevoluteUnaligned(axis)
            if tables.joint_kind[b] == 1
            else pin.JointModelPrismaticUnaligned(axis)
        )
        at = placement_of_body[up] * frame
        joint_of_body.append(model.addJoint(joint_of_body[up], joint, at, f"body{b}"))
        placement_of_body.append(pin.SE3.Identity())
    geometry = pin.GeometryModel()
    for i in range(len(tables.kinds)):
        shape, T = coal_shape(int(tables.kinds[i]), tables.local_rows[i])
        body = tables.bodies[i]
        joint_id = 0 if body < 0 else joint_of_body[body]
        at = T if body < 0 else placement_of_body[body] * T
        geometry.addGeometryObject(pin.GeometryObject(f"p{i}", joint_id, at, shape))
    for i, j in checked_pairs(tables):
        geometry.addCollisionPair(pin.CollisionPair(i, j))
    return model, geometry


def transform(rows: Floats) -> Any:
    """Pinocchio's transform of twelve numbers."""
    T = rows.reshape(3, 4)
    return pin.SE3(np.ascontiguousarray(T[:, :3]), np.ascontiguousarray(T[:, 3]))


def coal_shape(kind: int, row: Floats) -> tuple[Any, Any]:
    """Coal's shape of a primitive, and its frame.

    Raises:
        ValueError: It is none of those that the benchmarks' scenes have.
    """
    if is_ball(kind, row):
        return coal.Sphere(row[0]), pin.SE3(np.eye(3), row[1:4].copy())
    if kind == ShapeKind.CAPSULE:
        axis = row[4:7] - row[1:4]
        length = float(np.linalg.norm(axis))
        R = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), axis / length)
        middle = (row[1:4] + row[4:7]) / 2.0
        return coal.Capsule(row[0], length), pin.SE3(R.matrix(), middle)
    if kind == ShapeKind.CYLINDER:
        solid = coal.Cylinder(row[4], 2.0 * row[5])
    elif kind == ShapeKind.BOX:
        solid = coal.Box(*(2.0 * row[4:7]))
    else:
        raise ValueError(f"no shape of Coal's is made for {ShapeKind(kind).name}")
    if row[0] > 0.0:
        solid.setSweptSphereRadius(row[0])
    R = np.ascontiguousarray(row[7:16].reshape(3, 3))
    return solid, pin.SE3(R, row[1:4].copy())


class PinocchioPeer:
    """Model and geometry of a scene, with the margin as the pairs' security margin."""

    def __init__(self, tables: SceneTables) -> None:
        self.margin = tables.margin
        joints = np.flatnonzero(tables.joint_kind != 0)
        self.source, self.gain = tables.q_index[joints], tables.gain[joints]
        self.model, self.geometry = build_models(tables)
        self.data = self.model.createData()
        self.results = pin.GeometryData(self.geometry)
        for request in self.results.collisionRequests:
            request.security_margin = tables.margin

    def positions(self, q: Floats) -> Floats:
        """Positions of all joints, also of those that follow another one."""
        return np.ascontiguousarray(
            q[:, self.source] * self.gain[:, 0] + self.gain[:, 1]
        )

    def step(self, q: Floats) -> object:
        """Every pair, each only as far as "within the margin or not" needs."""
        return pin.computeCollisions(
            self.model, self.data, self.geometry, self.results, q, False
        )

    def is_near(self, k: int) -> bool:
        """Whether a pair was found in collision with the margin."""
        return bool(self.results.collisionResults[k].isCollision())

    def near_pairs(self, q: Floats) -> Pairs:
        """Pairs that a step finds near."""
        for result in self.results.collisionResults:
            result.clear()
        self.step(q)
        pairs = enumerate(self.geometry.collisionPairs)
        return {(pair.first, pair.second) for k, pair in pairs if self.is_near(k)}


class AllDistances(PinocchioPeer):
    """`computeDistances` over all checked pairs."""

    name = "pinocchio_coal_distances"

    def step(self, q: Floats) -> object:
        """Every distance."""
        return pin.computeDistances(
            self.model, self.data, self.geometry, self.results, q
        )

    def is_near(self, k: int) -> bool:
        """Whether the distance of a pair is within the margin."""
        return bool(self.results.distanceResults[k].min_distance <= self.margin)


class MarginCollisions(PinocchioPeer):
    """`computeCollisions` over all checked pairs."""

    name = "pinocchio_coal_margin"


class BroadPhase(PinocchioPeer):
    """The broad-phase manager over a dynamic tree of boxes.

    The manager leaves the margin out of its boxes unless the requests had it when the
    manager was made (the default callback then inflates them).
    """

    name = "pinocchio_coal_broadphase"

    def __init__(self, tables: SceneTables) -> None:
        super().__init__(tables)
        self.manager = pin.BroadPhaseManager_DynamicAABBTreeCollisionManager(
            self.model, self.geometry, self.results
        )
        self.callback = pin.CollisionCallBackDefault(self.geometry, self.results, False)

    def step(self, q: Floats) -> object:
        """Kinematics, boxes, tree, and the pairs whose boxes meet."""
        return pin.computeCollisions(
            self.model, self.data, self.manager, self.callback, q
        )


class CoalManager:
    """Coal's `DynamicAABBTreeCollisionManager`, built once over the fixed objects.

    A cycle is Pinocchio's kinematics, new transforms of the objects that move, and
    every pair of a moving and a fixed object within the margin. Pairs of two moving
    objects are left out, and so are the scene's rules: that is less than a guard does.

    Args:
        tables: The scene.
    """

    def __init__(self, tables: SceneTables) -> None:
        first = tables.moving_count
        self.margin = tables.margin
        # Fixed objects need no place in Pinocchio's model.
        moving = replace(
            tables,
            kinds=tables.kinds[:first],
            bodies=tables.bodies[:first],
            local_rows=tables.local_rows[:first],
            moving_count=0,
        )
        self.model, self.geometry = build_models(moving)
        self.data = self.model.createData()
        self.placements = self.geometry.createData()
        shapes = [part.geometry for part in self.geometry.geometryObjects]
        self.moving = [coal.CollisionObject(shape) for shape in shapes]
        primitives = tables.kinds[first:].tolist(), tables.local_rows[first:]
        self.fixed = [
            coal.CollisionObject(shape, at.rotation, at.translation)
            for shape, at in map(coal_shape, *primitives)
        ]
        self.manager = coal.DynamicAABBTreeCollisionManager()
        self.manager.registerObjects(self.fixed)
        self.manager.setup()
        self.callback = coal.CollisionCallBackDefault()
        request = coal.CollisionRequest()
        request.security_margin = tables.margin
        request.num_max_contacts = 4096
        self.callback.data.request = request

    def step(self, q: Floats) -> int:
        """Number of contacts within the margin."""
        pin.updateGeometryPlacements(
            self.model, self.data, self.geometry, self.placements, q
        )
        found = 0
        for mover, at in zip(self.moving, self.placements.oMg, strict=True):
            mover.setTransform(coal.Transform3s(at.rotation, at.translation))
            mover.computeAABB()
            # The manager compares boxes, which leave the margin out.
            mover.getAABB().expand(self.margin)
            self.manager.collide(mover, self.callback)
            found += self.callback.data.result.numContacts()
        return found


# The peers of a cycle.
PEERS = (AllDistances, MarginCollisions, BroadPhase)
