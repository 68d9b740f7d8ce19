"""Bounds by twists hold for every motion of the joints' ranges, and are near the truth.

The truth is the closed form of a planar chain, and rotations about the joints' axes.
"""

from itertools import product

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from armguard.geometry import ShapeKind
from armguard.geometry.vec3 import add, sub
from armguard.guard.workspace import open_workspace
from armguard.kernel import kernel
from armguard.motion.state import NEXT
from armguard.motion.twist_bound import (
    SPEED,
    TRAVEL,
    bound_along,
    bound_twists,
    deviation,
    middle_gap,
    own_bound,
    place_at_middle,
    relative_bound,
)
from armguard.respond import Guard
from armguard.robot.kinematics import PRISMATIC
from armguard.scene import Scene, two_pandas_scene
from planar import LENGTHS, chain, place
from sliding import EXACT

CHAINS = [("turn",), ("turn", "turn"), ("slide", "turn", "turn"), ("turn", "slide")]

# Radius of the ball at the tip: little beside what moves it [m].
RADIUS = 1e-3


@kernel(entry=True)
def write(lines):
    w = open_workspace(lines)
    bound_twists(w.world.boxes, w.bodies, w.motion)
    place_at_middle(w.bodies, w.T_world, w.motion)


@kernel(entry=True)
def own(block, i, lines):
    w = open_workspace(lines)
    return own_bound(block, i, w.bodies[i], w.motion)[0]


@kernel(entry=True)
def ranged(block, i, lines):
    w = open_workspace(lines)
    _, way, more = own_bound(block, i, w.bodies[i], w.motion)
    low, high = sub(way, more), add(way, more)
    return (low[0], high[0]), (low[1], high[1]), (low[2], high[2])


@kernel(entry=True)
def relative(block, i, j, lines):
    w = open_workspace(lines)
    m, a, b = w.motion, w.bodies[i], w.bodies[j]
    return relative_bound(block, i, j, a, b, m.shared[a, b], m)


@kernel(entry=True)
def along(block, n, i, j, lines):
    w = open_workspace(lines)
    m, a, b = w.motion, w.bodies[i], w.bodies[j]
    return bound_along(block, n, i, j, a, b, m.shared[a, b], m)


@kernel(entry=True)
def kept_apart(i, j, lines):
    w = open_workspace(lines)
    m, a, b = w.motion, w.bodies[i], w.bodies[j]
    return middle_gap(i, j, a, b, m.shared[a, b], w.world.boxes, m)


@kernel(entry=True)
def reach_of(i, n, lines):
    w = open_workspace(lines)
    return deviation(i, n, 0, w.bodies[i], w.motion)


class Ranges:
    """A guard that has judged a cycle, and ranges of its joints."""

    def __init__(self, scene):
        self.guard = Guard(scene, self_test=False)
        self.guard.step(self.guard.home, 0.0, velocity=0.0 * self.guard.home, now=0.0)
        self.motion, self.tables = self.guard._motion, self.guard.tables
        self.lines = self.guard._lines.ctypes.data

    def set(self, middle, width):
        """Ranges of the joints, each shape (n,), as travel and as velocity."""
        m = self.motion
        joint = m.joint_kind != 0
        gain, q = np.where(joint, m.gain[:, 0], 0.0), m.q_index
        m.middle[NEXT], m.width[NEXT] = gain * middle[q], np.abs(gain) * width[q]
        m.spread[NEXT] = np.abs(m.middle[NEXT]) + m.width[NEXT]
        m.v_low[:], m.v_high[:] = middle - width, middle + width
        m.speed[:] = m.spread[NEXT]
        write(self.lines)

    def moved(self, i, points, delta):
        """Points of primitive i after a displacement of the joints, shape (k, 3)."""
        m, body = self.motion, self.tables.bodies[i]
        for b in m.joints[body, : m.length[body]][::-1]:
            axis, origin = m.axes[b, :3], m.axes[b, 3:]
            way = m.gain[b, 0] * delta[m.q_index[b]]
            if m.joint_kind[b] == PRISMATIC:
                points = points + way * axis
            else:
                turn = Rotation.from_rotvec(way * axis)
                points = turn.apply(points - origin) + origin
        return points

    def surface(self, i, rng, count=40):
        """Points of a primitive, on its surface or near it."""
        row = self.guard._workspace.world.rows[i]
        ways = rng.normal(size=(count, 3))
        ways *= row[0] / np.linalg.norm(ways, axis=1)[:, None]
        if self.tables.kinds[i] == ShapeKind.CAPSULE:
            ends = np.where(rng.uniform(size=(count, 1)) < 0.5, row[1:4], row[4:7])
            return ways + ends
        assert self.tables.kinds[i] in (ShapeKind.SPHERE, ShapeKind.BOX)
        corner = np.zeros((count, 3))
        if self.tables.kinds[i] == ShapeKind.BOX:
            corner = rng.choice((-1.0, 1.0), (count, 3)) * row[4:7]
            corner = corner @ row[7:16].reshape(3, 3).T
        return ways + row[1:4] + corner


