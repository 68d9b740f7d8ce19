"""Approaches in the bay: a tool led straight at a fixture, or at the other arm."""

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from armguard import Guard, bay_scene
from armguard.scene.settings import Mode
from armguard.scene.tables import SceneTables
from arrays import Floats
from episodes.follower import Arms
from room.lines import (
    JOINTS,
    MODES,
    SIGHT,
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

ARMS = ("left", "right")
KINDS = ("fixture", "arm")

# How far the tool is from its aim at the start, and least of anything else [m].
NEAREST, FARTHEST = 0.3, 0.8
ROOMY = 0.10

# Links that are always near the base of their arm, and what has to do for them [m].
SHOULDER = ("/link1", "/link2")
STANDING = 0.03

# An approach ends at this distance [m]; no guard lets it get there.
TOUCH = 0.002

# Random starts that are tried for each approach before that counts as impossible.
TRIES = 2000


@dataclass(frozen=True, slots=True)
class Approach:
    """A line of one arm's tool that ends in contact.

    Attributes:
        kind: What it is led at, one of `KINDS`.
        line: The line.
    """

    kind: str
    line: Line


def approaches(count: int, seed: int = 11) -> Iterator[Approach]:
    """Approaches, in turns at fixtures and at the other arm.

    Raises:
        RuntimeError: None was found in TRIES tries.
    """
    rng = np.random.default_rng(seed)
    ruler = ruler_of(bay_scene())
    for k in range(count):
        yield next_approach(ruler, rng, KINDS[k % len(KINDS)])


def next_approach(ruler: Guard, rng: np.random.Generator, kind: str) -> Approach:
    """One approach of a kind."""
    for _ in range(TRIES):
        arm = ARMS[rng.integers(2)]
        q = start(ruler.tables, rng, arm, kind)
        aim = aim_of(ruler, rng, q, arm, kind)
        if aim is None:
            continue
        hand = Hand(ruler.tables, arm, np.zeros(3)).holding(q, aim[0])
        rows = []
        for row in knots(ruler.tables, hand, q, aim[1], drawn_swing(rng)):
            rows.append(row)
            if nearest(ruler, row) < TOUCH:
                line = line_through(rows)
                if line is not None and line.length > NEAREST / 2.0:
                    return Approach(kind, line)
                break
            if len(rows) * STEP > 2.0 * FARTHEST:
                break
    raise RuntimeError(f"no approach of the kind '{kind}' in {TRIES} tries")


def start(tables: SceneTables, rng: np.random.Generator, arm: str, kind: str) -> Floats:
    """Random positions of an arm; the other one is at home, unless it is the aim."""
    q = tables.home.copy()
    for name in ARMS:
        if name == arm or kind == "arm":
            own = Arms(tables).own[name]
            q[own] = rng.uniform(tables.lower[own] + 0.1, tables.upper[own] - 0.1)
    return q


def aim_of(
    ruler: Guard, rng: np.random.Generator, q: Floats, arm: str, kind: str
) -> tuple[Floats, Floats] | None:
    """Point of the tool that is led, and the direction; None if there is no room."""
    aims = []
    for pair in ruler.judge_at_rest(q).near:
        robots = [
            side.split("/")[0] if "/" in side else "" for side in (pair.a, pair.b)
        ]
        if robots[0] == robots[1]:
            continue
        fixed = pair.a.endswith(SHOULDER) or pair.b.endswith(SHOULDER)
        if not pair.distance > (STANDING if fixed else ROOMY):
            return None
        other = "" if kind == "fixture" else ARMS[1 - ARMS.index(arm)]
        if not NEAREST < pair.distance < FARTHEST:
            continue
        if pair.a == f"{arm}/link{JOINTS}" and robots[1] == other:
            aims.append((pair.point_a, pair.normal))
        elif pair.b == f"{arm}/link{JOINTS}" and robots[0] == other:
            aims.append((pair.point_b, -pair.normal))
    return aims[int(rng.integers(len(aims)))] if aims else None


def nearest(ruler: Guard, q: Floats) -> float:
    """Least distance of any checked pair [m]."""
    near = ruler.judge_at_rest(q).nearest
    return SIGHT if near is None else near.distance


def measure(count: int, speeds: Sequence[float]) -> list[dict[str, Any]]:
    """First warnings of each approach, for each speed and mode."""
    guards = {mode: Guard(bay_scene(mode)) for mode in MODES}

    def warned(approach: Approach, mode: Mode, speed: float) -> dict[str, Any]:
        found = first_warnings(guards[mode], approach.line.drive(speed))
        return {
            level: one and asdict(one)
            for level, one in zip(("SLOW", "STOP"), found, strict=True)
        }

    return rows_of("approach", approaches(count), count, speeds, warned)
