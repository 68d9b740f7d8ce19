"""A pair is proven on a stop path as far as its joints can bring it, span by span.

Joints may be anywhere between their two curves, each on its own; times and positions
are tried on a grid.
"""

from itertools import product

import numpy as np
import pytest

from armguard.kernel import kernel
from armguard.motion.pair_proof import prove_by_spans
from armguard.motion.pair_state import NEEDED, PROVEN
from armguard.motion.prepare import motion_of
from armguard.motion.state import (
    NEXT,
    Motion,
)
from armguard.motion.stop_path import plan_stops
from armguard.scene.compile import compile_scene
from armguard.table import Ledger, opener
from joint_stops import curve
from planar import chain_scene, pair_of, place
from sliding import EXACT, RADIUS

open_motion = opener(Motion)

FIGURES = {
    **EXACT,
    "velocity": 1.5,
    "acceleration": 2.0,
    "deceleration": 3.0,
    "deceleration_most": 4.0,
    "position_error": 1e-3,
    "settle_time": 0.5,
}

ARMS = [("turn", "turn"), ("turn", "slide")]

STATES, MOMENTS = 25, 65

# What a proof may lose beside what a pair has left [m].
LOSS, GRAIN = 5e-4, 1e-5


@kernel(entry=True)
def plan(address):
    plan_stops(NEXT, open_motion(address))


@kernel(entry=True)
def prove(known, pair, address):
    return prove_by_spans(known, pair, open_motion(address))


class Stopping:
    """An arm that stops, and a ball."""

    def __init__(self, kinds):
        self.kinds = kinds
        self.tables = compile_scene(chain_scene(kinds, (9.0, 9.0), FIGURES))
        self.m = motion_of(self.tables, budget=1 << 40)
        self.ledger = Ledger(self.m)
        self.address = self.ledger.lines.ctypes.data
        self.pair = pair_of(self.tables)

    def draw(self, rng):
        """A state, its path, and a ball somewhere beside it."""
        m = self.m
        m.q[:] = rng.uniform(-0.8, 0.8, 2)
        m.v_low[:] = rng.uniform(-0.8, 0.7, 2)
        m.v_high[:] = m.v_low + 0.02
        m.driven[:] = FIGURES["velocity"]
        m.clock[NEXT].reaction = 0.02
        plan(self.address)
        self.times = np.linspace(0.0, m.span.horizon, MOMENTS)
        shares = np.array(list(product(np.linspace(0.0, 1.0, 5), repeat=2)))
        error = FIGURES["position_error"]
        low = np.stack([-curve(self.times, m.down[j]) - error for j in range(2)], -1)
        high = np.stack([curve(self.times, m.up[j]) + error for j in range(2)], -1)
        q = m.q + low[:, None] + shares * (high - low)[:, None]
        self.tips = place(self.kinds, q)
        angle, k = rng.uniform(-np.pi, np.pi), rng.integers(MOMENTS)
        away = 2.0 * RADIUS + 0.05 + 0.1 * rng.random()
        direction = np.array([np.cos(angle), np.sin(angle)])
        far = self.tips[k] @ direction
        self.ball = self.tips[k, far.argmax()] + away * direction
        self.pair.local[1, 1:3] = self.ball

    def left(self, drift):
        """Least of distance and what grows with time [m]."""
        apart = np.linalg.norm(self.tips - self.ball, axis=-1).min(axis=1)
        apart -= 2.0 * RADIUS
        # At rest it may still be met until it has settled.
        times = self.times.copy()
        times[-1] = self.m.span.settled
        return (apart - drift * times).min()


@pytest.mark.parametrize("drift", [0.0, 0.01])
@pytest.mark.parametrize("kinds", ARMS)
def test_what_no_motion_breaks_is_proven_and_what_one_does_is_not(kinds, drift):
    arm, rng = Stopping(kinds), np.random.default_rng(6)
    tightness = []
    for _ in range(STATES):
        arm.draw(rng)
        left = arm.left(drift)
        # What a span takes for its end is later than the moment in it.
        loss = LOSS + drift * arm.m.span.horizon / 64.0
        for spare in (loss, 3.0 * loss, -1e-4):
            arm.m.effort.tests = 0
            arm.pair.need, arm.pair.drift = left - spare, drift
            proof, found = prove(-np.inf, arm.pair, arm.address)
            assert (proof == PROVEN) == (spare > 0.0)
            if proof == PROVEN:
                assert 0.0 <= found <= spare + GRAIN
                tightness.append(found / spare)
                # What is known of the whole path holds for its parts.
                again = prove(0.99 * spare, arm.pair, arm.address)
                assert again == (PROVEN, pytest.approx(0.99 * spare, abs=loss))
                assert again[1] >= 0.99 * spare
    # A pair that has little left is looked at in shorter spans.
    assert np.mean(tightness) > 0.5


@pytest.mark.parametrize("kinds", ARMS)
def test_of_a_pair_too_near_all_the_way_only_the_end_is_looked_at(kinds):
    arm, rng = Stopping(kinds), np.random.default_rng(7)
    for _ in range(STATES):
        arm.draw(rng)
        farthest = np.linalg.norm(arm.tips - arm.ball, axis=-1).max()
        arm.pair.need, arm.pair.drift = farthest + 0.1, 0.0
        arm.m.effort.tests = 0
        proof, deficit = prove(-np.inf, arm.pair, arm.address)
        assert proof == NEEDED and deficit < -0.1
        # The whole path and its end, each with one box of joint positions.
        assert arm.m.effort.tests <= 8
