"""A scene with its judge and its guards, built once for many trials."""

from collections.abc import Sequence
from functools import cached_property

import mujoco
import numpy as np
from numpy.typing import NDArray

from armguard import Guard
from armguard.robot.stopping import StoppingFigures
from armguard.scene.compile import compile_scene
from armguard.scene.settings import ResponseName
from arrays import Floats, Ints
from closed_loop.judge import Judge
from reach.scenes import TOOLS, build_scene

# Joints with less room than this, grippers, keep their place [rad or m]; so does a
# head.
ROOM = 0.1
HEADS = ("head_pan",)


class Arena:
    """Where trials of one scene take place.

    Attributes:
        name: Name of the scene.
        judge: MuJoCo on what is true.
        robots: Names of the robots.
        figures: Declared figures of each.
        first: First joint of each robot, and n, shape (r + 1,).
        lower: Least joint positions, joints without end within one turn, shape (n,).
        upper: Greatest, shape (n,).
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
        self.tables = tables = compile_scene(scene)
        self.judge = Judge(scene, tables)
        self.robots = tuple(scene.robots)
        figures = [robot.stopping for robot in scene.robots.values()]
        assert all(f is not None for f in figures), f"{name} has no stopping figures"
        self.figures: list[StoppingFigures] = [f for f in figures if f is not None]
        sizes = [len(f.velocity) for f in self.figures]
        self.joint_counts: Ints = np.array(sizes, dtype=np.int64)
        self.first: Ints = np.cumsum([0, *sizes]).astype(np.int64)
        self.lower = np.maximum(tables.lower, -np.pi)
        self.upper = np.minimum(tables.upper, np.pi)
        self.velocity = np.concatenate([f.velocity for f in self.figures])
        self.acceleration = np.concatenate([f.acceleration for f in self.figures])
        self.deceleration = np.concatenate([f.deceleration for f in self.figures])
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
