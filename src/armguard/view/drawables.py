"""What the verdict says of a cycle, drawn: bodies, near pairs, what they need."""

from collections.abc import Iterable
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from trimesh import Trimesh
from trimesh.util import concatenate
from viser.transforms import SE3, SO3

from armguard.geometry.shapes import Shape, shape_row
from armguard.guard.levels import Level
from armguard.guard.near_pair import NearPair
from armguard.guard.watch import HYSTERESIS, SLOW_TIME_DEFAULT
from armguard.recording.palette import (
    BLUE,
    FIXTURE,
    GRASPABLE,
    GREEN,
    PLACED,
    ROBOT_TINTS,
    STATE_COLOURS,
    STATE_WORDS,
    Rgb,
)
from armguard.view.meshes import link_meshes, primitive_mesh
from armguard.view.world import Cycle, World

Floats = NDArray[np.float64]

# Nearest pairs with a line, with a label, with shells.
LINES, LABELS, SHELLS = 64, 3, 4

# Labels stand so far apart that they can be read, and so far above their lines [m].
APART, ABOVE = 0.25, np.array([0.0, 0.0, 0.04])

# A shell follows the distance that its pair needs in steps of this [m].
STEP = 0.005


class Drawable:
    """Follows the cycles, in the scene or in the panel.

    Viser sends nothing for a property that is set to what it is already.

    Attributes:
        label: Text of the checkbox that switches it; empty if it is always shown.
        shown: Whether it is drawn.
        every: Time between two drawings [s].

    Args:
        world: The scene of the cycles, on a page.
    """

    label: str = ""
    every: ClassVar[float] = 0.0
    shown = True
    _due = -np.inf

    def __init__(self, world: World) -> None:
        self.world, self.tables = world, world.tables
        self.api, self.gui = world.server.scene, world.server.gui
        self.nodes: dict[Any, Any] = {}

    @classmethod
    def serves(cls, world: World) -> bool:
        """Whether a scene has any of it."""
        return True

    def show(self, shown: bool) -> None:
        """Draw it from the next cycle on, or not."""
        self.shown, self._due = shown, -np.inf

    def follow(self, cycle: Cycle, now: float) -> bool:
        """Draw a cycle, and nothing of an earlier one; whether that is done.

        Args:
            cycle: The cycle.
            now: The present on any clock that rises [s].
        """
        if not self.shown:
            self._hide()
        elif now >= self._due:
            self._due = now + self.every
            self._draw(cycle)
        else:
            return False
        return True

    def _draw(self, cycle: Cycle) -> None:
        raise NotImplementedError

    def _hide(self) -> None:
        for node in self.nodes.values():
            node.visible = False

    def mesh(self, path: str, mesh: Trimesh, colour: Rgb, opacity: Any = None) -> Any:
        """A node of triangles."""
        return self.api.add_mesh_simple(
            path,
            np.asarray(mesh.vertices, dtype=np.float32),
            np.asarray(mesh.faces, dtype=np.uint32),
            color=colour,
            opacity=opacity,
            side="front" if opacity is None else "double",
            cast_shadow=opacity is None,
            receive_shadow=opacity is None,
        )

    def primitive(self, i: Any, grown: float = 0.0) -> Trimesh:
        """Triangles around a primitive of the tables, in the frame of its body."""
        return primitive_mesh(self.tables.kinds[i], self.tables.local_rows[i], grown)


class Bodies(Drawable):
    """Frames of bodies, moved together; nothing is sent of a body at rest."""

    def frames(self, root: str, bodies: Iterable[int]) -> None:
        """Add the frames of some bodies below a root."""
        self._poses = np.full((len(self.tables.parent), 12), np.nan)
        for k in sorted(set(bodies)):
            self.nodes[k] = self.api.add_frame(f"/{root}/{k}", show_axes=False)

    def move(self, poses: Floats) -> None:
        """Move the frames to poses, rows of [R | p], shape (b, 12)."""
        changed = (poses != self._poses).any(axis=1)
        moved = [k for k in self.nodes if changed[k]]
        if moved:
            T = poses[moved].reshape(-1, 3, 4)
            turns = SO3.from_matrix(T[:, :, :3]).wxyz
            for k, p, turn in zip(moved, T[:, :, 3], turns, strict=True):
                self.nodes[k].position, self.nodes[k].wxyz = p, turn
        self._poses[:] = poses

    def links(self, visuals: bool) -> Iterable[tuple[int, int, str, Trimesh]]:
        """Place of the robot, body and name of each link, and its triangles there."""
        for r, (robot, model) in enumerate(self.world.scene.robots.items()):
            for link, mesh in link_meshes(model, visuals).items():
                name = f"{robot}/{link}"
                at = self.tables.links[name]
                yield r, at.body, name, mesh.apply_transform(at.T_body_link)


