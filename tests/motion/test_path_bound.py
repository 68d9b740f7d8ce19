"""The bound of a whole path is the one that docs/proof.md writes down, to the bit.

It is derived again by differences of a chain of joints, and holds for its true motion.
"""

from itertools import product

import numpy as np
import pytest

from armguard.kernel import kernel
from armguard.motion.gap_bound import curvature
from armguard.robot.kinematics import PRISMATIC, REVOLUTE
from planar import KINDS, LENGTHS, LIMIT, chain_guard, place
from sliding import EXACT, RADIUS, let_go

# What is left: more than would be looked at in shorter spans [m].
LEFT = 3e-3

# Short, so that no joint moves much before its stop [s].
PERIOD = 1e-4


def differences(f, x, step=1e-3):
    """Value, first and second derivatives of f at x, by central differences."""
    n = len(x)
    at = lambda *moved: f(x + step * sum(moved, np.zeros(n)))  # noqa: E731
    unit = np.eye(n)
    g = np.array([(at(e) - at(-e)) / (2.0 * step) for e in unit])
    h = np.array(
        [
            [
                (at(a, b) - at(a, -b) - at(-a, b) + at(-a, -b)) / (4 * step**2)
                for b in unit
            ]
            for a in unit
        ]
    )
    return f(x), g, h


def third_order(kinds, levers, sizes):
    """1/6 Σ Σ Σ |Δi Δj Δk| R, the lever of the last joint of the three.

    What slides is turned by the joints before it, and turns nothing itself.
    """
    total = 0.0
    for triple in product(range(len(kinds)), repeat=3):
        slides = [k for k in triple if kinds[k] == "slide"]
        turns = [k for k in triple if kinds[k] == "turn"]
        if len(slides) > 1 or (slides and max(turns) > slides[0]):
            continue
        size = np.prod([sizes[k] for k in triple])
        total += size * (1.0 if slides else levers[max(turns)])
    return total / 6.0


@kernel(entry=True)
def left_out(chain, first, levers, kinds, sizes):
    return curvature(chain, first, len(chain), levers, kinds, sizes)


@pytest.mark.parametrize("kinds", list(product(KINDS, repeat=3)))
@pytest.mark.parametrize("first", [0, 1])
def test_what_the_second_order_leaves_out_is_summed_up_triple_by_triple(kinds, first):
    rng = np.random.default_rng(3)
    numbers = [REVOLUTE if kind == "turn" else PRISMATIC for kind in kinds]
    chain = np.array([4, 2, 5], dtype=np.int32)
    for _ in range(5):
        levers, sizes, of_body = rng.uniform(0.1, 1.0, 3), rng.random(3), np.zeros(6)
        kind_of_body = np.zeros(6, dtype=np.int32)
        of_body[chain], kind_of_body[chain] = sizes, numbers
        found = left_out(chain, first, levers, kind_of_body, of_body)
        known = third_order(kinds[first:], levers[first:], sizes[first:])
        assert found == pytest.approx(known, rel=1e-12)


Q = np.array([0.2, 0.1, -0.1])
WAYS = np.array([0.2, 0.1, 0.05])

# Well away from where the tip moves to, so that a bound of speed alone is too wide.
DIRECTION = np.array([np.cos(1.0), np.sin(1.0)])

CHAINS = [
    ("turn",),
    ("turn", "turn"),
    ("turn", "slide"),
    ("slide", "turn"),
    ("turn", "turn", "turn"),
]


def levers_of(kinds):
    """Farthest a point of the tip gets from each axis, slides at their limits [m]."""
    longest = [
        length + LIMIT * (kind == "slide")
        for length, kind in zip(LENGTHS, kinds, strict=False)
    ]
    return [RADIUS + sum(longest[k:]) for k in range(len(kinds))]


def left_of(kinds, need, mode):
    """What is left of LEFT beyond a need, by the guard [m]."""
    n = len(kinds)
    ball = place(kinds, Q[:n]) + (2.0 * RADIUS + need + LEFT) * DIRECTION
    guard = chain_guard(kinds, ball, period=PERIOD, mode=mode)
    let_go(guard)
    # Before its stop takes effect each goes on for a cycle.
    d = EXACT["deceleration"]
    velocity = d * (np.sqrt(PERIOD**2 + 2.0 * WAYS[:n] / d) - PERIOD)
    pair = guard.step(Q[:n], 5.0, velocity=velocity, now=5.0).nearest
    assert pair.distance == pytest.approx(need + LEFT, abs=1e-12)
    return pair.headroom


@pytest.mark.parametrize("kinds", CHAINS)
def test_the_bound_of_a_path_is_that_of_its_derivatives(kinds):
    n = len(kinds)
    q, ways = Q[:n], WAYS[:n]
    _, g, h = differences(lambda x: float(DIRECTION @ place(kinds, x)), q)
    assert (g > 0.0).all()
    second = g @ ways + 0.5 * ways @ h @ ways
    need = second + third_order(kinds, levers_of(kinds), ways)
    true = max(
        DIRECTION @ (place(kinds, q + share * ways) - place(kinds, q))
        for share in product(np.linspace(0.0, 1.0, 21), repeat=n)
    )
    assert true <= need
    assert left_of(kinds, need, "path") == pytest.approx(LEFT, abs=1e-6)


@pytest.mark.parametrize("kinds", CHAINS)
def test_the_bound_of_speed_is_that_of_its_levers(kinds):
    levers = [
        1.0 if kind == "slide" else lever
        for kind, lever in zip(kinds, levers_of(kinds), strict=True)
    ]
    need = float(np.dot(levers, WAYS[: len(kinds)]))
    assert left_of(kinds, need, "speed") == pytest.approx(LEFT, abs=1e-6)
