"""Between an operator and the robots: guards by response, and peers."""

import logging
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib.util import find_spec
from math import exp
from typing import Any, NamedTuple

import mujoco
import numpy as np

from armguard import Guard
from armguard.respond.command import Action
from armguard.scene import Scene
from armguard.scene.compile import compile_scene
from armguard.scene.settings import ResponseName
from arrays import Floats
from closed_loop.judge import Judge
from closed_loop.judge_model import JudgeModel
from reach.arena import PERIOD, Arena, build_scene
from reach.operators import Asked, Operator

# Settings of its limit. The first are its defaults: a pair may lose 85 % of what it has
# left in one cycle. The second is the same limit set to begin far away, and to let a
# pair lose all but 1/e in the time ours does.
EARLY = 1.0 - exp(-PERIOD / 0.06)
PEERS: Mapping[str, Mapping[str, float]] = {
    "mink": {},
    "mink_early": {
        "gain": EARLY,
        "minimum_distance_from_collisions": 0.005,
        "collision_detection_distance": 0.10,
    },
}

# The same of its limit of positions: gain [-] and distance from the limits [rad].
POSITIONS: Mapping[str, tuple[float, float]] = {
    "mink": (0.95, 0.0),
    "mink_early": (EARLY, 0.002),
}


def is_installed() -> bool:
    """Whether the peer can be imported."""
    return find_spec("mink") is not None and find_spec("qpsolvers") is not None


class MinkPeer:
    """The nearest velocity by mink: its limits, and a posture a cycle ahead as task.

    Args:
        scene: Where.
        judge: Which pairs of it are checked, and how its joints follow q.
        limits: Least and greatest positions of the joints, and their top speeds, each
            shape (n,).
        name: One of `PEERS`.
    """

    def __init__(
        self,
        scene: Scene,
        judge: Judge,
        limits: tuple[Floats, Floats, Floats],
        name: str,
    ) -> None:
        import mink

        logging.getLogger("mink").setLevel(logging.ERROR)
        self._mink = mink
        model = JudgeModel(scene, compile_scene(scene)).model
        lower, upper, velocity = limits
        self._source, self._gain = judge.source, judge.gain
        self._address = judge.address
        # Joints of the model follow q; those that q does not drive stay.
        velocities = {}
        for place, address, (gain, offset) in zip(
            self._source, self._address, self._gain, strict=True
        ):
            j = int(np.flatnonzero(model.jnt_qposadr == address)[0])
            ends = sorted(gain * x + offset for x in (lower[place], upper[place]))
            model.jnt_range[j], model.jnt_limited[j] = ends, 1
            velocities[model.joint(j).name] = abs(gain) * velocity[place]
        self._configuration = mink.Configuration(model)
        self._task = mink.PostureTask(model, cost=1.0)
        pairs = [([a], [b]) for a, b in judge.pairs]
        self._limits: list[Any] = [
            mink.ConfigurationLimit(model, *POSITIONS[name]),
            mink.VelocityLimit(model, velocities),
            mink.CollisionAvoidanceLimit(model, pairs, **PEERS[name]),
        ]
        self.model: mujoco.MjModel = model
        self._q = np.zeros(model.nq)
        self._first = {int(p): k for k, p in reversed([*enumerate(self._source)])}

    def velocity(self, q: Floats, desired: Floats) -> Floats | None:
        """Joint velocities, shape (n,); None where its program has no solution.

        Args:
            q: Measured positions, shape (n,).
            desired: Joint velocities, shape (n,).
        """
        mink, gain = self._mink, self._gain
        self._q[self._address] = gain[:, 0] * q[self._source] + gain[:, 1]
        self._configuration.update(self._q)
        target = self._q.copy()
        target[self._address] += PERIOD * gain[:, 0] * desired[self._source]
        self._task.set_target(target)
        try:
            found = mink.solve_ik(
                self._configuration,
                [self._task],
                PERIOD,
                "daqp",
                limits=self._limits,
            )
        except mink.NoSolutionFound:
            return None
        v = np.zeros(len(q))
        for place, k in self._first.items():
            v[place] = found[self._address[k]] / gain[k, 0]
        return v


RESPONSES: tuple[ResponseName, ...] = ("deflect", "slow", "stop", "field")
ANSWERS = (*RESPONSES, *PEERS)


