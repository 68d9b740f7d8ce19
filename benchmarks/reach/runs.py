"""The runs of a scene: goals, and tools pushed against a board and along it."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from arrays import Floats
from episodes.campaign import LeftOut
from reach.answers import Answering, answering
from reach.arena import Arena, arena_of
from reach.goals import Goal, draw_goal
from reach.operators import Push
from reach.trial import Trial

# Speeds along a surface and into it [m/s].
ALONG = 0.12
INTO = 0.05

# Heights above the surface at which a start is looked for, and the distance it must
# have [m].
HEIGHTS = np.arange(0.08, 0.40, 0.03)
CLEAR = 0.02

# Random configurations a start is looked for from, and steps from each.
TRIES = 12
STEPS = 60

# What a start may miss its place [m] and its direction [rad] by.
MISSES = 2e-3
TURNED = 0.05

# Step in which an unobstructed tool is followed [s].
STEP = 0.005


@dataclass(frozen=True, slots=True)
class Slide:
    """Tools that are pushed against a surface, and along it.

    Attributes:
        tools: Which.
        starts: Where on the surface each begins, shape (3,) [m].
        along: Unit vector along the surface.
        into: Unit vector into it.
        points: Where the tools' z axes point, a unit vector.
        length: How far along they are asked to go [m].
    """

    tools: tuple[str, ...]
    starts: tuple[tuple[float, float, float], ...]
    along: tuple[float, float, float]
    into: tuple[float, float, float] = (0.0, 0.0, -1.0)
    points: tuple[float, float, float] = (0.0, 0.0, -1.0)
    length: float = 0.30


SLIDES: Mapping[str, Slide] = {
    # Along the lower shelf of the rack, in front of the battery.
    "bay": Slide(
        ("left",),
        ((0.25, 0.10, 0.63),),
        (0.0, -1.0, 0.0),
        points=(0.707, 0.0, -0.707),
        length=0.20,
    ),
    # Across the table, from the post to the box.
    "pandas": Slide(("near",), ((-0.15, -0.20, -0.04),), (0.0, 1.0, 0.0)),
    # Along the table's edge, past what is on it.
    "panda_table": Slide(("panda",), ((0.339, 0.459, 0.2185),), (-0.862, 0.507, 0.0)),
    # Along the top of the shelf.
    "panda_shelf": Slide(("panda",), ((0.163, -0.612, 0.538),), (0.892, 0.452, 0.0)),
    # Both hands reach into the shelf and are pushed down on the same board.
    "baxter_shelf": Slide(
        ("baxter/left_gripper", "baxter/right_gripper"),
        ((0.84, 0.15, 0.02), (0.84, -0.30, 0.02)),
        (0.0, 1.0, 0.0),
        points=(1.0, 0.0, 0.0),
        length=0.15,
    ),
}


def start_of(arena: Arena, slide: Slide, seed: int) -> Floats | None:
    """A configuration above the surface that keeps its distance; None if none is found.

    The lowest height at which there is one is taken.

    Args:
        arena: Where.
        slide: What is to be slid.
        seed: Random postures are tried in its order.
    """
    rng = np.random.default_rng([seed, 11])
    used = arena.driven & arena.moved_by(slide.tools)
    for height in HEIGHTS:
        for k in range(TRIES):
            q = arena.home.copy()
            drawn = rng.uniform(arena.lower, arena.upper)
            mix = rng.uniform(0.0, 0.7) if seed or k else 0.0
            q[used] = (mix * drawn + (1.0 - mix) * arena.home)[used]
            found = led_to(arena, slide, q, float(height))
            if found is None or not arena.checker.check_path([found]).clear:
                continue
            if arena.judge.distance(found) >= CLEAR:
                return found
    return None


def led_to(arena: Arena, slide: Slide, q: Floats, height: float) -> Floats | None:
    """A configuration with the tools above their starts, near another one."""
    point = np.array(slide.points)
    low, high = arena.lower + 0.1, arena.upper - 0.1
    for _ in range(STEPS):
        poses, jacobians = arena.tool_state(q)
        rows, errors = [], []
        for name, start in zip(slide.tools, slide.starts, strict=True):
            k = arena.tools.index(name)
            T, J = poses[k], jacobians[k]
            aim = np.array(start) - height * np.array(slide.into)
            errors.append(aim - T[:3, 3])
            rows.append(J[:3])
            errors.append(np.cross(T[:3, 2], point))
            if T[:3, 2] @ point < -0.9:
                errors[-1] = T[:3, 0]
            rows.append(J[3:])
        error, J = np.concatenate(errors), np.concatenate(rows)
        if is_there(errors):
            return q
        damped = J @ J.T + 1e-3 * np.eye(len(J))
        step = J.T @ np.linalg.solve(damped, error)
        step *= min(1.0, 0.3 / max(float(np.abs(step).max()), 1e-9))
        q = np.where(arena.driven, np.clip(q + step, low, high), q)
    return None


def is_there(errors: Sequence[Floats]) -> bool:
    """Whether places (even) and directions (odd) are as they should be."""
    places = max(float(np.linalg.norm(e)) for e in errors[::2])
    turns = max(float(np.linalg.norm(e)) for e in errors[1::2])
    return places < MISSES and turns < TURNED


def slid(
    arena: Arena, slide: Slide, start: Floats, answers: Answering, seed: int
) -> dict[str, Any]:
    """Figures of a slide: how far each tool got, beside one that nothing hinders.

    Args:
        arena: Where.
        slide: What is slid.
        start: From where, shape (n,).
        answers: The guard or peer.
        seed: Draws the true figures of the robots.
    """
    along, into = np.array(slide.along), np.array(slide.into)
    duration = slide.length / ALONG
    twist = np.concatenate([ALONG * along + INTO * into, np.zeros(3)])
    push = Push(arena, slide.tools, twist, duration)
    trial = Trial(
        arena, seed, start, push, answers, longest=duration + 0.5, patient=True
    )
    outcome = asdict(trial.run())
    rows = trial.drives.q_rows[: trial.drives.tick + 1 : 40]
    places = [arena.tools.index(name) for name in slide.tools]
    ways = np.array([[T[:3, 3] for T in arena.tool_poses(q)] for q in rows])[:, places]
    free = unhindered(arena, push, start, duration + 0.5)[:, places]
    travel = (ways[-1] - ways[0]) @ along
    ideal = (free[-1] - free[0]) @ along
    return {
        "tools": list(slide.tools),
        "travel_m": travel.tolist(),
        "unhindered_m": ideal.tolist(),
        "share": (travel / ideal).tolist(),
        "along_m": ((ways - ways[0]) @ along).round(5).T.tolist(),
        "height_m": ((np.array(slide.starts) - ways) @ into).round(5).T.tolist(),
        "step_s": 40 * 0.00025,
        **outcome,
    }


def unhindered(arena: Arena, push: Push, start: Floats, duration: float) -> Floats:
    """Where tools get when nothing is in their way, shape (k, tools, 3) [m]."""
    push.let_go()
    q, found = start.copy(), []
    for _ in range(round(duration / STEP)):
        found.append([T[:3, 3] for T in arena.tool_poses(q)])
        v = push.ask(q, STEP).joints
        v = v / max(1.0, float((np.abs(v) / arena.velocity).max()))
        q = np.clip(q + STEP * v, arena.lower, arena.upper)
    return np.array(found)


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
