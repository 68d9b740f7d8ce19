"""A scene with its guard and its judge, built once for many episodes."""

from functools import cached_property

import numpy as np

from armguard.scene.compile import compile_scene
from arrays import Floats, Ints
from closed_loop.answers import Guarding
from closed_loop.guards import GUARDS
from closed_loop.judge import Judge
from closed_loop.movers import Movers
from closed_loop.scenes import ROOM, build_scene, movers_of
from closed_loop.search import Reference
from closed_loop.settings import Setting
from closed_loop.torque import TorqueArms, torque_model
from episodes.follower import Arms

# Least distance of any pair in a starting state [m].
START_DISTANCE = 0.02

# Random states tried before a start counts as impossible, and before objects are put
# elsewhere: one may stand where an arm's base is.
TRIES = 20000
TRIES_A_PLACE = 50


class Arena(Arms):
    """Where episodes of one setting take place; see also `Arms`.

    Attributes:
        setting: What is true.
        guard: The guard; something else may be declared to it.
        judge: The judge.
        joint_counts: Number of joints of each arm, shape (a,).
        movers: Names of the objects that move.
        room: Corners of the box in which they bounce, shape (2, 3) [m].

    Args:
        setting: What is true.
        known: What is declared to the guard.
        guard: Name of the guard, in `GUARDS`.
    """

    def __init__(self, setting: Setting, known: Setting, guard: str) -> None:
        scene = build_scene(setting)
        super().__init__(compile_scene(scene))
        self._scene = scene
        self.setting = setting
        self.guard: Guarding = GUARDS[guard](build_scene(known), known)
        self.judge = Judge(scene, self.tables)
        self.joint_counts: Ints = np.diff(self.first)
        self.movers = tuple(movers_of(scene))
        self.room = np.array(ROOM)
        self.poses = {n: scene.objects[n].pose.matrix() for n in self.movers}

    @cached_property
    def reference(self) -> Reference:
        """The search for futures, of what is true."""
        figures = [*self.figures.values()]
        return Reference(self._scene, figures, self.setting, self.movers)

    @cached_property
    def arms(self) -> TorqueArms:
        """The arms with motors of limited torque."""
        return TorqueArms(torque_model(self._scene, [*self.figures.values()]))

    def pose(self, name: str, p: Floats) -> Floats:
        """Frame of a moving object displaced by p, shape (4, 4)."""
        T = self.poses[name].copy()
        T[:3, 3] += p
        return T

    def start(self, rng: np.random.Generator, outer: Floats, movers: Movers) -> Floats:
        """A random state that keeps its distance, shape (n,).

        Args:
            rng: Of the episode.
            outer: How far true surfaces lie outside the model at most [m].
            movers: Objects; they are put elsewhere as long as there is none.

        Raises:
            RuntimeError: None was found.
        """
        needed = START_DISTANCE + 2.0 * float(outer.max(initial=0.0))
        for k in range(TRIES):
            if k % TRIES_A_PLACE == 0:
                for name, p in movers.scatter().items():
                    self.judge.stand_at(name, p)
            # Joints that turn without end start within one turn.
            q = rng.uniform(self.lower, self.upper)
            if self.judge.distance(q) >= needed:
                return q
        raise RuntimeError(f"no start with {needed * 1e3:.0f} mm in {TRIES} tries")
