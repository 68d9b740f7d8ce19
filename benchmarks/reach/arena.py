"""Where trials take place: scenes, their judge and guards, and robots that obey late.

Scenes and guards are built once for many trials. Robots do as they are ordered, late
and not quite, within their figures.
"""

from collections.abc import Mapping, Sequence
from functools import cache, cached_property
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from armguard import Guard
from armguard.geometry import Box, Cylinder, PlacedShape
from armguard.respond.command import Action
from armguard.scene import Scene, bay_scene, load_scene
from armguard.scene.compile import compile_scene
from armguard.scene.settings import ResponseName
from arrays import Floats, Ints
from closed_loop import plant as plants
from closed_loop.judge import Judge
from closed_loop.measuring import Measuring
from closed_loop.scenes import two_pandas
from closed_loop.settings import SUBSTEP
from closed_loop.truth import Styles, Truth, pick
from episodes.follower import Arms

# Where the public planning scenes lie, beside the project.
PUBLIC = Path(__file__).parents[2].parent / "shared" / "motionbench"

# Time from one cycle to the next [s].
PERIOD = 0.001

# Public scenes by name, and the file of each.
FILES: Mapping[str, str] = {
    "panda_table": "table_pick_panda/scene0001.yaml",
    "panda_shelf": "bookshelf_small_panda/scene0001.yaml",
    "baxter_shelf": "bookshelf_tall_both_arms_easy_baxter/scene0001.yaml",
}

SCENES = ("bay", "pandas", *FILES)

# Links operators move, where a robot has more tools than one.
TOOLS: Mapping[str, tuple[str, ...]] = {
    "baxter_shelf": ("baxter/left_gripper", "baxter/right_gripper"),
}


def is_there(name: str) -> bool:
    """Whether what a scene is made of is on this machine."""
    return name not in FILES or (PUBLIC / FILES[name]).exists()


@cache
def bare_scene(name: str) -> Scene:
    """A scene as it is published."""
    if name == "bay":
        return bay_scene("path")
    if name == "pandas":
        return two_pandas()
    return load_scene(PUBLIC / FILES[name])


def build_scene(name: str, response: ResponseName) -> Scene:
    """A scene in mode "path", all its robots with one response.

    Cylinders that stand upright become the boxes round them, for the guard as for the
    judge, which has no cylinders.

    Args:
        name: One of `SCENES`.
        response: What its robots do about what is near.
    """
    bare = bare_scene(name)
    scene = Scene(mode="path", period=PERIOD, index=bare.index)
    for robot in bare.robots.values():
        scene.add_robot(
            robot.model,
            name=robot.name,
            base=robot.base,
            home=robot.home,
            stopping=robot.stopping,
            response=response,
        )
    for body in bare.objects.values():
        assert body.attached_to is None and not body.surfaces, body.name
        scene.add(
            [boxed(part) for part in body.shapes],
            name=body.name,
            pose=body.pose,
        )
    for pair in bare.allowances:
        scene.allow(pair.a, pair.b, reason=pair.reason)
    return scene


def boxed(part: PlacedShape) -> PlacedShape:
    """A placed shape; a cylinder as the box round it."""
    shape = part.shape
    if not isinstance(shape, Cylinder):
        return part
    size = (2.0 * shape.radius, 2.0 * shape.radius, shape.height)
    return PlacedShape(Box(size=size), part.pose)


# Joints with less room than this, grippers, keep their place [rad or m]; so does a
# head.
ROOM = 0.1
HEADS = ("head_pan",)


