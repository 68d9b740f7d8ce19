"""Desired motion that opens every near pair is commanded, or the command says why not.

The planar arm, its distance from the wall and what opens it are computed here; its
commands in free space are those that an arm of its acceleration can follow.
"""

import numpy as np
import pytest

from armguard.respond import Changed
from driven import Driven, wall_guard

# Length of a link, its radius, and where its capsule begins [m].
LENGTH, RADIUS, BEGINS = 0.4, 0.04, 0.1

WALL = 0.6

# Error of tracking as declared [rad/s], and speed that is asked of each joint at most.
TRACKING, SPEED = 0.02, 0.6

# How near the wall arms begin, and how near a pair is near [m].
NEAR = (0.006, 0.016)
MARGIN = 0.1

# Whether a link, by row, is behind a joint.
BEHIND = np.tril(np.ones((3, 3), dtype=bool))

# Cycles in which they speed up to what is asked, and go on.
CYCLES = 110


def ends(q):
    """Heights of both ends of every link, and how each joint changes them [m/rad]."""
    angles = np.cumsum(q)
    sides = LENGTH * np.array([np.cos(angles), np.sin(angles)])
    # Where joints are; the last one is the tip.
    joints = np.concatenate([np.zeros((2, 1)), np.cumsum(sides, axis=1)], axis=1)
    reach = np.array([BEGINS, LENGTH]) / LENGTH
    x, heights = joints[:, :-1, None] + reach * sides[:, :, None]
    # Each joint turns what is behind it about itself.
    slopes = np.where(BEHIND[:, None], x[:, :, None] - joints[0, :-1], 0.0)
    return heights.ravel(), slopes.reshape(-1, len(q))


def gaps(q):
    """Distances of the ends from the wall [m]."""
    return WALL - RADIUS - ends(q)[0]


def surely_opens(q, v):
    """Whether a motion opens all that is near, wherever in its error each joint is."""
    heights, slopes = ends(q)
    near = WALL - RADIUS - heights < MARGIN + 0.01
    closing = slopes[near] @ v + np.abs(slopes[near]) @ np.full(len(q), TRACKING)
    return bool((closing <= 0.0).all())


def cases(count):
    """States near the wall, and motions that surely open all that is near."""
    rng = np.random.default_rng(16)
    found = []
    while len(found) < count:
        q = rng.uniform(-1.5, 1.5, 3)
        if not NEAR[0] <= gaps(q).min() <= NEAR[1]:
            continue
        v = rng.uniform(-SPEED, SPEED, 3)
        if surely_opens(q, v):
            found.append((q, v))
    return found


def test_heights_change_as_finite_differences_say():
    for q, v in cases(5):
        step = 1e-6 * v
        change = (ends(q + step)[0] - ends(q - step)[0]) / 2e-6
        np.testing.assert_allclose(ends(q)[1] @ v, change, atol=1e-8)


@pytest.mark.parametrize("response", ["deflect", "slow"])
def test_what_opens_every_near_pair_passes_bit_for_bit_or_its_row_is_named(response):
    closes_a_joint = named = 0
    for q, v in cases(40):
        beside = Driven(wall_guard(response, wall=WALL), q)
        alone = Driven(wall_guard(response, wall=5.0), q)
        for loop in (beside, alone):
            loop.run(np.zeros(3), 5)
        slopes = ends(q)[1][np.argmin(gaps(q))]
        closes_a_joint += bool((slopes * v > 0.0).any())
        for _ in range(CYCLES):
            if not surely_opens(beside.q, v):
                break
            near, free = (loop.cycle(v) for loop in (beside, alone))
            if near.velocity.tobytes() != free.velocity.tobytes():
                assert near.changed["arm"] & Changed.ROWS
                named += 1
                break
            assert near.changed == free.changed
        assert beside.stops == []
    # Arms of which no joint comes nearer would pass anyhow.
    assert closes_a_joint > 20
    # Of these three the joints that close, which may swing back as well, use up all
    # that is left before the others open it.
    assert named <= 3


def test_what_is_changed_has_a_named_cause():
    loop = Driven(wall_guard(wall=WALL), [0.2, 0.2, 0.1])
    loop.cycle([0.0, 0.0, 0.0])
    first = loop.cycle([-1.0, 0.0, 0.0])
    assert first.changed == {"arm": Changed.ACCELERATION}
    done = loop.run([-1.0, 0.0, 0.0], 200)
    assert done.velocity.tolist() == [-1.0, 0.0, 0.0]
    assert done.changed == {"arm": Changed(0)}
    fast = loop.run([-3.0, 0.0, 0.0], 10)
    assert Changed.SPEED in fast.changed["arm"]
    loop = Driven(wall_guard(wall=WALL), [0.2, 0.2, 0.1])
    towards = loop.run([0.5, 0.0, 0.0], 700)
    assert Changed.ROWS in towards.changed["arm"]
