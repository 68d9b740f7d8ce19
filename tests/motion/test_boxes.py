"""A span's box of joint positions: how it is halved, where a pair is nearest, proofs.

A small arm in a plane and a ball; all positions of a box are tried on a fine grid.
"""

from itertools import product

import numpy as np
import pytest

from armguard.kernel import kernel
from armguard.motion.box_proof import (
    BOX_COST,
    LINE,
    halve,
    longest_way,
    prove_by_boxes,
)
from armguard.motion.nearest import middle_position, nearest_position
from armguard.motion.pair_state import NEEDED, PROVEN, UNSURE
from armguard.motion.prepare import motion_of
from armguard.motion.state import BOX_LEVELS, NEXT, NODES, Motion
from armguard.scene.compile import compile_scene
from armguard.table import Ledger, opener
from planar import LENGTHS, chain_scene, pair_of, place
from sliding import RADIUS

open_motion = opener(Motion)

ARMS = [("turn", "turn"), ("turn", "slide")]

STATES = 40

# What a grid misses, for the size of a box [-].
GRAIN = 1e-3

# A span like any other.
NODE = 5


@kernel(entry=True)
def prove(node, wanted, pair, motion):
    return prove_by_boxes(node, wanted, pair, open_motion(motion))


@kernel(entry=True)
def halve_box(box, along, nearer, motion):
    halve(box, along, nearer, open_motion(motion))


@kernel(entry=True)
def longest(node, box, witness, end, pair, motion):
    return longest_way(node, box, witness, end, pair, open_motion(motion))


@kernel(entry=True)
def nearest(node, box, rows, witness, pair, motion):
    return nearest_position(node, box, rows, witness, pair, open_motion(motion))


@kernel(entry=True)
def put_in_middle(node, box, pair, motion, rows):
    middle_position(node, box, pair, open_motion(motion), rows)


class Boxed:
    """An arm, a ball and a span whose line and ranges are drawn.

    Attributes:
        ball: Centre of the ball, shape (2,) [m].
    """

    def __init__(self, kinds):
        self.kinds, self.n = kinds, len(kinds)
        tables = compile_scene(chain_scene(kinds, (3.0, 3.0)))
        self.m = motion_of(tables, budget=1 << 40)
        self.ledger = Ledger(self.m)
        self.address = self.ledger.lines.ctypes.data
        self.chain = [int(b) for b in self.m.joints[self.m.length.argmax()][: self.n]]
        self.pair = pair_of(tables)

    def draw(self, rng, size):
        """A position, a span about it, and a ball at the side."""
        m, at = self.m, NEXT * NODES + NODE
        self.q = rng.uniform(-0.8, 0.8, self.n)
        self.way = size * rng.normal(size=self.n)
        self.wide = size * rng.uniform(0.1, 1.0, self.n)
        self.grow = self.wide * rng.uniform(-0.9, 0.9, self.n)
        m.node_q[at] = self.q
        m.node_way[at, self.chain] = self.way
        m.node_wide[at, self.chain] = self.wide
        m.node_grow[at, self.chain] = self.grow
        m.box_line[0] = 0.0, 1.0
        m.box_place[0], m.box_part[0] = 0.0, 1.0
        m.effort.tests = 0
        angle = rng.uniform(-np.pi, np.pi)
        away = 2.0 * RADIUS + rng.uniform(0.05, 0.3) + 2.0 * size
        self.ball = place(self.kinds, self.q) + away * np.array(
            [np.cos(angle), np.sin(angle)]
        )
        self.pair.local[1, 1:3] = self.ball

    def distances(self, u=0.0, half=1.0, middle=0.0, part=1.0, count=17):
        """Distances all over a box, on a grid [m]."""
        lines = u + half * np.linspace(-1.0, 1.0, count)
        shares = middle + part * np.array(
            list(product(np.linspace(-1.0, 1.0, 9), repeat=self.n))
        )
        places = lines[:, None, None]
        q = self.q + places * self.way + shares * (self.wide + places * self.grow)
        return np.linalg.norm(place(self.kinds, q) - self.ball, axis=-1) - 2.0 * RADIUS


def boxed(kinds, size):
    """A few states of an arm."""
    arm, rng = Boxed(kinds), np.random.default_rng(4)
    for _ in range(STATES):
        arm.draw(rng, size)
        yield arm, rng


@pytest.mark.parametrize("kinds", ARMS)
@pytest.mark.parametrize("size", [0.02, 0.1])
def test_all_positions_of_a_box_are_proven_as_far_as_the_nearest_is(kinds, size):
    for arm, _ in boxed(kinds, size):
        least = arm.distances().min()
        # What a proof may lose, and what is too much for it.
        for lack, known in ((0.2 * size**2, PROVEN), (-0.02 * size, NEEDED)):
            arm.m.effort.tests = 0
            proof, spare = prove(NODE, least - lack, arm.pair, arm.address)
            assert proof == known
            low, high = sorted((0.0, lack))
            assert low - GRAIN * size <= spare <= high + GRAIN * size


