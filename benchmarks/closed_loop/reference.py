"""A slow guard that asks the search every cycle: how much freedom there could be."""

from collections.abc import Collection, Mapping, Sequence

import numpy as np

from armguard.robot.stopping import StoppingFigures
from armguard.scene import Scene
from armguard.scene.compile import compile_scene
from arrays import Floats
from closed_loop.answers import Guarding
from closed_loop.exact_world import ExactWorld
from closed_loop.search import Breach, Search
from closed_loop.settings import Setting

# How often the search turns every joint for a verdict, and to call a stop needless.
SWEEPS = 0
THOROUGH = 2


class Reference(Guarding):
    """Stops the arms of a pair as soon as some admissible future breaks its floor.

    Far too slow for a loop. It stops later than a guard may that has to prove what this
    one only samples: what it lets through is the most that can be asked for.

    Args:
        scene: The scene.
        figures: Figures of each arm.
        setting: Its period, lateness, floor and speeds.
        movers: Objects that move.
    """

    def __init__(
        self,
        scene: Scene,
        figures: Sequence[StoppingFigures],
        setting: Setting,
        movers: Sequence[str],
    ) -> None:
        tables = compile_scene(scene)
        super().__init__(scene.robots)
        self._origins = {n: scene.objects[n].pose.matrix()[:3, 3] for n in movers}
        self._world = ExactWorld(scene, tables)
        sizes = [len(f.velocity) for f in figures]
        self._search = Search(
            self._world,
            figures,
            self.robots,
            np.cumsum([0, *sizes]).astype(np.int64),
            wait=setting.period + setting.late,
            floor=setting.floor,
            speeds=dict.fromkeys(movers, setting.top_speed),
        )
        self._seen: dict[str, float] = {}

    def place(self, name: str, T: Floats, stamp: float) -> None:
        """See `Guarding`."""
        self._world.shift(name, T[:3, 3] - self._origins[name])
        self._seen[name] = stamp

    def stopped(
        self, q: Floats, stamp: Mapping[str, float], velocity: Floats, now: float
    ) -> Collection[str]:
        """See `Guarding`."""
        breach = self.breach(q, stamp, velocity, now, SWEEPS)
        sides = () if breach is None else breach.pair
        return {side.split("/")[0] for side in sides if "/" in side}

    def breach(
        self,
        q: Floats,
        stamp: Mapping[str, float],
        velocity: Floats,
        now: float,
        sweeps: int,
    ) -> Breach | None:
        """A future in which a pair breaks its floor if no stop is ordered now."""
        stamps = np.array([stamp[name] for name in self.robots])
        seen = min(self._seen.values(), default=now)
        return self._search.breach(q, velocity, stamps, seen, now, sweeps)

    def reset(self) -> None:
        """See `Guarding`."""
        self._seen.clear()