def chain_of(kinds):
    """Ranges of a planar chain with a ball at its tip."""
    scene = Scene(buffer=0.0, margin=0.1)
    scene.add_robot(chain(kinds, RADIUS), name="arm", stopping=EXACT)
    return Ranges(scene)


@pytest.mark.parametrize("kinds", CHAINS)
def test_no_tip_of_a_chain_gets_farther(kinds):
    rng, ranges, n = np.random.default_rng(7), chain_of(kinds), len(kinds)
    start = place(kinds, np.zeros(n))
    nearest = 0.0
    for k in range(300):
        size = 10.0 ** rng.uniform(-3.0, -0.3)
        middle, width = size * rng.uniform(-1, 1, n), size * rng.uniform(0, 0.3, n)
        width *= k % 2
        ranges.set(middle, width)
        bound = own(TRAVEL, 0, ranges.lines)
        ends = np.array(list(product((-1.0, 1.0), repeat=n)))
        way = place(kinds, middle + width * ends) - start
        reached = np.linalg.norm(way, axis=1).max()
        assert reached <= bound
        nearest = max(nearest, reached / bound)
    assert nearest > 0.95


@pytest.mark.parametrize("kinds", CHAINS)
def test_no_tip_of_a_chain_gets_beyond_its_range_along_an_axis(kinds):
    rng, ranges, n = np.random.default_rng(11), chain_of(kinds), len(kinds)
    start, nearest = place(kinds, np.zeros(n)), 0.0
    for k in range(300):
        size = 10.0 ** rng.uniform(-3.0, -0.3)
        middle, width = size * rng.uniform(-1, 1, n), size * rng.uniform(0, 0.3, n)
        width *= k % 2
        ranges.set(middle, width)
        ends = middle + width * np.array(list(product((-1.0, 1.0), repeat=n)))
        ways = place(kinds, ends) - start, (place(kinds, 1e-7 * ends) - start) / 1e-7
        for block, way in zip((TRAVEL, SPEED), ways, strict=True):
            for axis in range(2):
                least, most = ranged(block, 0, ranges.lines)[axis]
                assert way[:, axis].min() >= least - 1e-6 * (block == SPEED)
                assert way[:, axis].max() <= most + 1e-6 * (block == SPEED)
                if way[:, axis].max() > 0.0:
                    nearest = max(nearest, way[:, axis].max() / most)
    assert nearest > 0.9


def test_terms_of_second_order_are_counted():
    """Two joints turn against one another: to first order the tip stays."""
    kinds = ("turn", "turn")
    ranges = chain_of(kinds)
    first, last = LENGTHS[0] + LENGTHS[1], LENGTHS[1]
    for angle in (0.02, 0.1, 0.3):
        delta = angle * np.array([last / first, -1.0])
        ranges.set(delta, np.zeros(2))
        bound = own(TRAVEL, 0, ranges.lines)
        way = place(kinds, delta) - place(kinds, np.zeros(2))
        assert 0.1 * bound < np.linalg.norm(way) <= bound
        # The sum of levers does not know that they cancel.
        assert bound < 0.7 * (abs(delta[0]) * first + abs(delta[1]) * last)


def test_a_joint_that_slides_on_one_that_turns_is_counted():
    kinds = ("turn", "slide")
    ranges = chain_of(kinds)
    for delta in ((0.1, 0.9), (0.02, 0.9), (0.1, 0.5)):
        ranges.set(np.array(delta), np.zeros(2))
        way = place(kinds, delta) - place(kinds, np.zeros(2))
        assert np.linalg.norm(way) <= own(TRAVEL, 0, ranges.lines)


@pytest.fixture(scope="module")
def pandas():
    return Ranges(two_pandas_scene())


@pytest.mark.parametrize("seed", range(3))
def test_points_of_two_pandas_stay_in_their_ranges_along_the_axes(pandas, seed):
    rng, tables = np.random.default_rng(seed), pandas.tables
    n, moving = len(tables.home), tables.moving_count
    nearest = 0.0
    for _ in range(60):
        i = rng.choice(np.flatnonzero(tables.robot_of_primitive[:moving] >= 0))
        size = 10.0 ** rng.uniform(-2.0, -0.3)
        middle, width = size * rng.uniform(-1, 1, n), size * rng.uniform(0, 0.5, n)
        pandas.set(middle, width)
        bounds = np.array(ranged(TRAVEL, i, pandas.lines))
        points = pandas.surface(i, rng)
        for _ in range(10):
            delta = middle + width * rng.uniform(-1, 1, n)
            way = pandas.moved(i, points, delta) - points
            assert (way >= bounds[:, 0]).all() and (way <= bounds[:, 1]).all()
            nearest = max(nearest, (way / bounds[:, 1]).max())
    assert nearest > 0.8


