"""Passing by: a tool that moves along a panel, and how near that may stand."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import Any

import numpy as np

from armguard import Box, Guard, Level, Scene, bay_scene
from armguard.scene.settings import Mode
from arrays import Floats
from room.lines import (
    JOINTS,
    MODES,
    STEP,
    Hand,
    Line,
    drawn_swing,
    first_warnings,
    knots,
    line_through,
    rows_of,
    ruler_of,
)

ARM, PANEL = "left", "panel"

# Middle of the last link in its frame [m].
MIDDLE = (0.0, 0.0, 0.055)

# Half the way on which the tool passes, and half the panel: along the way, through it,
# and across [m].
HALF_WAY = 0.25
PANEL_SIZE = (0.3, 0.04, 0.2)

# Where the panel's face is looked for, from the way of the tool's middle [m], and how
# finely [m].
NEAR_FACE, FAR_FACE = 0.10, 0.80
GRAIN = 2e-3

# Which of a line's knots the ruler looks at.
EVERY = 3

TRIES = 5000


@dataclass(frozen=True, slots=True)
class Passage:
    """A line of the tool, and the side on which the panel is.

    Attributes:
        line: The line.
        T_world_way: Frame in its middle, x along it and y towards the panel, (4, 4).
    """

    line: Line
    T_world_way: Floats

    def panel(self, face: float) -> Floats:
        """Pose of the panel with its face so far from the tool's way, (4, 4)."""
        T = self.T_world_way.copy()
        T[:3, 3] += (face + 0.5 * PANEL_SIZE[1]) * T[:3, 1]
        return T


def passing_scene(mode: Mode) -> Scene:
    """One arm of the bay and a panel; no more."""
    bay = bay_scene(mode)
    robot = bay.robots[ARM]
    scene = Scene(mode=mode, buffer=bay.buffer)
    scene.add_robot(
        robot.model,
        name=ARM,
        base=robot.base,
        home=robot.home,
        stopping=robot.stopping,
    )
    scene.add(Box(size=PANEL_SIZE), name=PANEL, present=False)
    return scene


def passages(ruler: Guard, count: int, seed: int = 5) -> Iterator[Passage]:
    """Passages on which the last link is what the panel meets first.

    Raises:
        RuntimeError: None was found in TRIES tries.
    """
    rng = np.random.default_rng(seed)
    for _ in range(count):
        yield next_passage(ruler, rng)


def next_passage(ruler: Guard, rng: np.random.Generator) -> Passage:
    """One passage."""
    t = ruler.tables
    hand = Hand(t, ARM, np.array(MIDDLE))
    for _ in range(TRIES):
        q = rng.uniform(t.lower + 0.1, t.upper - 0.1)
        T = np.eye(4)
        T[:3, :3] = frame(rng)
        T[:3, 3] = hand.at(q)
        swing = drawn_swing(rng)
        half = int(HALF_WAY / STEP) + 1
        on, back = (
            list(islice(knots(t, hand, q, sign * T[:3, 0], sign * swing), half))
            for sign in (1.0, -1.0)
        )
        if len(on) < half or len(back) < half:
            continue
        line = line_through([*back[:0:-1], *on])
        if line is None:
            continue
        passage = Passage(line, T)
        if least(ruler, passage, NEAR_FACE)[1] == f"{ARM}/link{JOINTS}":
            return passage
    raise RuntimeError(f"no passage in {TRIES} tries")


def frame(rng: np.random.Generator) -> Floats:
    """A random right-handed frame, shape (3, 3)."""
    Q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    return Q if np.linalg.det(Q) > 0.0 else -Q


def least(ruler: Guard, passage: Passage, face: float) -> tuple[float, str]:
    """Least distance of the arm and the panel on the way [m], and the link it is of."""
    ruler.place(PANEL, passage.panel(face))
    ways = np.arange(0.0, passage.line.length, EVERY * STEP)
    found = [
        (pair.distance, pair.a)
        for way in ways
        for pair in ruler.judge_at_rest(passage.line.q_of(way)).near
        if pair.b == PANEL
    ]
    return min(found)


def nearest_passed(
    guard: Guard, ruler: Guard, passage: Passage, speed: float
) -> dict[Level, float | None] | None:
    """Least distances at which the panel may be passed without a slow, and a stop.

    Args:
        guard: The guard.
        ruler: Measures.
        passage: The way.
        speed: Speed of the tool [m/s].

    Returns:
        Distances [m], None where the panel is too near at FAR_FACE; None if the arm is
        stopped without any panel.
    """
    motion = list(passage.line.drive(speed))
    guard.remove(PANEL)
    if first_warnings(guard, motion)[1] is not None:
        return None
    known: dict[float, tuple[bool, bool]] = {}

    def warned(face: float, level: Level) -> bool:
        if face not in known:
            guard.place(PANEL, passage.panel(face))
            slow, stop = first_warnings(guard, motion)
            known[face] = slow is not None, stop is not None
        return known[face][level >= Level.STOP]

    found: dict[Level, float | None] = {}
    for level in (Level.STOP, Level.SLOW):
        near, far = NEAR_FACE - 0.06, FAR_FACE
        if warned(far, level):
            found[level] = None
            continue
        while far - near > GRAIN:
            middle = 0.5 * (near + far)
            near, far = (middle, far) if warned(middle, level) else (near, middle)
        found[level] = least(ruler, passage, far)[0]
    return found


def measure(count: int, speeds: Sequence[float]) -> list[dict[str, Any]]:
    """Least distances of each passage, for each speed and mode."""
    ruler = ruler_of(passing_scene("fixed"))
    guards = {mode: Guard(passing_scene(mode)) for mode in MODES}

    def passed(passage: Passage, mode: Mode, speed: float) -> dict[str, Any] | None:
        found = nearest_passed(guards[mode], ruler, passage, speed)
        return found and {level.name: distance for level, distance in found.items()}

    return rows_of("passage", passages(ruler, count), count, speeds, passed)
