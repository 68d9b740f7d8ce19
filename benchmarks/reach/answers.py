"""Who stands between an operator and the robots: guards by response, and peers."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

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


@dataclass(frozen=True, slots=True)
class Told:
    """What the robots are told.

    Attributes:
        velocity: Joint velocities, shape (n,).
        actions: What each robot is to do.
        blocked: Why each does not follow, in a word.
        why: Reason of the cycle, in a word.
        near: The nearest pair beyond what it needs, in words, if one is known.
    """

    velocity: Floats
    actions: Mapping[str, Action]
    blocked: Mapping[str, str] = field(default_factory=dict)
    why: str = ""
    near: Any = None


class Answering(Protocol):
    """Turns what is asked for into what is told."""

    def answer(
        self,
        q: Floats,
        v: Floats,
        stamps: Mapping[str, float],
        now: float,
        asked: Asked,
    ) -> Told:
        """What to tell, from what was measured."""

    def aim(self, operator: Operator) -> None:
        """Take note of what the operator wants, at the beginning."""

    def reset(self) -> None:
        """Begin anew."""


class Guarded:
    """A guard of ours."""

    def __init__(self, guard: Guard) -> None:
        self.guard = guard

    def answer(
        self,
        q: Floats,
        v: Floats,
        stamps: Mapping[str, float],
        now: float,
        asked: Asked,
    ) -> Told:
        """See `Answering`."""
        if asked.twists is None:
            command = self.guard.filter(q, asked.joints, stamps, velocity=v, now=now)
        else:
            command = self.guard.filter_twists(
                q, asked.twists, stamps, velocity=v, now=now
            )
        verdict = command.verdict
        return Told(
            command.velocity,
            command.actions,
            {name: why.name for name, why in command.blocked.items()},
            verdict.reason.name,
            verdict,
        )

    def aim(self, operator: Operator) -> None:
        """See `Answering`; it is told at every step."""

    def reset(self) -> None:
        """See `Answering`."""
        self.guard.reset()


class Fielded(Guarded):
    """A guard of ours whose fields know the goal, and lead there by themselves.

    What the operator asks for counts only as whether he wants anything: after a stop
    he begins again by engaging the robots. Places on his way are not told. Where he has
    no goal he steers himself.

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

    def answer(
        self,
        q: Floats,
        v: Floats,
        stamps: Mapping[str, float],
        now: float,
        asked: Asked,
    ) -> Told:
        """See `Answering`."""
        if not self._drawn:
            return super().answer(q, v, stamps, now, asked)
        wanted = bool(np.any(asked.joints))
        if wanted and not self._wanted:
            self.guard.engage()
        self._wanted = wanted
        return super().answer(q, v, stamps, now, Asked(self._nothing))


class Peer:
    """A peer; it never stops a robot, and tells nothing where it finds no solution."""

    def __init__(self, arena: Arena, peer: MinkPeer) -> None:
        self._peer = peer
        self._follow = dict.fromkeys(arena.robots, Action.FOLLOW)

    def answer(
        self,
        q: Floats,
        v: Floats,
        stamps: Mapping[str, float],
        now: float,
        asked: Asked,
    ) -> Told:
        """See `Answering`."""
        found = self._peer.velocity(q, asked.joints)
        if found is None:
            return Told(np.zeros(len(q)), self._follow, why="NO_SOLUTION")
        return Told(found, self._follow)

    def aim(self, operator: Operator) -> None:
        """See `Answering`; it is told at every step."""

    def reset(self) -> None:
        """See `Answering`."""


def answering(arena: Arena, name: str) -> Answering:
    """Who answers, by name."""
    if name in PEERS:
        limits = arena.lower, arena.upper, arena.velocity
        scene = build_scene(arena.name, "deflect")
        return Peer(arena, MinkPeer(scene, arena.judge, limits, name))
    if name == "field":
        return Fielded(arena.guard(name), arena)
    return Guarded(arena.guard(name))  # type: ignore[arg-type]