class Arena(Arms):
    """Where trials of one scene take place; see also `Arms`.

    Attributes:
        name: Name of the scene.
        judge: MuJoCo on what is true.
        first: First joint of each robot, and n, shape (r + 1,).
        velocity: Top speeds, shape (n,).
        acceleration: Accelerations, shape (n,).
        home: Home configuration, shape (n,).
        driven: Which joints operators drive, shape (n,).
        tools: Links operators move.

    Args:
        name: Name of the scene.
    """

    def __init__(self, name: str) -> None:
        self.name = name
        scene = build_scene(name, "deflect")
        tables = compile_scene(scene)
        super().__init__(tables)
        assert len(self.figures) == len(self.robots), f"{name} has no stopping figures"
        self.judge = Judge(scene, tables)
        ends = [own.stop for own in self.own.values()]
        self.first: Ints = np.array([0, *ends], dtype=np.int64)
        self.velocity = self.joined("velocity")
        self.acceleration = self.joined("acceleration")
        self.home = tables.home.copy()
        heads = [q.split("/", 1)[1] in HEADS for q in tables.q_names]
        self.driven = (self.upper - self.lower >= ROOM) & ~np.array(heads)
        self.tools = TOOLS.get(name, self.robots)
        self.links = [
            next(p.tool for p in tables.robots if p.name == tool)
            if tool in self.robots
            else tool
            for tool in self.tools
        ]
        self._frames = [tables.links[link] for link in self.links]
        model = self.judge.model
        self._bodies = [model.body(f"b{f.body}").id for f in self._frames]
        self._guards: dict[ResponseName, Guard] = {}

    def guard(self, response: ResponseName) -> Guard:
        """The guard of the scene whose robots have a response; built once."""
        if response not in self._guards:
            scene = build_scene(self.name, response)
            self._guards[response] = Guard(scene, self_test=False)
        return self._guards[response]

    @cached_property
    def checker(self) -> Guard:
        """A guard that only judges paths: it remembers nothing of a loop."""
        return Guard(build_scene(self.name, "deflect"), self_test=False)

    def is_clear(self, a: Floats, b: Floats) -> bool:
        """Whether the straight line between two configurations is certified."""
        return self.checker.check_path([a, b]).clear

    def moved_by(self, tools: Sequence[str]) -> NDArray[np.bool_]:
        """Which joints belong to the robots of some tools, shape (n,)."""
        robots = {tool.split("/", 1)[0] for tool in tools}
        owners = [q.split("/", 1)[0] in robots for q in self.tables.q_names]
        return np.array(owners)

    def tool_poses(self, q: Floats) -> list[Floats]:
        """Frames of the tools, each shape (4, 4)."""
        self.judge.place(q)
        return [self._placed_tool(k) for k in range(len(self.tools))]

    def tool_state(self, q: Floats) -> tuple[list[Floats], list[Floats]]:
        """Frames of the tools, and how they follow the joints, each (6, n)."""
        poses = self.tool_poses(q)
        data, judge = self.judge.data, self.judge
        mujoco.mj_comPos(judge.model, data)
        found = []
        linear, angular = np.zeros((2, 3, judge.model.nv))
        for k, T in enumerate(poses):
            point = np.ascontiguousarray(T[:3, 3])
            mujoco.mj_jac(judge.model, data, linear, angular, point, self._bodies[k])
            J = np.zeros((6, len(q)))
            both = np.vstack([linear, angular])
            for dof, place, gain in zip(
                judge.address, judge.source, judge.gain[:, 0], strict=True
            ):
                J[:, place] += gain * both[:, dof]
            J[:, ~self.driven] = 0.0
            found.append(J)
        return poses, found

    def _placed_tool(self, k: int) -> Floats:
        """Frame of a tool where the judge was placed, shape (4, 4)."""
        data, body = self.judge.data, self._bodies[k]
        T = np.eye(4)
        T[:3, :3] = data.xmat[body].reshape(3, 3)
        T[:3, 3] = data.xpos[body]
        found: Floats = T @ self._frames[k].T_body_link
        return found


_arenas: dict[str, Arena] = {}


def arena_of(name: str) -> Arena:
    """The arena of a scene; built once in a process."""
    if name not in _arenas:
        _arenas[name] = Arena(name)
    return _arenas[name]


# Substeps of a cycle.
STEPS = round(PERIOD / SUBSTEP)

# How the figures of a trial are drawn: operators mean no harm, and nothing conspires.
TIMES = {"most": 0.4, "random": 0.5, "least": 0.1}
STOPS = {"least": 0.3, "corner": 0.2, "most": 0.1, "random": 0.4}
ERRORS = {"bias": 0.3, "noise": 0.4, "alternating": 0.1, "none": 0.2}

# Speed from which on a drive misses its velocity by all it may [rad/s or m/s].
MISSES = 0.1

