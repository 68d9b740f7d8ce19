"""A scene and everything that is drawn of it."""

import viser

from armguard.guard.answer import names_of
from armguard.scene.compile import compile_scene
from armguard.scene.scene import Scene
from armguard.station.frames import Frame
from armguard.station.view.drawing.bodies import Bodies
from armguard.station.view.drawing.ghost import Ghost
from armguard.station.view.drawing.leaves import Leaves
from armguard.station.view.drawing.near import NearPairs
from armguard.station.view.drawing.stage import set_stage
from armguard.station.view.judged import Judged, judged
from armguard.station.view.placements import Placements


class World:
    """What frames are about, and its drawings.

    Attributes:
        scene: The scene as it was loaded.
        tables: The same as the check has it.
        names: Names of its verdicts.
        placements: Where objects stand.

    Args:
        server: The page's scene, emptied of all that was in it.
        scene: The scene.
    """

    def __init__(self, server: viser.ViserServer, scene: Scene) -> None:
        self.scene = scene
        self.tables = compile_scene(scene)
        self.names = names_of(self.tables)
        self.placements = Placements(scene)
        self._server = server
        server.scene.reset()
        with server.atomic():
            set_stage(server, self.tables)
            self.bodies = Bodies(server, scene, self.tables)
            self.near = NearPairs(server, self.tables)
            self.ghost = Ghost(server, scene, self.tables)
            self.leaves = Leaves(server, self.tables)

    def fits(self, frame: Frame) -> bool:
        """Whether a cycle's frame is about this scene, as far as its sizes tell."""
        same = len(frame.q) == len(self.tables.q_names)
        return same and len(frame.poses) == len(self.tables.parent)

    def judged(self, frame: Frame) -> Judged:
        """A frame with its words."""
        return judged(frame, self.tables, self.names)

    def draw(self, cycle: Judged, now: float) -> None:
        """Draw a cycle, and nothing of an earlier one.

        Args:
            cycle: The cycle.
            now: The present on any clock that rises [s].
        """
        with self._server.atomic():
            self.bodies.move(cycle.frame, self.placements)
            self.near.draw(cycle.verdict)
            self.ghost.draw(cycle.frame)
            self.leaves.draw(cycle.frame, self.placements, now)
