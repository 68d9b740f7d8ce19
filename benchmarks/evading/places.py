"""Where something is thrown at arms, and what MuJoCo says of it."""

from dataclasses import dataclass, field

import numpy as np

from armguard.geometry import Box, Pose, Sphere
from armguard.geometry.shapes import Shape
from armguard.scene import Scene, SceneTables
from armguard.scene.compile import compile_scene
from armguard.scene.settings import ResponseSettings
from arrays import Floats
from closed_loop.judge import FAR, SIGHT
from closed_loop.judge import Judge as PairJudge
from closed_loop.scenes import bare_scene, filled
from episodes.follower import Arms


@dataclass(frozen=True)
class Hit:
    """How the projectile touched an arm first.

    Attributes:
        geom: Geom of the arm.
        link: Its link.
        time: When [s].
        q: True joint positions then, shape (n,) [rad or m].
    """

    geom: int
    link: str
    time: float
    q: Floats


@dataclass
class Findings:
    """What a judge saw in an episode.

    Attributes:
        mover: Least distance of the projectile to an arm, `SIGHT` at most [m].
        others: The same of all other pairs [m].
        hit: What the projectile touched first; None if nothing.
        touched: Other pairs that touched, and when each did first [s].
    """

    mover: float = SIGHT
    others: float = SIGHT
    hit: Hit | None = None
    touched: dict[tuple[str, str], float] = field(default_factory=dict)


class Judge(PairJudge):
    """Distances of all checked pairs on true states, by MuJoCo; see also `PairJudge`.

    Attributes:
        links: Geoms of each arm's links that joints move, by the arm's name.
        fixtures: Geoms of all that is fixed.

    Args:
        scene: The scene.
        tables: Its tables.
        mover: Name of the projectile.
        origin: Where the scene has it, shape (3,) [m].
    """

    def __init__(
        self, scene: Scene, tables: SceneTables, mover: str, origin: Floats
    ) -> None:
        super().__init__(scene, tables)
        self._mover, self._origin = mover, origin
        self._geom = own = self.owners.index(mover)
        self._checked = {a if b == own else b for a, b in self.pairs if own in (a, b)}
        moved = self.model.body_weldid[self.model.geom_bodyid] != 0
        self.links = {
            name: [g for g in self.arm(k) if moved[g]]
            for k, name in enumerate(scene.robots)
        }
        fixed = np.flatnonzero(self.arm_of < 0).tolist()
        self.fixtures = [g for g in fixed if g != own]

    def middle(self, geom: int) -> Floats:
        """Middle of a geom in the state that was looked at last, shape (3,) [m]."""
        return np.array(self.data.geom_xpos[geom])

    def put(self, q: Floats, mover: Floats | None) -> None:
        """Take a state: joint positions, and where the projectile is, if anywhere."""
        at = self._origin if mover is None else mover
        self.stand_at(self._mover, at - self._origin)
        self.place(q)

    def least(self, q: Floats, mover: Floats | None) -> tuple[float, float]:
        """Least distances of the projectile to an arm, and of all others [m]."""
        self.put(q, mover)
        distances, geoms = self.measure(q)
        ours = (geoms == self._geom).any(axis=1)
        sides = (distances[ours], distances[~ours])
        one, other = (float(side.min(initial=SIGHT)) for side in sides)
        return one, other

    def gap_to(self, geoms: list[int]) -> float:
        """Least distance of the projectile to some geoms in the state put last [m]."""
        return min((self.gap((g, self._geom)) for g in geoms), default=FAR)

    def arm(self, robot: int) -> list[int]:
        """Geoms of an arm that are checked against the projectile."""
        return [g for g in self._checked if self.arm_of[g] == robot]

    def way_off(self, robot: int) -> Floats:
        """How each joint opens the arm's nearest link to the projectile, shape (n,)."""
        found = (self.apart((g, self._geom)) for g in self.arm(robot))
        return min(found, key=lambda f: f[0])[1]

    def look(
        self, q: Floats, mover: Floats | None, time: float, found: Findings
    ) -> None:
        """Judge a true state."""
        self.put(q, mover)
        distances, geoms = self.measure(q)
        for distance, (a, b) in zip(distances.tolist(), geoms.tolist(), strict=True):
            if self._geom in (a, b):
                geom = a if b == self._geom else b
                if distance <= 0.0 and found.hit is None:
                    found.hit = Hit(geom, self.owners[geom], time, q)
                found.mover = min(found.mover, distance)
                continue
            if distance <= 0.0:
                found.touched.setdefault((self.owners[a], self.owners[b]), time)
            found.others = min(found.others, distance)


# Time from one cycle to the next [s], and the distance that is required [m].
PERIOD, BUFFER = 0.004, 0.005

# What comes, by name, and where it is while it is not there [m].
MOVER = "mover"
AWAY = (0.0, 0.0, 50.0)

# Half of its sizes; a ball's radius [m].
SIZES = (0.03, 0.08)


@dataclass(frozen=True)
class Projectile:
    """What comes; it does not turn.

    Attributes:
        half: Half of a box's sizes, shape (3,); all of them the radius of a ball [m].
        turn: Roll, pitch and yaw [rad].
        is_box: Whether it is a box.
        top_speed: The speed it is declared to have at most [m/s].
    """

    half: tuple[float, float, float]
    turn: tuple[float, float, float]
    is_box: bool
    top_speed: float

    @property
    def shape(self) -> Shape:
        """Its shape."""
        sides = tuple(2.0 * h for h in self.half)
        return Box(size=sides) if self.is_box else Sphere(radius=self.half[0])

    def at(self, xyz: Floats) -> Pose:
        """Its frame where it is in a place [m]."""
        return Pose(xyz=tuple(xyz.tolist()), rpy=self.turn)


class Place(Arms):
    """A scene with a projectile that may come, and its judge; see also `Arms`.

    Attributes:
        scene: The scene; the projectile is not there.
        judge: The judge.
        limits: Least and greatest positions of the joints, shape (2, n) [rad or m].

    Args:
        name: Which of the scenes, "bay" or "pandas".
        projectile: What may come.
        evade: Whether the arms get out of its way.
    """

    def __init__(self, name: str, projectile: Projectile, *, evade: bool) -> None:
        self.scene = built(name, projectile, evade)
        super().__init__(compile_scene(self.scene))
        self.judge = Judge(self.scene, self.tables, MOVER, np.array(AWAY))
        self.limits = np.array([self.lower, self.upper])


def room_of(name: str, evade: bool) -> Scene:
    """Arms and fixtures of a place, without what comes.

    Args:
        name: Which, a key of `closed_loop.scenes.bare_scene`.
        evade: Whether the arms get out of its way.
    """
    bare = bare_scene(name)
    scene = Scene(mode="path", period=PERIOD, index=bare.index, buffer=BUFFER)
    evades = ResponseSettings(evade=evade)
    filled(
        scene,
        bare,
        lambda name: {"stopping": bare.robots[name].stopping, "response": evades},
    )
    return scene


def built(name: str, projectile: Projectile, evade: bool) -> Scene:
    """The scene of the guard."""
    scene = room_of(name, evade)
    scene.add(
        projectile.shape,
        name=MOVER,
        pose=projectile.at(np.array(AWAY)),
        present=False,
        top_speed=projectile.top_speed,
    )
    return scene