# How often that changes its sign, least and most [1/s].
WAVES = (0.3, 3.0)


class Drives:
    """The robots of a trial, and what is measured of them.

    Each follows commands by a delay of its own, as fast as its acceleration lets it,
    and misses them by up to the error of tracking. A stop that is ordered is carried
    out as declared; until it rests the robot hears nothing else.

    Attributes:
        plant: Their true state.
        truth: Their true figures.
        tick: Substeps done.
        q_rows: True positions after each substep, shape (k + 1, n).
        v_rows: True velocities, the same.

    Args:
        arena: Where.
        rng: Of the trial.
        q: Where they are at first, shape (n,).
        cycles: How many there will be at most.
    """

    def __init__(
        self, arena: Arena, rng: np.random.Generator, q: Floats, cycles: int
    ) -> None:
        styles = Styles(pick(rng, TIMES), pick(rng, STOPS), pick(rng, ERRORS), True)
        self._arena = arena
        self.truth = truth = Truth(rng, [*arena.figures.values()], styles)
        self.plant = plants.plant_at(
            q, arena.first, truth.velocity, truth.acceleration, truth.brake
        )
        n, robots = len(q), len(arena.robots)
        ticks = cycles * STEPS
        self.tick = 0
        self.q_rows = np.tile(q, (ticks + 1, 1))
        self.v_rows = np.zeros_like(self.q_rows)
        self._free = np.zeros((ticks + 1, robots), dtype=bool)
        self._measuring = Measuring(truth, arena.first, self.q_rows, self.v_rows)
        late = [truth.command_delay(r) for r in range(robots)]
        self._late = [int(t / SUBSTEP + 1e-9) for t in late]
        self._sent = np.zeros((cycles + 1, n))
        self._nowhere = np.zeros(n)
        self._error = 0.9 * arena.joined("tracking_error")
        self._waves = 2.0 * np.pi * rng.uniform(*WAVES, n)
        self._phases = rng.uniform(0.0, 2.0 * np.pi, n)

    @property
    def now(self) -> float:
        """Time [s]."""
        return self.tick * SUBSTEP

    def measure(self) -> tuple[Floats, Floats, dict[str, float]]:
        """What arrives: positions, velocities, and the stamp of each robot."""
        cycle = self.tick // STEPS
        q, v, stamps = self._measuring.measure(self.tick, cycle, self._nowhere)
        return q, v, dict(zip(self._arena.robots, stamps, strict=True))

    def obey(self, velocity: Floats, actions: dict[str, Action]) -> list[str]:
        """Take the orders of a cycle; robots for which a stop is new."""
        stopped = []
        plant = self.plant
        self._sent[self.tick // STEPS] = velocity
        for r, name in enumerate(self._arena.robots):
            if actions[name] >= Action.STOP:
                if plant.phase[r] == plants.FREE and plant.stop_at[r] == np.inf:
                    stopped.append(name)
                    at = self.now + self._late[r] * SUBSTEP
                    plants.order_stop(plant, r, at, self.truth.stop(self._nowhere))
            else:
                plants.release(plant, r)
            if actions[name] >= Action.BRAKE:
                delay = self.truth.brake_delay(r)
                plants.order_brake(plant, r, self.now + delay)
        return stopped

    def move(self) -> slice:
        """Let a cycle pass; the rows of its states."""
        first = self.tick + 1
        for _ in range(STEPS):
            row = slice(self.tick + 1, self.tick + 2)
            plants.advance(
                self.plant,
                self.tick,
                SUBSTEP,
                self._driven(),
                self.q_rows[row],
                self.v_rows[row],
                self._free[row],
            )
            self.tick += 1
        return slice(first, self.tick + 1)

    def _driven(self) -> Floats:
        """Velocities the drives go for in this substep, shape (n,)."""
        arena = self._arena
        v = np.zeros(len(self._nowhere))
        for r, late in enumerate(self._late):
            own, k = arena.own[arena.robots[r]], (self.tick - late) // STEPS
            if k >= 0:
                v[own] = self._sent[k, own]
        wave = np.sin(self._waves * self.now + self._phases)
        return v + self._error * wave * np.minimum(np.abs(v) / MISSES, 1.0)