@pytest.mark.parametrize("seed", range(3))
def test_pairs_of_two_pandas_stay_as_far_apart_as_their_balls(pandas, seed):
    rng, tables = np.random.default_rng(seed), pandas.tables
    n, moving = len(tables.home), tables.moving_count
    nearest = np.inf
    for k in range(200):
        i = rng.choice(np.flatnonzero(tables.robot_of_primitive[:moving] >= 0))
        j = rng.integers(len(tables.kinds))
        if i == j or tables.kinds[j] == ShapeKind.HALF_SPACE:
            continue
        size = 10.0 ** rng.uniform(-2.0, -0.3)
        middle, width = size * rng.uniform(-1, 1, n), size * rng.uniform(0, 0.5, n)
        if k % 2:
            width *= rng.permutation(n) < 2
        pandas.set(middle, width)
        bound = kept_apart(i, j, pandas.lines)
        a, b = pandas.surface(i, rng), pandas.surface(j, rng)
        for _ in range(20):
            delta = middle + width * rng.choice((-1.0, 0.0, 1.0), n)
            one = pandas.moved(i, a, delta)
            other = pandas.moved(j, b, delta) if j < moving else b
            gap = np.linalg.norm(one[:, None] - other[None], axis=2).min()
            assert gap >= bound - 1e-12
            if bound > 0.05:
                nearest = min(nearest, gap / bound)
    assert nearest < 1.2


@pytest.mark.parametrize("kinds", CHAINS)
def test_a_ball_reaches_its_least_distance_from_a_wall(kinds):
    """A chain whose tip moves about the middle of its ranges, and a plane beside it."""
    rng, ranges, n = np.random.default_rng(3), chain_of(kinds), len(kinds)
    m = ranges.motion
    for _ in range(100):
        size = 10.0 ** rng.uniform(-3.0, -0.5)
        middle, width = size * rng.uniform(-1, 1, n), size * rng.uniform(0, 1, n)
        ranges.set(middle, width)
        centre = place(kinds, middle)
        assert m.middle_balls[0, :2] == pytest.approx(centre, abs=1e-12)
        way = rng.normal(size=2)
        way /= np.linalg.norm(way)
        bound = reach_of(0, (*way, 0.0), ranges.lines)
        ends = np.array(list(product((-1.0, 0.0, 1.0), repeat=n)))
        reached = ((place(kinds, middle + width * ends) - centre) @ way).max()
        assert reached <= bound + 1e-12
        if size < 3e-3:
            assert reached > 0.97 * bound - 1e-5


@pytest.mark.parametrize("seed", range(3))
def test_no_pair_of_two_pandas_gets_nearer_or_faster(pandas, seed):
    rng, tables = np.random.default_rng(seed), pandas.tables
    n, moving = len(tables.home), tables.moving_count
    step = 1e-6
    tight = 0.0
    for k in range(90):
        i, j = sorted(rng.choice(moving, 2, replace=False))
        if tables.robot_of_primitive[j] < 0 or tables.robot_of_primitive[i] < 0:
            continue
        size = 10.0 ** rng.uniform(-2.0, -0.5)
        middle, width = size * rng.uniform(-1, 1, n), size * rng.uniform(0, 0.2, n)
        width *= k % 2
        if k % 3 == 0:
            middle *= rng.permutation(n) == 0
        pandas.set(middle, width)
        a, b = pandas.surface(i, rng), pandas.surface(j, rng)
        normal = rng.normal(size=3)
        normal /= np.linalg.norm(normal)
        n_bounds = [
            along(k, tuple(normal), i, j, pandas.lines) for k in (TRAVEL, SPEED)
        ]
        bounds = [relative(k, i, j, pandas.lines) for k in (TRAVEL, SPEED)]
        for _ in range(10):
            delta = middle + width * rng.choice((-1.0, 1.0), n)
            gap = b[:, None] - a[None, :]
            ways = pandas.moved(j, b, delta)[:, None] - pandas.moved(i, a, delta)[None]
            # Motion common to both does not count: distances of points show that.
            change = np.linalg.norm(gap, axis=2) - np.linalg.norm(ways, axis=2)
            assert change.max() <= bounds[TRAVEL] + 1e-12
            rates = pandas.moved(j, b, step * delta)[:, None]
            rates = rates - pandas.moved(i, a, step * delta)[None]
            slower = (
                np.linalg.norm(gap, axis=2) - np.linalg.norm(rates, axis=2)
            ) / step
            assert slower.max() <= bounds[SPEED] + 1e-6
            tight = max(tight, slower.max() / (bounds[SPEED] + 1e-6))
            if pandas.motion.shared[tables.bodies[i], tables.bodies[j]] == 0:
                assert ((gap - ways) @ normal).max() <= n_bounds[TRAVEL] + 1e-12
                assert ((gap - rates) @ normal).max() / step <= n_bounds[SPEED] + 1e-6
    assert tight > 0.4
