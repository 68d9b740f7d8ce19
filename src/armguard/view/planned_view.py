"""The view of a plan: the swept volumes of its links, and a guard's cycles on it."""

from collections.abc import Container, Iterable, Iterator, Sequence

import numpy as np
import viser
from numpy.typing import NDArray
from trimesh import Trimesh
from trimesh.util import concatenate

from armguard.plans.pieces import Piece
from armguard.plans.plan import Plan
from armguard.plans.proof import PlanProof
from armguard.recording.frames import Frame
from armguard.recording.palette import ROBOT_TINTS, STATE_COLOURS, State
from armguard.recording.recorded import judged
from armguard.respond import Guard
from armguard.scene.scene import Scene
from armguard.view.drawables import Drawable, slug
from armguard.view.meshes import hull_mesh
from armguard.view.recorded_view import RecordedView
from armguard.view.world import Cycle, World

Floats = NDArray[np.float64]

# Cycles of a second, and rows of one where a plan has no times [Hz].
RATE = 30.0

# How far a corner is inside a piece that hides it [m].
INSIDE = 1e-6

# Opacity of pieces, and of those in which a pair may be too near [-].
CLEAR, CLASHING = 0.22, 0.5


class SweptVolumes(Drawable):
    """The swept volumes of one robot's links; clashing pieces in the colour of a stop.

    Args:
        world: The scene.
        robot: Number of the robot.
        pieces: The pieces of its links.
        clashing: Those in which a pair may be too near.
        relative_to: 'robot/link' in whose frame they are; None for the world.
    """

    def __init__(
        self,
        world: World,
        robot: int,
        pieces: Sequence[Piece],
        clashing: Container[int],
        relative_to: str | None,
    ) -> None:
        super().__init__(world)
        self.label = f"Swept volumes of {world.tables.robots[robot].name}"
        root, T = "/sweep", np.eye(4)
        if relative_to is not None:
            self.label += f", seen from {relative_to}"
            frame = world.tables.links[relative_to]
            root, T = f"/bodies/{frame.body}/sweep", frame.T_body_link
        tint, stop = ROBOT_TINTS[robot % len(ROBOT_TINTS)], STATE_COLOURS[State.STOP]
        groups: dict[tuple[str, bool], list[Piece]] = {}
        for piece in pieces:
            groups.setdefault((piece.link, id(piece) in clashing), []).append(piece)
        for (link, clashes), own in groups.items():
            self.nodes[link, clashes] = self.mesh(
                f"{root}/{slug(link)}_{int(clashes)}",
                outside_of(own).apply_transform(T),
                *((stop, CLASHING) if clashes else (tint, CLEAR)),
            )

    def _draw(self, cycle: Cycle) -> None:
        for node in self.nodes.values():
            node.visible = True


class PlannedView(RecordedView):
    """Shows a plan on a time line, with its swept volumes and what is proven of it.

    Args:
        scene: The scene.
        plan: The plan.
        proof: What is proven of it.
        pieces: Its swept volumes.
        relative_to: 'robot/link' in whose frame the pieces are; None for the world.
        met: Of a relative sweep the pieces that this link may meet.
        page_port: Port of the page; 0 for any port that is free.

    Raises:
        StationError: The port is taken.
    """

    def __init__(
        self,
        scene: Scene,
        plan: Plan,
        proof: PlanProof,
        pieces: Sequence[Piece],
        *,
        relative_to: str | None = None,
        met: Sequence[Piece] = (),
        page_port: int = 8080,
    ) -> None:
        super().__init__(scene, planned_frames(scene, plan), page_port)
        clashing = met if relative_to is not None else too_near(pieces, proof)
        marked = {id(piece) for piece in clashing}
        with self.tabs.add_tab("Plan", viser.Icon.ROUTE):
            for r, part in enumerate(self.world.tables.robots):
                own = [p for p in pieces if p.link.startswith(f"{part.name}/")]
                if own:
                    swept = SweptVolumes(self.world, r, own, marked, relative_to)
                    self.drawables.append(swept)
                    self._add_switch(swept)
            self.server.gui.add_markdown(proof.sentence.replace("\n", "\n\n"))

    def when(self, frame: Frame) -> str:
        """The time of the plan, in words."""
        return f"plan at {frame.monotonic:.2f} s"


def too_near(pieces: Iterable[Piece], proof: PlanProof) -> list[Piece]:
    """Pieces of links that may be too near to something while these are there."""
    return [
        piece
        for piece in pieces
        if any(
            piece.link in (one.nearest.a, one.nearest.b)
            and piece.start <= one.end
            and piece.end >= one.start
            for one in proof.intervals
        )
    ]


def planned_frames(scene: Scene, plan: Plan) -> Iterator[Frame]:
    """Cycles of a guard that judges a plan, which obeys no stop.

    Args:
        scene: The scene.
        plan: The plan; without times its rows follow at `RATE`.
    """
    pace = 1.0 if plan.timed else RATE
    start, end = plan.tube.times[[0, -1]] / pace
    times = np.append(np.arange(start, end, 1.0 / RATE), end)
    speeds = plan.tube.velocities(pace * times) * pace
    guard = guard_of(scene)
    fixed = all(part.mode == "fixed" for part in guard.tables.robots)
    q = plan.tube.at(pace * times)
    return judged(guard, q, times, None if fixed else speeds)


def guard_of(scene: Scene) -> Guard:
    """A guard whose cycles are those of a time line."""
    before, scene.period = scene.period, 1.0 / RATE
    try:
        return Guard(scene, self_test=False)
    finally:
        scene.period = before


def outside_of(pieces: Sequence[Piece]) -> Trimesh:
    """Triangles of pieces without those that another piece hides.

    A triangle whose corners are all in a convex piece is in it. Of two pieces that
    share a face the first one keeps it.
    """
    meshes = [hull_mesh(piece.corners) for piece in pieces]
    bounds = np.array([mesh.bounds for mesh in meshes])
    for i, mesh in enumerate(meshes):
        low, high = bounds[i]
        meets = (bounds[:, 0] <= high).all(axis=1) & (bounds[:, 1] >= low).all(axis=1)
        hidden = np.zeros(len(mesh.faces), dtype=bool)
        for j in np.flatnonzero(meets).tolist():
            if i != j:
                one = pieces[j]
                beyond = mesh.vertices @ one.normals.T - one.heights
                limit = -INSIDE if j > i else INSIDE
                hidden |= (beyond.max(axis=1) <= limit)[mesh.faces].all(axis=1)
        mesh.update_faces(~hidden)
    return concatenate(meshes)
