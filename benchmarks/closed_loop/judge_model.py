"""A scene's true geometry as a MuJoCo model: capsules, boxes, spheres, raw meshes."""

from collections.abc import Iterator, Mapping
from itertools import combinations
from typing import Any

import mujoco
import numpy as np
from scipy.spatial import ConvexHull, QhullError

from armguard.geometry.shapes import Box, Shape, ShapeKind, Sphere
from armguard.robot.kinematics import kinematic_table
from armguard.robot.meshes import load_triangles
from armguard.robot.model import Cylinder, MeshFile
from armguard.scene import Scene, SceneTables
from armguard.scene.compile import link_frame
from arrays import Floats
from peers.mujoco_margin import GEOM, bodies_of, geom, placed

# Distance up to which the model reports pairs [m].
SIGHT = 0.06

# Elements of links as their files have them: what, and its frame in the body's, (4, 4).
Element = Shape | Cylinder | MeshFile
Elements = dict[str, list[tuple[Element, Floats]]]


class JudgeModel:
    """The model, and whose its geoms are.

    A body of the model belongs to one 'robot/link' or object, so that what the scene
    does not check is left out body by body. Links that have exact geometry are built
    from their files, not from what the guard made of them; meshes in convex parts, of
    which MuJoCo takes the hulls.

    Attributes:
        model: MuJoCo's model.
        owners: 'robot/link' or object of each geom.
        arm_of: Number of the arm each geom belongs to, -1 for objects, shape (g,).
        bases: Number of the body of each arm's base.
        roots: Numbers of the bodies of each arm that stand in the world.
        objects: Number of the body of each object.
    """

    def __init__(self, scene: Scene, tables: SceneTables) -> None:
        self.robots = tuple(scene.robots)
        owned: dict[str, list[int]] = {name: [] for name in scene.objects}
        for i, owner in enumerate(tables.body_names):
            owned.setdefault(owner, []).append(i)
        self.model = model_of(tables, owned, own_elements(scene))
        m = self.model
        names = [m.body(int(m.geom_bodyid[g])).name for g in range(m.ngeom)]
        self.owners = [name.removeprefix("o:") for name in names]
        self.arm_of = np.array([self.arm(owner) for owner in self.owners])
        firsts = [m.body(f"b{b}").id for b in np.flatnonzero(tables.parent < 0)]
        self.bases = dict(zip(self.robots, firsts, strict=True))
        self.roots = {name: [body] for name, body in self.bases.items()}
        for body in range(1, m.nbody):
            name = m.body(body).name
            if m.body_parentid[body] == 0 and name.startswith("o:") and "/" in name:
                self.roots[name[2:].split("/", 1)[0]].append(body)
        self.objects = {name: m.body(f"o:{name}").id for name in scene.objects}

    def arm(self, owner: str) -> int:
        """Number of the arm a body belongs to, -1 if to none."""
        robot = owner.split("/", 1)[0]
        return self.robots.index(robot) if "/" in owner else -1


def own_elements(scene: Scene) -> Elements:
    """The elements of each link that has exact geometry of its own."""
    found: Elements = {}
    for name, robot in scene.robots.items():
        table = kinematic_table(robot.model)
        for link, fit in robot.fits.items():
            elements = robot.model.links[link].collisions
            if not fit.exact:
                continue
            frame = link_frame(robot, table, link)
            found[f"{name}/{link}"] = [
                (c.geometry, frame @ c.T_link_geometry) for c in elements
            ]
    return found


def model_of(
    tables: SceneTables, owned: Mapping[str, list[int]], elements: Elements
) -> mujoco.MjModel:
    """The model, with a body for each owner.

    Args:
        tables: The scene's tables.
        owned: Primitives of each owner.
        elements: See `own_elements`.

    Raises:
        ValueError: The judge has no shape for a primitive or an element.
    """
    rounded = (tables.kinds == ShapeKind.BOX) & (tables.local_rows[:, 0] > 0.0)
    spec = mujoco.MjSpec()
    spec.memory = 64 << 20
    spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_FILTERPARENT
    for b, above in bodies_of(spec, tables):
        for owner in [o for o, own in owned.items() if tables.bodies[own[0]] == b]:
            body = above.add_body(name=f"o:{owner}")
            for i in [] if owner in elements else owned[owner]:
                if rounded[i]:
                    raise ValueError("the judge has no rounded boxes")
                shape = geom(int(tables.kinds[i]), tables.local_rows[i])
                body.add_geom(margin=SIGHT, **shape)
            for k, (geometry, T) in enumerate(elements.get(owner, [])):
                for shape in geoms_of(spec, f"{owner}:{k}", geometry):
                    body.add_geom(margin=SIGHT, **shape, **placed(T))
    group = {owner: tables.groups[own[0]] for owner, own in owned.items()}
    for a, b in combinations(owned, 2):
        if not tables.checked[group[a], group[b]]:
            spec.add_exclude(bodyname1=f"o:{a}", bodyname2=f"o:{b}")
    return spec.compile()


