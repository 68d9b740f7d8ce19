"""A scene's true geometry as a MuJoCo model: capsules, boxes, spheres, raw meshes."""

from collections.abc import Iterator
from itertools import combinations

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
from peers.mujoco_margin import as_text, quaternion

# Distance up to which the model reports pairs [m].
SIGHT = 0.06

# The same as an attribute of every geom.
MARGIN = f'margin="{SIGHT!r}"'

# Elements of links as their files have them: what, and its frame in the body's, (4, 4).
Elements = dict[str, list[tuple[Shape | Cylinder | MeshFile, Floats]]]


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
        text = mjcf(scene, tables, own_elements(scene))
        self.model = mujoco.MjModel.from_xml_string(text)
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


def mjcf(scene: Scene, tables: SceneTables, elements: Elements) -> str:
    """The model as text."""
    owned: dict[str, list[int]] = {name: [] for name in scene.objects}
    for i, owner in enumerate(tables.body_names):
        owned.setdefault(owner, []).append(i)
    inner: dict[int, str] = {}
    assets = ""
    for owner, own in owned.items():
        shapes = (
            []
            if owner in elements
            else [primitive(int(tables.kinds[i]), tables.local_rows[i]) for i in own]
        )
        for k, (geometry, T) in enumerate(elements.get(owner, [])):
            at = placed(T)
            if not isinstance(geometry, MeshFile):
                shapes.append(f"<geom {kind_and_size(geometry)} {MARGIN} {at}/>")
                continue
            triangles = load_triangles(geometry).reshape(-1, 3, 3)
            for i, part in enumerate(convex_parts(triangles)):
                mesh = f"m:{owner}:{k}:{i}"
                assets += f'<mesh name="{mesh}" vertex="{as_text(part.ravel())}"/>'
                shapes.append(f'<geom type="mesh" mesh="{mesh}" {MARGIN} {at}/>')
        body = int(tables.bodies[own[0]])
        geoms = "".join(shapes)
        inner.setdefault(body, "")
        inner[body] += f'<body name="o:{owner}">{geoms}</body>'
    children: dict[int, list[int]] = {}
    for b, up in enumerate(tables.parent):
        children.setdefault(int(up), []).append(b)

    def tree(b: int) -> str:
        below = "".join(tree(child) for child in children.get(b, []))
        return joint(tables, b) + inner.get(b, "") + below + "</body>"

    bodies = "".join(tree(b) for b in children[-1])
    return (
        "<mujoco><option><flag filterparent='disable'/></option>"
        "<size memory='64M'/>"
        f"<asset>{assets}</asset>"
        f"<worldbody>{inner.get(-1, '')}{bodies}</worldbody>"
        f"<contact>{exclusions(tables, owned)}</contact></mujoco>"
    )


def joint(tables: SceneTables, b: int) -> str:
    """A body of the tables with its joint; left open for what rides on it."""
    T = tables.T_parent_joint[b].reshape(3, 4)
    inertial = '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>'
    text = f'<body name="b{b}" {placed(T)}>{inertial}'
    kind = {1: "hinge", 2: "slide"}.get(int(tables.joint_kind[b]))
    if kind is None:
        return text
    axis = as_text(tables.axis[b])
    return text + f'<joint name="j{b}" type="{kind}" axis="{axis}"/>'


def placed(T: Floats) -> str:
    """A frame of three or four rows as attributes."""
    return f'pos="{as_text(T[:3, 3])}" quat="{quaternion(T[:3, :3])}"'


def kind_and_size(geometry: Shape | Cylinder) -> str:
    """What a link's element is, about the origin of its frame.

    Raises:
        ValueError: The judge has no such shape.
    """
    if isinstance(geometry, Cylinder):
        return f'type="cylinder" size="{geometry.radius!r} {geometry.length / 2.0!r}"'
    if isinstance(geometry, Sphere):
        return f'type="sphere" size="{geometry.radius + geometry.rounding!r}"'
    if isinstance(geometry, Box) and geometry.rounding == 0.0:
        return f'type="box" size="{as_text(np.array(geometry.half_extents))}"'
    raise ValueError(f"the judge has no shape for {type(geometry).__name__}")


def primitive(kind: int, row: Floats) -> str:
    """A primitive as a geom.

    Raises:
        ValueError: The judge has no such shape.
    """
    at = f'pos="{as_text(row[1:4])}"'
    size = repr(float(row[0]))
    if kind == ShapeKind.CAPSULE:
        at = f'fromto="{as_text(row[1:7])}"'
    elif kind == ShapeKind.BOX and row[0] == 0.0:
        size = as_text(row[4:7])
        at += f' quat="{quaternion(row[7:16].reshape(3, 3))}"'
    elif kind != ShapeKind.SPHERE:
        raise ValueError(f"the judge has no shape for {ShapeKind(kind).name}")
    return f'<geom {MARGIN} type="{ShapeKind(kind).name.lower()}" size="{size}" {at}/>'


def exclusions(tables: SceneTables, owned: dict[str, list[int]]) -> str:
    """Pairs of owners the scene does not check."""
    group = {owner: tables.groups[own[0]] for owner, own in owned.items()}
    return "".join(
        f'<exclude body1="o:{a}" body2="o:{b}"/>'
        for a, b in combinations(owned, 2)
        if not tables.checked[group[a], group[b]]
    )


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
