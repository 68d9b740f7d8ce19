"""The greatest of a quadratic form of joints over their ranges, and along their lines.

No position of the joints exceeds the bound, and where the form is monotone in every
joint one of them reaches it.
"""

from itertools import product

import numpy as np
import pytest

from armguard.kernel import kernel
from armguard.lanes import WIDTH, splat, store
from armguard.motion.joint_rows import JointRow, SideMotion, line_ends, widest
from armguard.record import records

DRAWS = 200
GRAIN = 1e-12

# Places on a line.
PLACES = np.linspace(-1.0, 1.0, 21)


N = (0.0, 0.0, 1.0)


@kernel(entry=True)
def write_greatest(rows, hessian, out):
    store(out, 0, widest(SideMotion(N, False, 0.0, 0, len(rows), rows, hessian)))


@kernel(entry=True)
def write_greatest_on_line(rows, hessian, out):
    side = SideMotion(N, True, 0.0, 0, len(rows), rows, hessian)
    line_ends(splat(0.0), side, out)


def in_lanes(numbers):
    """A number in each of eight lanes, shape (k, 8)."""
    return np.repeat(numbers[:, None], WIDTH, axis=1)


def greatest(rows, hessian):
    out = np.zeros(WIDTH)
    write_greatest(rows, np.repeat(hessian, WIDTH, axis=1), out)
    assert (out == out[0]).all()
    return out[0]


def greatest_on_line(rows, hessian):
    out = np.zeros((2, WIDTH))
    write_greatest_on_line(rows, np.repeat(hessian, WIDTH, axis=1), out)
    assert (out.T == out[:, 0]).all()
    return out[:, 0]


def forms(joints, steep):
    """Random gradients and second derivatives; the greater `steep`, the less bent."""
    rng = np.random.default_rng(6)
    for _ in range(DRAWS):
        g = steep * rng.normal(size=joints)
        h = rng.normal(size=(joints, joints))
        yield rng, g, h + h.T


def shares(rng, joints):
    """Places in the ranges of joints: corners, middles, and others, shape (k, n)."""
    corners = np.array(list(product((-1.0, 0.0, 1.0), repeat=joints)))
    return np.concatenate([corners, rng.uniform(-1.0, 1.0, (100, joints))])


def value(g, h, moves):
    """The form at moves of joints, shape (k, n)."""
    return moves @ g + 0.5 * np.einsum("...j,jk,...k", moves, h, moves)


@pytest.mark.parametrize("steep", [0.3, 1.0, 3.0])
@pytest.mark.parametrize("joints", [1, 2, 3, 4])
def test_no_position_in_the_ranges_exceeds_the_bound(joints, steep):
    for rng, g, h in forms(joints, steep):
        rows = records(joints, JointRow)
        width = rng.uniform(0.1, 1.0, joints)
        rows.end_gradient, rows.end_width = in_lanes(g), in_lanes(width)
        found = greatest(rows, h)
        true = value(g, h, width * shares(rng, joints)).max()
        assert true <= found + GRAIN
        doubt = np.abs(h) @ width
        if (np.abs(g) >= doubt).all():
            assert found == pytest.approx(true, abs=GRAIN)
        elif not (np.abs(g) >= doubt).any():
            # Every part at its largest.
            known = width @ (np.abs(g) + 0.5 * doubt)
            assert found == pytest.approx(known, abs=GRAIN)


def test_what_one_joint_decides_the_other_one_is_left_with():
    undecided = 0
    for rng, g, h in forms(2, 1.0):
        rows = records(2, JointRow)
        width = rng.uniform(0.1, 1.0, 2)
        rows.end_gradient, rows.end_width = in_lanes(g), in_lanes(width)
        if not abs(g[0]) >= np.abs(h[0]) @ width:
            continue
        move = np.sign(g[0]) * width[0]
        left = g[1] + h[1, 0] * move
        if not abs(left) < abs(h[1, 1]) * width[1]:
            continue
        known = g[0] * move + 0.5 * h[0, 0] * move**2
        known += width[1] * (abs(left) + 0.5 * abs(h[1, 1]) * width[1])
        assert greatest(rows, h) == pytest.approx(known, abs=GRAIN)
        undecided += 1
    assert undecided > 5


@pytest.mark.parametrize("steep", [0.3, 3.0, 30.0])
@pytest.mark.parametrize("joints", [1, 2, 3])
def test_no_position_on_a_line_exceeds_the_bounds_of_its_ends(joints, steep):
    for rng, g, h in forms(joints, steep):
        rows = records(joints, JointRow)
        way, wide = rng.normal(size=joints), rng.uniform(0.0, 1.0, joints)
        # Wide, or growing, or neither.
        wide *= rng.integers(0, 2)
        grow = wide * rng.uniform(-1.0, 1.0, joints)
        rows.gradient, rows.half_line, rows.width = in_lanes(g), way, wide
        rows.widening = grow
        ends = greatest_on_line(rows, h)
        places = shares(rng, joints)
        for u in PLACES:
            true = value(g, h, u * way + places * (wide + u * grow)).max()
            bound = 0.5 * ((1.0 - u) * ends[0] + (1.0 + u) * ends[1])
            assert true <= bound + GRAIN
        # In between the form bows above its ends by no more than this.
        bow = max(-0.5 * way @ h @ way, 0.0)
        bow += (np.abs(way) + 0.5 * np.abs(grow)) @ np.abs(h) @ np.abs(grow)
        corners = np.array(list(product((-1.0, 1.0), repeat=joints)))
        for u, bound in zip((-1.0, 1.0), ends, strict=True):
            width = wide + u * grow
            if (np.abs(g + u * h @ way) >= np.abs(h) @ width).all():
                true = value(g, h, u * way + width * corners).max()
                assert bound == pytest.approx(true + bow, abs=GRAIN)