class Robots(Bodies):
    """Robots with the objects attached to them, where the check had them."""

    def __init__(self, world: World) -> None:
        super().__init__(world)
        tables = self.tables
        self.frames("bodies", range(len(tables.parent)))
        for r, body, name, mesh in self.links(visuals=True):
            tint = ROBOT_TINTS[r % len(ROBOT_TINTS)]
            self.mesh(f"/bodies/{body}/{slug(name)}", mesh, tint)
        names = np.array(list(tables.body_names)[: tables.moving_count])
        for name, item in world.scene.objects.items():
            if item.attached_to is not None:
                own = np.flatnonzero(names == name)
                path = f"/bodies/{tables.bodies[own[0]]}/{slug(name)}"
                self.mesh(
                    path, concatenate([self.primitive(i) for i in own]), GRASPABLE
                )

    def _draw(self, cycle: Cycle) -> None:
        self.move(cycle.frame.poses)


class Objects(Drawable):
    """Objects that stand still, may come and go, or may be gripped."""

    def __init__(self, world: World) -> None:
        super().__init__(world)
        self._shapes: dict[str, Shape] = {}
        self._revision = -1
        for name, item in self.tables.standing.items():
            colour = FIXTURE if item.present else PLACED
            path = f"/objects/{slug(name)}"
            if item.body >= 0:
                path, colour = f"/bodies/{item.body}/{slug(name)}", GRASPABLE
            rows = zip(
                self.tables.kinds[item.places], item.rows(np.eye(4)), strict=True
            )
            parts = [primitive_mesh(kind, row) for kind, row in rows]
            self.nodes[name] = self.mesh(path, concatenate(parts), colour)

    def _draw(self, cycle: Cycle) -> None:
        objects = self.world.objects
        if objects.revision == self._revision:
            return
        self._revision = objects.revision
        for name, T in objects.poses.items():
            node, item = self.nodes[name], self.tables.standing[name]
            node.visible = T is not None
            if T is None or item.body >= 0:
                continue
            put(node, T)
            shape = objects.shapes.get(name)
            if shape is not None and self._shapes.get(name) != shape:
                self._shapes[name] = shape
                row = shape_row(shape, item.shapes[0].pose.matrix())
                mesh = primitive_mesh(shape.kind, row)
                node.vertices = np.asarray(mesh.vertices, dtype=np.float32)
                node.faces = np.asarray(mesh.faces, dtype=np.uint32)


class Primitives(Drawable):
    """The primitives that moving bodies are measured by."""

    label = "Checked primitives"
    shown = False

    def _draw(self, cycle: Cycle) -> None:
        for i, body in enumerate(self.tables.bodies[: self.tables.moving_count]):
            if i not in self.nodes:
                path = f"/bodies/{body}/primitive_{i}"
                self.nodes[i] = self.mesh(path, self.primitive(i, 1e-3), BLUE, 0.35)
            self.nodes[i].visible = True


class NearPairs(Drawable):
    """Lines between the witness points of near pairs, and labels of the nearest."""

    def __init__(self, world: World) -> None:
        super().__init__(world)
        none = np.zeros((1, 2, 3))
        self._lines = self.api.add_line_segments(
            "/near/lines", none, none.astype(np.uint8), thickness=0.008, visible=False
        )
        for k in range(LABELS):
            self.nodes[k] = self.api.add_label(
                f"/near/label_{k}", "", visible=False, anchor="bottom-center"
            )

    def _draw(self, cycle: Cycle) -> None:
        pairs, slow = cycle.pairs[:LINES], slow_time(cycle)
        self._lines.visible = bool(pairs)
        if pairs:
            points = np.array([[pair.point_a, pair.point_b] for pair in pairs])
            colours = np.array([[pair_look(pair, slow)[0]] * 2 for pair in pairs])
            self._lines.points = points.astype(np.float32)
            self._lines.colors = colours.astype(np.uint8)
        labelled = apart(pairs)
        for k, label in self.nodes.items():
            label.visible = k < len(labelled)
            if k < len(labelled):
                pair = labelled[k]
                label.position = middle_of(pair) + ABOVE
                word = pair_look(pair, slow)[1]
                label.text = f"{word} {pair.distance * 1e3:.0f} mm"


