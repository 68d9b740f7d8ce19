"""One trial of a scene: its goal or slide, its guard or peer, and what came of it."""

from dataclasses import asdict
from functools import lru_cache
from typing import Any

import numpy as np

from episodes.campaign import LeftOut
from reach.answers import Answering, answering
from reach.arena import arena_of
from reach.goals import Goal, draw_goal
from reach.slides import SLIDES, slid, start_of
from reach.trial import Trial

# Why a goal is left out, by its road.
LEFT_OUT = {
    "none": "no way was found",
    "out of reach": "the tool gets into joint limits",
}


@lru_cache(maxsize=64)
def goal_of(scene: str, seed: int) -> Goal:
    """The goal of a trial; the same for all guards and peers."""
    return draw_goal(arena_of(scene), seed)


@lru_cache(maxsize=64)
def slide_start(scene: str, seed: int) -> np.ndarray | None:
    """Where a slide begins; the same for all guards and peers."""
    return start_of(arena_of(scene), SLIDES[scene], seed)


def work(scene: str, answer: str, what: str, seed: int) -> dict[str, Any]:
    """Figures of one trial.

    Args:
        scene: Name of the scene.
        answer: Name of the guard or peer.
        what: What is done, "goals" or "slides".
        seed: Its number; the same for all guards and peers.

    Raises:
        LeftOut: There is nothing to be done.
    """
    arena = arena_of(scene)
    found: dict[str, Any] = {"seed": seed}
    if what == "slides":
        start = slide_start(scene, seed)
        if start is None:
            raise LeftOut("no start was found")
        answers = answers_of(scene, answer)
        return {**found, "slide": slid(arena, SLIDES[scene], start, answers, seed)}
    goal = goal_of(scene, seed)
    if goal.road in LEFT_OUT:
        raise LeftOut(LEFT_OUT[goal.road])
    found |= {"kind": goal.kind, "road": goal.road, "share": goal.share, "runs": {}}
    # A field knows the goal only, not the way to it.
    both = goal.road == "bends" and answer != "field"
    for led in (False, True) if both else (False,):
        operator = goal.operator(arena, led)
        answers = answers_of(scene, answer)
        outcome = Trial(arena, seed, goal.start, operator, answers).run()
        found["runs"]["led" if led else goal.road] = asdict(outcome)
    return found


@lru_cache(maxsize=64)
def answers_of(scene: str, answer: str) -> Answering:
    """The guard or peer; built once in a process."""
    return answering(arena_of(scene), answer)
