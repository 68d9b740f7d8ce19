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
from armguard.respond.command import Action
from armguard.scene import Scene, load_scene
from armguard.scene.compile import compile_scene
from armguard.scene.settings import ResponseName
from arrays import Floats
from closed_loop import drives
from closed_loop import plant as plants
from closed_loop.judge import Judge
from closed_loop.scenes import bare_scene, filled
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


def build_scene(name: str, response: ResponseName) -> Scene:
    """A scene in mode "path", all its robots with one response.

    Args:
        name: One of `SCENES`.
        response: What its robots do about what is near.
    """
    bare = load_scene(PUBLIC / FILES[name]) if name in FILES else bare_scene(name)
    scene = Scene(mode="path", period=PERIOD, index=bare.index)
    stopping = {name: robot.stopping for name, robot in bare.robots.items()}
    return filled(
        scene, bare, lambda name: {"stopping": stopping[name], "response": response}
    )


# Joints with less room than this, grippers, keep their place [rad or m]; so does a
# head.
ROOM = 0.1
HEADS = ("head_pan",)


class Arena(Arms):
    """Where trials of one scene take place; see also `Arms`.

    Attributes:
        name: Name of the scene.
        judge: MuJoCo on what is true.
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


@cache
def arena_of(name: str) -> Arena:
    """The arena of a scene; built once in a process."""
    return Arena(name)


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


class Drives(drives.Drives):
    """The robots of a trial; see `drives.Drives`.

    Each follows commands by a delay of its own, as fast as its acceleration lets it,
    and misses them by up to the error of tracking. A stop that is ordered is carried
    out as declared; until it rests the robot hears nothing else.

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
        truth = Truth(rng, [*arena.figures.values()], styles)
        super().__init__(arena, truth, q, cycles * STEPS)
        late = [truth.command_delay(r) for r in range(len(arena.robots))]
        self._late = [int(t / SUBSTEP + 1e-9) for t in late]
        self._sent = np.zeros((cycles + 1, len(q)))
        self._nowhere = np.zeros(len(q))
        self._error = 0.9 * arena.joined("tracking_error")
        self._waves = 2.0 * np.pi * rng.uniform(*WAVES, len(q))
        self._phases = rng.uniform(0.0, 2.0 * np.pi, len(q))

    def measure(self) -> tuple[Floats, Floats, drives.Stamps]:
        """What arrives: positions, velocities, and the stamp of each robot."""
        return self.measured(self.tick // STEPS, self._nowhere)

    def command_delay(self, arm: int) -> float:
        """See `drives.Drives`; the same for all commands of a robot."""
        return self._late[arm] * SUBSTEP

    def obey(self, velocity: Floats, actions: dict[str, Action]) -> list[str]:
        """Take the orders of a cycle; robots for which a stop is new."""
        stopped = []
        self._sent[self.tick // STEPS] = velocity
        for r, name in enumerate(self.arena.robots):
            if actions[name] < Action.STOP:
                plants.release(self.plant, r)
            elif self.order_stop(r, self._nowhere):
                stopped.append(name)
            if actions[name] >= Action.BRAKE:
                self.order_brake(r)
        return stopped

    def move(self) -> slice:
        """Let a cycle pass; the rows of its states."""
        first = self.tick + 1
        for _ in range(STEPS):
            self.advance(self.tick, self.tick + 1, self._driven())
            self.tick += 1
        return slice(first, self.tick + 1)

    def _driven(self) -> Floats:
        """Velocities the drives go for in this substep, shape (n,)."""
        v = np.zeros(len(self._nowhere))
        for own, late in zip(self.arena.own.values(), self._late, strict=True):
            k = (self.tick - late) // STEPS
            if k >= 0:
                v[own] = self._sent[k, own]
        wave = np.sin(self._waves * self.now + self._phases)
        return v + self._error * wave * np.minimum(np.abs(v) / MISSES, 1.0)