def geoms_of(
    spec: mujoco.MjSpec, name: str, geometry: Element
) -> Iterator[dict[str, Any]]:
    """An element of a link as attributes of geoms: a mesh is one for each convex part.

    Args:
        spec: Where meshes are added.
        name: Begins their names.
        geometry: The element.
    """
    if not isinstance(geometry, MeshFile):
        yield element(geometry)
        return
    triangles = load_triangles(geometry).reshape(-1, 3, 3)
    for i, part in enumerate(convex_parts(triangles)):
        yield hull(spec, f"m:{name}:{i}", part)


def hull(spec: mujoco.MjSpec, name: str, vertices: Floats) -> dict[str, Any]:
    """The hull of vertices, shape (k, 3) [m], as the attributes of a geom."""
    spec.add_mesh(name=name, uservert=vertices.ravel())
    return {"type": GEOM.mjGEOM_MESH, "meshname": name}


def element(geometry: Shape | Cylinder) -> dict[str, Any]:
    """What a link's element is, about the origin of its frame, as a geom's attributes.

    Raises:
        ValueError: The judge has no such shape.
    """
    if isinstance(geometry, Cylinder):
        size = (geometry.radius, geometry.length / 2.0, 0.0)
        return {"type": GEOM.mjGEOM_CYLINDER, "size": size}
    if isinstance(geometry, Sphere):
        radius = geometry.radius + geometry.rounding
        return {"type": GEOM.mjGEOM_SPHERE, "size": (radius, 0.0, 0.0)}
    if isinstance(geometry, Box) and geometry.rounding == 0.0:
        return {"type": GEOM.mjGEOM_BOX, "size": geometry.half_extents}
    raise ValueError(f"the judge has no shape for {type(geometry).__name__}")


# Triangles are divided if that makes their hulls smaller than this share [-], and so
# often in turn at most.
SMALLER = 0.9
DEEPEST = 5

# What flat parts are made thick by, for a hull to have a volume, each way [m].
THICK = 1e-6


def convex_parts(triangles: Floats, depth: int = 0) -> Iterator[Floats]:
    """Vertices of convex parts that cover a mesh, each of shape (k, 3).

    Args:
        triangles: Corners of its triangles, shape (n, 3, 3) [m].
        depth: How often they were divided already.
    """
    halves = best_halves(triangles) if depth < DEEPEST else None
    if halves is None:
        yield solid_vertices(triangles)
        return
    for half in halves:
        yield from convex_parts(half, depth + 1)


def best_halves(triangles: Floats) -> tuple[Floats, Floats] | None:
    """The division across an axis with the smallest hulls; None if none is worth it."""
    whole = hull_volume(triangles)
    best, found = SMALLER * whole, None
    middles = triangles.mean(axis=1)
    for axis in range(3):
        for cut in np.quantile(middles[:, axis], (0.25, 0.5, 0.75)):
            low = middles[:, axis] < cut
            if not 0 < low.sum() < len(low):
                continue
            volume = hull_volume(triangles[low]) + hull_volume(triangles[~low])
            if volume < best:
                best, found = volume, (triangles[low], triangles[~low])
    return found


def hull_volume(triangles: Floats) -> float:
    """Volume of the convex hull of triangles, 0 if they are flat [m³]."""
    try:
        return float(ConvexHull(triangles.reshape(-1, 3)).volume)
    except QhullError:
        return 0.0


def solid_vertices(triangles: Floats) -> Floats:
    """Their vertices, each once; flat ones are made thick by next to nothing."""
    vertices = np.unique(triangles.reshape(-1, 3), axis=0)
    try:
        ConvexHull(vertices)
    except QhullError:
        sides = [-THICK, THICK]
        offsets = np.stack(np.meshgrid(sides, sides, sides), axis=-1).reshape(-1, 1, 3)
        vertices = (vertices + offsets).reshape(-1, 3)
    return vertices
