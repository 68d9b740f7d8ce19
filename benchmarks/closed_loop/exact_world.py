"""All checked pairs by Pinocchio and Coal, links by their meshes as they are."""

from typing import Any

import coal
import numpy as np
import pinocchio as pin

from armguard.geometry.shapes import Box, Shape, Sphere
from armguard.robot.meshes import load_triangles
from armguard.robot.model import Cylinder, MeshFile
from armguard.scene import Scene, SceneTables
from arrays import Floats
from closed_loop.judge import STROKE
from closed_loop.judge_model import own_elements
from peers.pinocchio_coal import build_models, coal_shape


class ExactWorld:
    """Distances of checked pairs at any configuration.

    Attributes:
        owners: Names of the two sides of each pair.
        reach: How far a unit of each joint can change a pair's distance, shape (k, n)
            [m/rad or 1].

    Args:
        scene: The scene.
        tables: Its tables.
    """

    def __init__(self, scene: Scene, tables: SceneTables) -> None:
        moving = np.flatnonzero(tables.joint_kind != 0)
        self._source = tables.q_index[moving]
        self._gain = tables.gain[moving]
        self._axes = tables.axis[moving]
        self._model, primitives = build_models(tables)
        self._data = self._model.createData()
        self._geometry = pin.GeometryModel()
        sides = self._fill(primitives, scene, tables)
        group = dict(zip(tables.body_names, tables.groups, strict=True))
        arms = set(scene.robots)
        self.owners: list[tuple[str, str]] = []
        for i, a in enumerate(sides):
            for j in range(i + 1, len(sides)):
                b = sides[j]
                moves = {a.split("/")[0], b.split("/")[0]} & arms
                if a != b and moves and tables.checked[group[a], group[b]]:
                    self._geometry.addCollisionPair(pin.CollisionPair(i, j))
                    self.owners.append((a, b))
        self._results = pin.GeometryData(self._geometry)
        self._objects = {
            name: [i for i, side in enumerate(sides) if side == name]
            for name in scene.objects
        }
        self._home = [g.placement.copy() for g in self._geometry.geometryObjects]
        self.reach = self._reaches(len(tables.q_names))
        shapes = [g.geometry for g in self._geometry.geometryObjects]
        self._centres = [np.array(s.aabb_center) for s in shapes]
        self._radii = np.array([s.aabb_radius for s in shapes])
        pairs = self._geometry.collisionPairs
        self._sides = np.array([(p.first, p.second) for p in pairs])

    def shift(self, name: str, p: Floats) -> None:
        """Put an object elsewhere by p from where the scene has it."""
        for i in self._objects[name]:
            at = pin.SE3(self._home[i].rotation, self._home[i].translation + p)
            self._geometry.geometryObjects[i].placement = at

    def place(self, q: Floats) -> None:
        """Kinematics of a configuration, shape (n,)."""
        pin.updateGeometryPlacements(
            self._model, self._data, self._geometry, self._results, self._own(q)
        )

    def distance(self, k: int) -> float:
        """Signed distance of a pair in the configuration placed last [m]."""
        return pin.computeDistance(self._geometry, self._results, k).min_distance

    def distances(self, q: Floats) -> Floats:
        """Signed distances of all pairs, shape (k,) [m]."""
        pin.computeDistances(
            self._model, self._data, self._geometry, self._results, self._own(q)
        )
        return np.array([r.min_distance for r in self._results.distanceResults])

    def bounds(self, q: Floats) -> Floats:
        """Distances of all pairs, or less, by spheres about them, shape (k,) [m].

        Places the configuration.
        """
        self.place(q)
        at = np.array(
            [M.act(c) for M, c in zip(self._results.oMg, self._centres, strict=True)]
        )
        a, b = self._sides[:, 0], self._sides[:, 1]
        apart = np.linalg.norm(at[a] - at[b], axis=1)
        return apart - self._radii[a] - self._radii[b]

    def levers(self, q: Floats) -> Floats:
        """Like `reach`, about the joints' axes where they stand now, shape (k, n)."""
        self.place(q)
        found = np.zeros_like(self.reach)
        lines = {}
        for joint in range(1, self._model.njoints):
            M = self._data.oMi[joint]
            axis = M.rotation @ self._axes[joint - 1]
            lines[joint] = (M.translation, axis, self._slides(joint))
        for i, M in enumerate(self._results.oMg):
            at = M.act(self._centres[i])
            for joint in self._chains[i]:
                p, axis, slides = lines[joint]
                out = at - p
                out = out - axis * (axis @ out)
                far = float(np.sqrt(out @ out)) + self._radii[i]
                source = self._source[joint - 1]
                lever = abs(self._gain[joint - 1, 0]) * (1.0 if slides else far)
                rows = self._moved[i, joint]
                found[rows, source] += lever
        return found

    def gradient(self, k: int, q: Floats, step: float = 1e-4) -> Floats:
        """Change of a pair's distance by each joint, by central differences, (n,)."""
        found = np.zeros(len(q))
        for j in np.flatnonzero(self.reach[k]):
            up, down = q.copy(), q.copy()
            up[j] += step
            down[j] -= step
            self.place(up)
            above = self.distance(k)
            self.place(down)
            found[j] = (above - self.distance(k)) / (2.0 * step)
        return found

    def _own(self, q: Floats) -> Floats:
        """Positions in the order of Pinocchio's joints."""
        return self._gain[:, 0] * q[self._source] + self._gain[:, 1]

    def _fill(self, primitives: Any, scene: Scene, tables: SceneTables) -> list[str]:
        """Add the elements of links with exact geometry, primitives of all others."""
        elements = own_elements(scene)
        sides: list[str] = []
        for i, owner in enumerate(tables.body_names):
            given = primitives.geometryObjects[i]
            if owner not in elements:
                self._geometry.addGeometryObject(given)
                sides.append(owner)
            elif owner not in sides:
                _, T = coal_shape(int(tables.kinds[i]), tables.local_rows[i])
                body = given.placement * T.inverse()
                for k, (geometry, frame) in enumerate(elements[owner]):
                    at = body * pin.SE3(frame)
                    name = f"{owner}:{k}"
                    self._geometry.addGeometryObject(
                        pin.GeometryObject(name, given.parentJoint, at, solid(geometry))
                    )
                    sides.append(owner)
        return sides

    def _reaches(self, n: int) -> Floats:
        """See `reach`."""
        chains = [self._chain(g) for g in self._geometry.geometryObjects]
        self._chains = chains
        moved: dict[tuple[int, int], list[int]] = {
            (i, joint): [] for i, chain in enumerate(chains) for joint in chain
        }
        self._moved = moved
        found = np.zeros((len(self.owners), n))
        for k, pair in enumerate(self._geometry.collisionPairs):
            first, second = chains[pair.first], chains[pair.second]
            # What carries both sides does not change their distance.
            for joint in first.keys() ^ second.keys():
                far = first.get(joint, 0.0) + second.get(joint, 0.0)
                side = pair.first if joint in first else pair.second
                moved[side, joint].append(k)
                source = self._source[joint - 1]
                found[k, source] += abs(self._gain[joint - 1, 0]) * far
        return found

    def _slides(self, joint: int) -> bool:
        """Whether a joint is prismatic."""
        return "Prismatic" in self._model.joints[joint].shortname()

    def _chain(self, geometry_object: Any) -> dict[int, float]:
        """Joints that carry a shape, and how far it may be from each one's axis [m]."""
        geometry_object.geometry.computeLocalAABB()
        centre = geometry_object.placement.act(
            np.array(geometry_object.geometry.aabb_center)
        )
        far = float(np.linalg.norm(centre)) + geometry_object.geometry.aabb_radius
        joint, found = int(geometry_object.parentJoint), {}
        while joint > 0:
            slides = self._slides(joint)
            found[joint] = 1.0 if slides else far
            at = self._model.jointPlacements[joint].translation
            far += float(np.linalg.norm(at)) + (STROKE if slides else 0.0)
            joint = int(self._model.parents[joint])
        return found


def solid(geometry: Shape | Cylinder | MeshFile) -> Any:
    """An element of a link, as Coal knows it, about the origin of its frame.

    Raises:
        ValueError: The judge has no such shape.
    """
    if isinstance(geometry, MeshFile):
        return bvh(load_triangles(geometry))
    if isinstance(geometry, Cylinder):
        return coal.Cylinder(geometry.radius, geometry.length)
    if isinstance(geometry, Sphere):
        return coal.Sphere(geometry.radius + geometry.rounding)
    if isinstance(geometry, Box) and geometry.rounding == 0.0:
        return coal.Box(*geometry.size)
    raise ValueError(f"the judge has no shape for {type(geometry).__name__}")


def bvh(triangles: Floats) -> Any:
    """A mesh as Coal's tree of boxes and spheres.

    Args:
        triangles: Corners, shape (n, 3, 3) [m].
    """
    tree = coal.BVHModelOBBRSS()
    tree.beginModel(len(triangles), 3 * len(triangles))
    for a, b, c in triangles:
        tree.addTriangle(a, b, c)
    tree.endModel()
    return tree