class Seen(NamedTuple):
    """What was measured.

    Attributes:
        q: Positions, shape (n,).
        v: Velocities, shape (n,).
        stamps: Stamp of each robot [s].
        now: Time of the cycle [s].
    """

    q: Floats
    v: Floats
    stamps: Mapping[str, float]
    now: float


@dataclass(frozen=True, slots=True)
class Orders:
    """What the robots are ordered.

    Attributes:
        velocity: Joint velocities, shape (n,).
        actions: What each robot is to do.
        blocked: Why each does not follow, in a word.
        why: Reason of the cycle, in a word.
        near: The verdict, for the pairs with the least left, if there is one.
    """

    velocity: Floats
    actions: Mapping[str, Action]
    blocked: Mapping[str, str] = field(default_factory=dict)
    why: str = ""
    near: Any = None


class Answering:
    """Turns desired motion into orders."""

    def answer(self, seen: Seen, asked: Asked) -> Orders:
        """Orders, from what was measured."""
        raise NotImplementedError

    def aim(self, operator: Operator) -> None:
        """Take note of what the operator wants, at the beginning."""

    def reset(self) -> None:
        """Begin anew."""


class Guarded(Answering):
    """A guard of ours."""

    def __init__(self, guard: Guard) -> None:
        self.guard = guard

    def answer(self, seen: Seen, asked: Asked) -> Orders:
        """See `Answering`."""
        q, v, stamps, now = seen
        if asked.twists is None:
            command = self.guard.filter(q, asked.joints, stamps, velocity=v, now=now)
        else:
            command = self.guard.filter_twists(
                q, asked.twists, stamps, velocity=v, now=now
            )
        blocked = {name: why.name for name, why in command.blocked.items()}
        verdict = command.verdict
        why = verdict.reason.name
        return Orders(command.velocity, command.actions, blocked, why, verdict)

    def reset(self) -> None:
        """See `Answering`."""
        self.guard.reset()


class Fielded(Guarded):
    """A guard of ours whose fields know the goal, and lead there by themselves.

    Of desired motion only its presence counts: after a stop the operator begins again
    by engaging the robots. Places on the operator's way are not known to the fields.
    Without a goal the operator steers.

    Args:
        guard: The guard.
        arena: Where.
    """

    def __init__(self, guard: Guard, arena: Arena) -> None:
        super().__init__(guard)
        self._arena = arena
        self._nothing = np.zeros(len(arena.home))
        self._wanted = False
        self._drawn = False

    def aim(self, operator: Operator) -> None:
        """See `Answering`."""
        goals = operator.goals(self._arena)
        self._wanted, self._drawn = False, bool(goals)
        for name, goal in goals.items():
            what = "pose" if goal.shape == (4, 4) else "q"
            self.guard.field_goal(name, **{what: goal})

    def answer(self, seen: Seen, asked: Asked) -> Orders:
        """See `Answering`."""
        if not self._drawn:
            return super().answer(seen, asked)
        wanted = bool(np.any(asked.joints))
        if wanted and not self._wanted:
            self.guard.engage()
        self._wanted = wanted
        return super().answer(seen, Asked(self._nothing))


class Peer(Answering):
    """A peer; it never stops a robot, and orders rest where it finds no solution."""

    def __init__(self, arena: Arena, peer: MinkPeer) -> None:
        self._peer = peer
        self._follow = dict.fromkeys(arena.robots, Action.FOLLOW)

    def answer(self, seen: Seen, asked: Asked) -> Orders:
        """See `Answering`."""
        found = self._peer.velocity(seen.q, asked.joints)
        if found is None:
            return Orders(np.zeros(len(seen.q)), self._follow, why="NO_SOLUTION")
        return Orders(found, self._follow)


def answering(arena: Arena, name: str) -> Answering:
    """A guard or a peer, by name."""
    if name in PEERS:
        limits = arena.lower, arena.upper, arena.velocity
        scene = build_scene(arena.name, "deflect")
        return Peer(arena, MinkPeer(scene, arena.judge, limits, name))
    guard = arena.guard(name)  # type: ignore[arg-type]
    return Fielded(guard, arena) if name == "field" else Guarded(guard)
