"""Closed loops: unknown boxes that come at an arm, known by cells alone.

The operator steers the arm at the box until it is stopped, the box comes at the arm as
fast as is declared, its cells are as far off and as old as is declared, and the plant
is as late as is declared. Whether they touch is measured by points on the axes of the
links.
"""

from collections import deque
from dataclasses import dataclass

import numpy as np
import pytest

from approach import FIGURES, PERIOD
from armguard.cells.deltas import Delta
from armguard.record import records
from armguard.respond import Action, Guard
from armguard.scene import Scene
from arms import simple_arm
from sensed import CELL, CENTRE, LOW, SIZE, changes, feed, grid

JOINTS, LENGTH, RADIUS = 3, 0.4, 0.04
SPEED, ERROR = 0.6, 0.12
FRAME, LATE = 0.02, 0.2
HALF = 0.08

# The operator waits for so long after the first cells [s].
SETTLED = 0.004

# Boxes begin this near the middle of the region, which has 1.6 m to each side [m].
SEEN = 1.3
DELAY = 3
EPISODES = 24
CYCLES = 1500
FREE = records(0, Delta)


@dataclass
class Declared:
    """Figures that the guard has of the cells; by default the true ones."""

    speed: float = SPEED
    error: float = ERROR
    late: float = LATE
    whole: bool = True


def arm_guard(declared):
    scene = Scene(mode="path")
    scene.add_robot(simple_arm(JOINTS, LENGTH, RADIUS), "arm", stopping=FIGURES)
    scene.set_sensing(
        region={"centre": CENTRE, "size": SIZE},
        cell=CELL,
        unknown="free",
        reason="only the box is judged here",
        intruder={"speed": declared.speed, "size": 0.05},
    )
    return Guard(scene, self_test=False)


def axes_of(q):
    """Points on the axes of all links, shape (links, k, 3) [m]."""
    angle, base, found = 0.0, np.zeros(2), []
    for k, turn in enumerate(q):
        angle += turn
        way = np.array([np.cos(angle), np.sin(angle)])
        along = np.linspace(0.1, LENGTH, 61)[:, None]
        points = base + along * way
        height = np.full((len(points), 1), 0.2 * (k + 1))
        found.append(np.hstack([points, height]))
        base = base + LENGTH * way
    return np.array(found)


def nearest_to(points, middle):
    """Least distance of the links to the box, the link and the point there."""
    outside = np.maximum(np.abs(points - middle) - HALF, 0.0)
    gaps = np.linalg.norm(outside, axis=2)
    link, k = np.unravel_index(gaps.argmin(), gaps.shape)
    return gaps[link, k] - RADIUS, int(link), points[link, k]


def towards(q, link, point, middle):
    """Joint velocities that bring a point of a link to the box, as fast as they may."""
    way, angle, base = middle - point, 0.0, np.zeros(2)
    wanted = np.zeros(len(q))
    for k in range(link + 1):
        angle += q[k]
        lever = point[:2] - base
        wanted[k] = np.sign(way[1] * lever[0] - way[0] * lever[1])
        base = base + LENGTH * np.array([np.cos(angle), np.sin(angle)])
    return 1.8 * wanted


def cells_of(middle, whole):
    """Cells that a box meets; only those wholly inside it, if not whole."""
    low, high = (middle - HALF - LOW) / CELL, (middle + HALF - LOW) / CELL
    first = np.floor(low) if whole else np.ceil(low)
    end = np.ceil(high) if whole else np.floor(high)
    found = grid()
    found[
        tuple(
            slice(*ends)
            for ends in zip(first.astype(int), end.astype(int), strict=True)
        )
    ] = 1
    return found


def contact(declared, seed):
    """Whether the arm touches the box while it moves; and whether it moved at all."""
    rng = np.random.default_rng(seed)
    guard = arm_guard(declared)
    q, v = rng.uniform(-1.0, 1.0, JOINTS), np.zeros(JOINTS)
    link = int(rng.integers(JOINTS))
    middle = np.full(3, 0.2 * (link + 1))
    while True:
        turn = rng.uniform(-np.pi, np.pi)
        way = 0.9 * np.array([np.cos(turn), np.sin(turn)])
        middle[:2] = axes_of(q)[link][-1, :2] + way
        if np.abs(middle).max() < SEEN:
            break
    queue, frames = deque([v] * DELAY), deque()
    moved, t, stopped = 0.0, 0.0, False
    for k in range(CYCLES):
        gap, link, point = nearest_to(axes_of(q), middle)
        if gap < 0.0:
            return np.abs(v).max() > 1e-6, moved
        way = point - middle
        if k % round(FRAME / PERIOD) == 0:
            # The cells are farther from the arm than the box is.
            off = middle - ERROR * way / np.linalg.norm(way)
            frames.append((t, cells_of(off, declared.whole)))
        while frames and frames[0][0] + LATE <= t + 1e-9:
            stamp, found = frames.popleft()
            claimed = stamp + LATE - declared.late
            now = changes(found, grid(), claimed, np.float32(declared.error), motion=1)
            feed(guard, now, claimed)
        waits = stopped or t < LATE + SETTLED
        wanted = 0.0 * q if waits else towards(q, link, point, middle)
        command = guard.filter(q, wanted, t, velocity=v)
        # Nothing is proven of a robot that leaves: this operator lets go before, and
        # does not begin where the arm would have to leave.
        stopped = stopped or (t > LATE and command.action >= Action.STOP)
        queue.append(command.velocity)
        v = queue.popleft()
        q = q + PERIOD * v
        moved = max(moved, np.abs(v).max())
        step = min(SPEED * PERIOD, np.linalg.norm(way))
        middle = middle + step * way / max(np.linalg.norm(way), 1e-9)
        t += PERIOD
    return False, moved


def test_a_box_that_comes_is_never_touched_in_motion():
    found = [contact(Declared(), seed) for seed in range(EPISODES)]
    assert not any(touched for touched, _ in found)
    assert sum(moved > 0.2 for _, moved in found) > 0.7 * EPISODES


@pytest.mark.parametrize(
    "declared",
    [
        Declared(speed=0.0),
        Declared(error=0.0),
        Declared(late=0.0),
        Declared(whole=False),
    ],
    ids=["speed", "error", "age", "cell"],
)
def test_each_term_that_is_left_out_makes_contacts(declared):
    assert any(contact(declared, seed)[0] for seed in range(EPISODES))