class Shells(Drawable):
    """The distance that each of the nearest pairs needs, around moving primitives.

    Where both sides move each has half of it, so that shells meet just when the pair
    has no headroom left.
    """

    label = "Room each pair needs"

    def __init__(self, world: World) -> None:
        super().__init__(world)
        self._index = {label: i for i, label in enumerate(self.tables.labels)}
        self._steps: dict[int, int] = {}

    def _draw(self, cycle: Cycle) -> None:
        wanted: dict[int, tuple[float, Rgb]] = {}
        slow = slow_time(cycle)
        for pair in cycle.pairs[:SHELLS]:
            # Sensed cells are no primitives of the scene.
            both = [self._index.get(p) for p in (pair.primitive_a, pair.primitive_b)]
            moving = [i for i in both if i is not None and i < self.tables.moving_count]
            for i in moving:
                need = max(pair.needed, STEP) / len(moving)
                if need > wanted.get(i, (0.0,))[0]:
                    wanted[i] = need, pair_look(pair, slow)[0]
        for i in self.nodes.keys() - wanted.keys():
            self.nodes.pop(i).remove()
        for i, (need, colour) in wanted.items():
            steps = round(need / STEP)
            if i not in self.nodes or steps != self._steps[i]:
                path = f"/bodies/{self.tables.bodies[i]}/shell_{i}"
                mesh = self.primitive(i, steps * STEP)
                self.nodes[i] = self.mesh(path, mesh, colour, 0.22)
                self._steps[i] = steps
            self.nodes[i].color = colour

    def _hide(self) -> None:
        while self.nodes:
            self.nodes.popitem()[1].remove()


def middle_of(pair: NearPair) -> Floats:
    """Middle between the witness points of a pair, shape (3,) [m]."""
    return np.asarray((pair.point_a + pair.point_b) / 2.0)


def apart(pairs: Iterable[NearPair]) -> list[NearPair]:
    """The first pairs whose labels do not hide those of the ones before."""
    found: list[NearPair] = []
    for pair in pairs:
        gaps = [np.linalg.norm(middle_of(pair) - middle_of(one)) for one in found]
        if all(gap >= APART for gap in gaps):
            found.append(pair)
    return found[:LABELS]


def put(node: Any, T: Floats) -> None:
    """Move a node to a frame, shape (4, 4)."""
    node.position, node.wxyz = T[:3, 3], SO3.from_matrix(T[:3, :3]).wxyz


def pose_of(node: Any) -> Floats:
    """Frame of a node in the world, shape (4, 4)."""
    turn = SO3(np.asarray(node.wxyz, dtype=np.float64)).normalize()
    T = SE3.from_rotation_and_translation(turn, np.asarray(node.position)).as_matrix()
    return np.asarray(T, dtype=np.float64)


def slug(name: str) -> str:
    """A name as part of a path of nodes."""
    return name.replace("/", "|")


def slow_time(cycle: Cycle) -> float:
    """Time left below which a pair slows an arm in a cycle [s].

    It is longer while an arm is slow, as in the guard.
    """
    slow = cycle.verdict.level is Level.SLOW
    return SLOW_TIME_DEFAULT * (HYSTERESIS if slow else 1.0)


def pair_look(pair: NearPair, slow: float) -> tuple[Rgb, str]:
    """Colour and word of a pair: those of the level that it alone would cause.

    Args:
        pair: The pair.
        slow: Time left below which it slows an arm [s].
    """
    if pair.contract:
        return GREEN, "allowed"
    level = Level.SLOW if pair.time_left < slow else Level.CAUTION
    if not pair.headroom >= 0.0:
        level = Level.STOP
    return STATE_COLOURS[level], STATE_WORDS[level]