def test_the_smallest_box_there_is_room_for_is_not_halved():
    boxes = []
    for arm, _ in boxed(ARMS[0], 0.1):
        # Between what is proven and what is disproved all boxes have to be small.
        low, high = arm.distances().min() + np.array([-0.05, 0.01])
        for _ in range(40):
            wanted = 0.5 * (low + high)
            arm.m.effort.tests = 0
            proof, _ = prove(NODE, wanted, arm.pair, arm.address)
            low, high = (low, wanted) if proof == NEEDED else (wanted, high)
            if proof == UNSURE:
                boxes.append(arm.m.effort.tests // BOX_COST)
    assert min(boxes) == BOX_LEVELS


@pytest.mark.parametrize("kinds", ARMS)
def test_a_pair_is_measured_where_the_joints_of_a_box_bring_it_nearest(kinds):
    size, rows, witness = 0.01, np.zeros((2, 16)), np.zeros(10)
    sideways = 0
    for arm, rng in boxed(kinds, size):
        # Some balls are so near at the side that no joint goes to its end.
        if rng.random() < 0.7:
            normal = arm.ball - place(kinds, arm.q)
            normal /= np.linalg.norm(normal)
            arm.ball = place(kinds, arm.q) + (2.0 * RADIUS + 0.004) * normal
            arm.pair.local[1, 1:3] = arm.ball
        u, half = 0.3, 0.5
        arm.m.box_line[0] = u, half
        arm.m.box_place[0], arm.m.box_part[0] = 0.2, 0.6
        put_in_middle(NODE, 0, arm.pair, arm.address, rows)
        q = arm.q + u * arm.way + 0.2 * (arm.wide + u * arm.grow)
        assert rows[0, 1:3] == pytest.approx(place(kinds, q))
        apart = arm.ball - rows[0, 1:3]
        length = np.linalg.norm(apart)
        normal = np.array([*(apart / length), 0.0])
        witness[0] = length - 2.0 * RADIUS
        witness[1:4] = rows[0, 1:4] + RADIUS * normal
        witness[4:7] = arm.pair.local[1, 1:4] - RADIUS * normal
        witness[7:] = normal
        found, n = nearest(NODE, 0, rows, witness, arm.pair, arm.address)
        least = arm.distances(u, half, 0.2, 0.6).min()
        assert abs(found - least) <= 0.02 * size
        assert np.linalg.norm(n) == pytest.approx(1.0)
        sideways += least < witness[0] - 0.1 * size
    assert sideways > 10


@pytest.mark.parametrize("nearer", [-1.0, 1.0])
@pytest.mark.parametrize("along", ["line", "first", "second"])
def test_two_halves_are_the_box_and_the_nearer_one_is_looked_at_first(along, nearer):
    arm = Boxed(ARMS[0])
    m, which = arm.m, {"first": arm.chain[0], "second": arm.chain[1]}
    m.box_line[3] = 0.2, 0.3
    m.box_place[3], m.box_part[3] = 0.1, 0.4
    m.box_line[4] = 7.0, 7.0
    m.box_place[4] = m.box_part[4] = 7.0
    halve_box(3, which.get(along, LINE), nearer, arm.address)
    for k, sign in ((3, -nearer), (4, nearer)):
        line = (0.2 + 0.15 * sign, 0.15) if along == "line" else (0.2, 0.3)
        assert m.box_line[k].tolist() == pytest.approx(line)
        for b in range(len(m.parent)):
            halved = b == which.get(along)
            assert m.box_place[k, b] == pytest.approx(0.1 + 0.2 * sign * halved)
            assert m.box_part[k, b] == pytest.approx(0.2 if halved else 0.4)


@pytest.mark.parametrize("swapped", [False, True])
@pytest.mark.parametrize("kinds", ARMS)
def test_what_moves_a_pair_farthest_is_what_is_halved(kinds, swapped):
    """The line by all joints, a range by its own; in the direction that brings nearer.

    Either side may be the one that moves.
    """
    chosen = set()
    for arm, rng in boxed(kinds, 0.05):
        m, pair = arm.m, arm.pair.copy()
        if swapped:
            for name in ("kind", "body", "local"):
                pair[name] = arm.pair[name][::-1]
        # With the arm stretched out along x a slide goes along x.
        m.node_q[NEXT * NODES + NODE] = 0.0
        m.box_line[0] = 0.0, 1.0
        rows = np.zeros((2, 16))
        put_in_middle(NODE, 0, pair, arm.address, rows)
        u, half = rng.uniform(-0.5, 0.5), rng.uniform(0.05, 0.5)
        part = rng.uniform(0.3, 1.0, arm.n)
        m.box_line[0] = u, half
        m.box_part[0, arm.chain] = part
        levers = m.levers[0, : arm.n]
        line = (half * np.abs(arm.way) * levers).sum()
        ranges = part * (arm.wide + u * arm.grow) * levers
        point = np.array([*rng.normal(size=2), 0.0])
        angle = rng.uniform(-np.pi, np.pi)
        normal = np.array([np.cos(angle), np.sin(angle), 0.0])
        witness = np.array([0.1, *point, *point, *normal])
        which, nearer = longest(NODE, 0, witness, 0.5, pair, arm.address)
        k = int(ranges.argmax())
        if line > ranges[k]:
            assert (which, nearer) == (LINE, 0.5)
            chosen.add(LINE)
            continue
        assert which == arm.chain[k]
        base = np.array([sum(LENGTHS[:k]), 0.0, 0.0])
        turned = np.cross([0.0, 0.0, 1.0], point - base)
        move = turned if kinds[k] == "turn" else [1.0, 0.0, 0.0]
        towards = np.dot(normal, move) * (-1.0 if swapped else 1.0)
        assert nearer == np.sign(towards)
        chosen.add(k)
    assert len(chosen) == 3
