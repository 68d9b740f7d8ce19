"""Between an operator and the robots: guards by response, and peers."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from armguard import Guard
from armguard.respond.command import Action
from armguard.scene.settings import ResponseName
from arrays import Floats
from reach.arena import Arena
from reach.operators import Asked, Operator
from reach.peer import PEERS, MinkPeer
from reach.scenes import build_scene

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
    """Turns what is asked for into orders."""

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

    What the operator asks for counts only as whether he wants anything: after a stop
    he begins again by engaging the robots. Places on his way are not known to it. Where
    he has no goal he steers himself.

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
