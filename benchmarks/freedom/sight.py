"""What sensors could have seen of a cell, by MuJoCo's rays in the true world."""

from math import pi, sqrt
from typing import NamedTuple

import mujoco
import numpy as np

import armguard as ag
from armguard.scene.compile import compile_scene
from armguard.scene.sensors import SceneSensor
from arrays import Bools, Floats
from closed_loop.judge import Judge

# Points of a cell that are looked for: its corners, the middles of its edges and faces,
# and its own, from there [edges].
PARTS = np.stack(np.meshgrid(*[(-0.4999, 0.0, 0.4999)] * 3), axis=-1).reshape(-1, 3)
MIDDLE = len(PARTS) // 2

# How well a frame sees a cell, the best last.
NOT, BEYOND, HIDDEN, IN_PART, WHOLE, CLEAR = range(6)

WORDS = {
    NOT: "in no view",
    BEYOND: "beyond the sure reach",
    IN_PART: "in part, the rest out of the view",
    WHOLE: "whole, but not what is beside it",
    CLEAR: "seen, and not freed",
}

# Standard deviations of the noise that are taken for its greatest.
SIGMAS = 3.0


class Frame(NamedTuple):
    """A frame of a sensor.

    Attributes:
        name: Name of the sensor.
        q: True joint positions when it was measured, shape (n,) [rad or m].
    """

    name: str
    q: Floats


class Seen(NamedTuple):
    """How well a frame sees a cell; the greater, the better.

    Attributes:
        level: How well, from `NOT` to `CLEAR`.
        count: Points of the cell that it sees.
        hider: Kind of body that hides the others, "" for none.
    """

    level: int = NOT
    count: int = 0
    hider: str = ""

    def __str__(self) -> str:
        """Why the cell may not be known free."""
        if self.level == IN_PART and self.hider:
            return f"in part, the rest behind {self.hider}"
        if self.level == HIDDEN:
            return f"behind {self.hider}"
        return WORDS[self.level]


class Sight:
    """Sensors in the true world.

    Args:
        scene: The scene with the sensors.
        world: The scene with all that is there.
        size: Least diameter of what has to be seen [m].
    """

    def __init__(self, scene: ag.Scene, world: ag.Scene, size: float) -> None:
        self._sensors, self._size = scene.sensors, size
        self._tables = compile_scene(world)
        self._judge = Judge(world, self._tables)
        self._judge.place(world.home)

    def seen(self, cell: Floats, edge: float, frame: Frame) -> Seen:
        """How well a frame sees a cell.

        Args:
            cell: Middle of the cell, world, shape (3,) [m].
            edge: Its edge [m].
            frame: The frame.
        """
        sensor = self._sensors[frame.name]
        T = self._pose(sensor, frame.q)
        local = (cell + edge * PARTS - T[:3, 3]) @ T[:3, :3]
        if not in_view(sensor, local)[MIDDLE]:
            return Seen()
        depth = local[:, 2]
        sure = in_view(sensor, local) & (depth <= sure_reach(sensor, self._size))
        if not sure[MIDDLE]:
            return Seen(BEYOND)
        met, hiders = self._cast(T, local)
        clear = met >= 1.0
        count = int((clear & sure).sum())
        others = sorted(hiders[~clear].tolist())
        hider = max(others, key=others.count, default="")
        if not clear[MIDDLE]:
            return Seen(HIDDEN, count, str(hiders[MIDDLE]))
        if count < len(PARTS):
            return Seen(IN_PART, count, hider)
        # A pixel of an image, or a zone and half of the next one, on each side of it.
        beside = (1.0 if sensor.image else 1.5) / min(sensor.focal)
        a, b, c = sensor.noise
        far = depth.max()
        slack = sensor.error + SIGMAS * (a + b * far + c * far * far)
        wide = local + 2.0 * far * beside * (PARTS @ T[:3, :3]) * (1.0, 1.0, 0.0)
        wide *= ((far + slack) / wide[:, 2])[:, None]
        met, _ = self._cast(T, wide)
        whole = in_view(sensor, wide).all() and bool((met >= 1.0).all())
        return Seen(CLEAR if whole else WHOLE, count)

    def fills(self, cell: Floats, edge: float) -> bool:
        """Whether a foreign object meets a cell."""
        judge = self._judge
        for g, owner in enumerate(judge.owners):
            if not owner.startswith("foreign"):
                continue
            R = judge.data.geom_xmat[g].reshape(3, 3)
            local = (cell + edge * PARTS - judge.data.geom_xpos[g]) @ R
            if (np.abs(local) <= judge.model.geom_size[g]).all(axis=1).any():
                return True
        return False

    def _pose(self, sensor: SceneSensor, q: Floats) -> Floats:
        """Frame of a sensor in the world, shape (4, 4)."""
        self._judge.place(q)
        T = np.asarray(sensor.pose.matrix())
        if sensor.on is None:
            return T
        link = self._tables.links[sensor.on]
        body, base = self._judge.data.body(f"b{link.body}"), np.eye(4)
        base[:3, :3], base[:3, 3] = body.xmat.reshape(3, 3), body.xpos
        return np.asarray(base @ link.T_body_link @ T)

    def _cast(self, T: Floats, points: Floats) -> tuple[Floats, Floats]:
        """Shares of the ways to points of a sensor that are free, and what is met."""
        judge, count = self._judge, len(points)
        far = np.linalg.norm(points, axis=1)
        rays = np.ascontiguousarray(points / far[:, None] @ T[:3, :3].T).reshape(-1)
        ids, way = np.zeros(count, dtype=np.int32), np.zeros(count)
        mujoco.mj_multiRay(
            judge.model, judge.data, T[:3, 3].copy(), rays, None, True, -1, ids, way,
            None, count, 20.0,
        )  # fmt: skip
        met = np.array([kind_of(judge.owners[k]) if k >= 0 else "" for k in ids])
        return np.where(ids >= 0, way, np.inf) / far, met


def kind_of(owner: str) -> str:
    """Kind of a body by its name."""
    if "/" in owner:
        return "an arm"
    return "a foreign object" if owner.startswith("foreign") else "the model"


def in_view(sensor: SceneSensor, local: Floats) -> Bools:
    """Which points are in the view and the range of a sensor; they are in its frame."""
    depth = np.maximum(local[:, 2], 1e-9)
    found = (local[:, 2] > sensor.range[0]) & (local[:, 2] <= sensor.range[1])
    for k in range(2):
        place = local[:, k] / depth * sensor.focal[k] + sensor.middle[k]
        found &= (place >= -0.5) & (place <= sensor.zones[k] - 0.5)
    return np.asarray(found)


def sure_reach(sensor: SceneSensor, size: float) -> float:
    """Depth up to which a disc fills its share of a pixel or a zone.

    With its middle at the corner of four of them a quarter of it is in each.
    """
    return float(min(sensor.focal) * sqrt(pi * size * size / 16.0 / sensor.fill))
