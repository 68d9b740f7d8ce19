"""The stop path: what each joint's plan is made of, how spans and reaches follow."""

from itertools import product

import numpy as np
import pytest

from armguard.kernel import kernel
from armguard.motion.free_way import FIRST_TIME, RATIO, bound_free_way
from armguard.motion.joint_stop import (
    JointStop,
    swing_within,
)
from armguard.motion.prepare import motion_of
from armguard.motion.state import (
    FREE,
    NEXT,
    NODES,
    NOW,
    Motion,
)
from armguard.motion.stop_path import (
    bound_reaches,
    joint_span,
    make_node,
    measured_speeds,
    plan_segment,
    plan_stops,
)
from armguard.record import records
from armguard.scene.compile import compile_scene
from armguard.table import Ledger, opener
from joint_stops import curve as curve_of
from joint_stops import planned
from planar import chain_scene
from planar import place as tip_of

open_motion = opener(Motion)

KINDS = ("turn", "slide")

FIGURES = {
    "velocity": 1.5,
    "acceleration": 4.0,
    "deceleration": 3.0,
    "deceleration_most": 5.0,
    "brake_deceleration": 2.0,
    "brake_delay": 0.1,
    "position_error": 0.01,
    "velocity_error": 0.02,
    "tracking_error": 0.0,
    "settle": 0.05,
    "settle_time": 0.2,
    "ramp": 0.04,
    "sensing": 0.0,
    "command": 0.02,
    "stale": 1.0,
}

# Gains of the joints' bodies: one turns the other way, and not as far.
GAINS = (-0.7, 1.3)


@kernel(entry=True)
def plan(which, address):
    plan_stops(which, open_motion(address))


@kernel(entry=True)
def segment(start, end, address):
    plan_segment(start, end, open_motion(address))


@kernel(entry=True)
def node(which, number, address):
    make_node(which, number, open_motion(address))


@kernel(entry=True)
def reaches(which, bodies, address):
    m = open_motion(address)
    measured_speeds(m)
    bound_reaches(which, bodies, open_motion(address))


@kernel(entry=True)
def free(k, address):
    bound_free_way(k, open_motion(address))


@kernel(entry=True)
def span(which, j, start, end, address):
    return joint_span(which, j, start, end, open_motion(address))


@kernel(entry=True)
def swing_left(start, end, first, last, stop):
    return swing_within(start, end, first, last, stop)


class Planned:
    """The prediction of a small arm with random clocks and velocities."""

    def __init__(self, seed=1):
        self.tables = compile_scene(chain_scene(KINDS, (9.0, 9.0), FIGURES))
        self.m = motion_of(self.tables, budget=1)
        self.ledger = Ledger(self.m)
        self.address = self.ledger.lines.ctypes.data
        self.rng = np.random.default_rng(seed)
        self.bodies = [int(b) for b in self.m.joints[self.m.length.argmax()][:2]]
        self.m.gain[self.bodies, 0] = GAINS
        # Slower, and known less well.
        self.m.joint_figures[1].velocity = 0.8
        self.m.joint_figures[1].swing_share = self.m.joint_figures[1].settle / 0.8
        self.m.joint_figures[1].position_error = 0.003

    def draw(self):
        """Velocities and clocks; NOW takes effect before NEXT."""
        m, rng = self.m, self.rng
        middle, half = rng.uniform(-0.8, 0.8, 2), rng.uniform(0.0, 0.1, 2)
        m.v_low[:], m.v_high[:] = middle - half, middle + half
        m.driven[:] = rng.uniform(-0.2, 0.8, m.driven.shape)
        for name in m.clock.dtype.names:
            m.clock[name] = 0
        for which in (NEXT, NOW):
            m.clock[which].age = 0.015
            m.clock[which].reaction = rng.uniform(0.02, 0.06)
            m.clock[which].passed = rng.choice([0.0, 0.02])

    def known(self, which, j, side, brakes=False):
        """The plan of a joint by its figures."""
        m, f, out = self.m, self.m.joint_figures[j], records(1, JointStop)[0]
        deceleration = "brake_deceleration" if brakes else "deceleration"
        planned(
            m.v_high[j] if side == 0 else -m.v_low[j],
            -m.v_low[j] if side == 0 else m.v_high[j],
            f.velocity,
            m.driven[2 * which + j, side],
            f.acceleration,
            m.clock[which].reaction,
            0.0 if brakes else FIGURES["ramp"],
            m.clock[which].passed,
            f[deceleration],
            np.inf if brakes else f.deceleration_most,
            f.settle,
            FIGURES["settle_time"],
            np.zeros(0),
            out,
        )
        return out


@pytest.mark.parametrize("brakes", [False, True])
def test_a_plan_is_that_of_its_joints_and_the_range_that_of_both_directions(brakes):
    one = Planned()
    m, errors = one.m, one.m.joint_figures.position_error
    for _ in range(20):
        one.draw()
        m.clock.braking = brakes
        stamp = int(m.effort.stamp)
        for which in (NEXT, NOW):
            plan(which, one.address)
            rests = []
            for j, b in enumerate(one.bodies):
                stops = [one.known(which, j, side, brakes) for side in range(2)]
                assert m.up[2 * which + j].tolist() == pytest.approx(stops[0].tolist())
                assert m.down[2 * which + j].tolist() == pytest.approx(
                    stops[1].tolist()
                )
                rests.append(max(stop.rest_time for stop in stops) - 0.015)
                ways = [
                    errors[j] + max(stop.travel + stop.swing, stop.swing_back)
                    for stop in stops
                ]
                ends = np.sort([GAINS[j] * ways[0], -GAINS[j] * ways[1]])
                low, high = m.middle[which, b] + m.width[which, b] * np.array([-1, 1])
                assert [low, high] == pytest.approx(ends)
                assert m.spread[which, b] == pytest.approx(np.abs(ends).max())
            if which == NEXT:
                horizon = max(rests)
        assert m.effort.stamp == stamp + 1
        assert m.span.horizon == pytest.approx(horizon)
        known = horizon + FIGURES["settle_time"]
        assert m.span.settled == pytest.approx(known)


def test_what_is_left_out_neither_moves_nor_errs():
    one = Planned()
    one.draw()
    one.m.clock.still = 1
    plan(NEXT, one.address)
    assert not one.m.spread[NEXT].any()
    assert not one.m.width[NEXT].any()
    assert one.m.span.horizon == one.m.span.settled == 0.0
    reaches(NEXT, one.tables.bodies, one.address)
    assert not one.m.rate.any()
    free(3, one.address)
    assert not one.m.spread[FREE + 3].any()


@pytest.mark.parametrize("speed", [0.0, 0.4])
def test_a_stop_under_way_swings_as_is_remembered_though_it_rests(speed):
    one = Planned()
    one.draw()
    m = one.m
    m.clock.swings = 1
    # One may get to the other side of its rest, the other not as far.
    m.q[:] = 0.5, -0.2
    m.swings.swing = 0.1, 0.3
    m.swings.lowest = 0.2, -0.65
    m.swings.highest = 0.55, -0.3
    bounces = [(0.05, 0.2), (0.0, 0.45)]
    # It came to rest a while ago, by an old measurement.
    m.v_low[:] = m.v_high[:] = speed
    m.driven[:] = 0.0
    m.joint_figures.acceleration = 1e-12
    m.clock.age = 0.5
    plan(NEXT, one.address)
    for j in range(2):
        for side, stop in enumerate((m.up[j], m.down[j])):
            # What moves away still does not swing on in this direction.
            goes_back = speed > 0.0 and side == 1
            assert (stop.opposite_speed > 0.0) == goes_back
            assert stop.swing == (0.0 if goes_back else m.swings[j].swing)
            assert stop.swing_back == pytest.approx(bounces[j][side])
            rest = max(m.up[j].rest_time, m.down[j].rest_time, 0.0)
            assert stop.settled == pytest.approx(rest + FIGURES["settle_time"])
    assert m.span.horizon == 0.0
    assert m.span.settled == pytest.approx(FIGURES["settle_time"])


def bow_of(one, which, j, side, start):
    """Most a side of a stop is bent from a time on [rad/s²]."""
    f, stop = one.m.joint_figures[j], one.known(which, j, side)
    speed = one.m.v_high[j] if side == 0 else -one.m.v_low[j]
    a, least, most = (
        f.acceleration, f.deceleration, f.deceleration_most
    )  # fmt: skip
    if speed < 0.0 and stop.travel == 0.0:
        return max(a, most)
    return least if start >= one.m.clock[which].reaction else max(a, least)


def test_a_span_is_the_chord_of_both_curves_and_their_bow():
    one, kinds, back = Planned(), set(), 0
    m = one.m
    for _ in range(40):
        one.draw()
        plan(NEXT, one.address)
        for j, number in product(range(2), (1, 2, 3, 5, 9, 15)):
            first = 1 << (number.bit_length() - 1)
            share = (np.array([number, number + 1]) - first) / first
            start, end = m.span.horizon * share
            found = span(NEXT, j, start, end, one.address)
            middle, half, wide_0, wide_1 = found
            times = 0.015 + np.linspace(start, end, 33)
            error = m.joint_figures[j].position_error
            edges = []
            for side, stop in enumerate((m.up[j], m.down[j])):
                curve = curve_of(times, stop)
                bow = bow_of(one, NEXT, j, side, times[0])
                most = min(0.125 * bow * (end - start) ** 2, abs(curve[-1] - curve[0]))
                ends = curve[0], curve[-1]
                swings = swing_left(times[0], times[-1], *ends, stop)
                ends = np.array(ends) + swings + most + error
                reached = curve + error
                if times[0] < stop.settled:
                    # It may be where it swings back to at any time.
                    reached = np.maximum(reached, stop.swing_back + error)
                    back += (reached > curve + error).any()
                edges.append((*ends, reached))
                kinds.add((side, most < abs(curve[-1] - curve[0]), stop.travel > 0.0))
            line = np.array([middle - half, middle + half])
            wide = np.array([wide_0, wide_1])
            assert line + wide == pytest.approx(edges[0][:2], abs=1e-12)
            assert line - wide == pytest.approx([-edges[1][0], -edges[1][1]], abs=1e-12)
            u = np.linspace(0.0, 1.0, 33)
            high = (line + wide)[0] + u * ((line + wide)[1] - (line + wide)[0])
            low = (line - wide)[0] + u * ((line - wide)[1] - (line - wide)[0])
            assert (edges[0][2] <= high + 1e-12).all()
            assert (-edges[1][2] >= low - 1e-12).all()
            node(NEXT, number, one.address)
            at, b = NEXT * NODES + number, one.bodies[j]
            assert m.node_q[at, j] - m.q[j] == pytest.approx(middle)
            assert m.node_way[at, b] == pytest.approx(GAINS[j] * half)
            assert m.node_wide[at, b] == pytest.approx(abs(GAINS[j]) * wide.mean())
            grow = 0.5 * abs(GAINS[j]) * (wide_1 - wide_0)
            assert m.node_grow[at, b] == pytest.approx(grow)
    assert len(kinds) >= 6
    assert back > 20


def test_axes_in_the_middle_of_a_span_are_where_its_joints_are():
    one = Planned()
    one.m.gain[one.bodies, 0] = 1.0
    one.draw()
    one.m.q[:] = 0.7, 0.2
    plan(NEXT, one.address)
    node(NEXT, 3, one.address)
    q = one.m.node_q[NEXT * NODES + 3]
    at = (NEXT * NODES + 3) * len(one.m.parent)
    turn, slide = (one.m.node_axes[at + b] for b in one.bodies)
    assert turn == pytest.approx([0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
    assert slide[:3] == pytest.approx([np.cos(q[0]), np.sin(q[0]), 0.0])
    beyond = slide[3:5] - tip_of(KINDS, q)
    assert np.cross([*slide[:2], 0.0], [*beyond, 0.0]) == pytest.approx([0, 0, 0])


def test_a_straight_line_is_divided_evenly_and_nothing_is_unknown():
    one = Planned()
    m, first, last = one.m, np.array([0.1, -0.4]), np.array([0.9, 0.3])
    segment(first, last, one.address)
    for j, b in enumerate(one.bodies):
        size = abs(GAINS[j] * 0.5 * (last - first)[j])
        assert m.spread[NEXT, b] == m.width[NOW, b] == pytest.approx(size)
        assert m.middle[NEXT, b] == m.speed[b] == 0.0
    for number in (1, 2, 5, 7, 12):
        count = 1 << (number.bit_length() - 1)
        node(NEXT, number, one.address)
        at = NEXT * NODES + number
        middle = first + (last - first) * (number - count + 0.5) / count
        assert m.node_q[at] == pytest.approx(middle)
        half = 0.5 * (last - first) / count
        assert m.node_way[at, one.bodies] == pytest.approx(half * GAINS)
        assert not m.node_wide[at].any()
        assert not m.node_grow[at].any()


def test_ways_and_speeds_of_points_are_those_of_the_levers():
    one = Planned()
    m = one.m
    for _ in range(5):
        one.draw()
        plan(NOW, one.address)
        reaches(NOW, one.tables.bodies, one.address)
        levers = m.levers[0, :2]
        assert (levers > 0.0).all()
        assert m.reach[NOW, 0] == pytest.approx(m.spread[NOW, one.bodies] @ levers)
        fastest = np.maximum(np.abs(m.v_low), np.abs(m.v_high))
        speeds = np.abs(GAINS) * fastest
        assert m.speed[one.bodies] == pytest.approx(speeds)
        assert m.rate[0] == pytest.approx(speeds @ levers)


def test_until_a_time_a_joint_gets_as_far_as_it_can_speed_up():
    one = Planned()
    m, errors = one.m, one.m.joint_figures.position_error
    for k in range(12):
        one.draw()
        # One is faster than it should be.
        m.v_high[0] = 1.7 if k % 3 == 0 else m.v_high[0]
        m.effort.stamp += 1
        free(k, one.address)
        times = np.linspace(0.0, FIRST_TIME * RATIO**k, 20_001)
        for j, b in enumerate(one.bodies):
            ends = []
            for measured in (m.v_high[j], -m.v_low[j]):
                speed = max(measured, 0.0)
                top = max(m.joint_figures[j].velocity, speed)
                speeds = np.minimum(speed + FIGURES["acceleration"] * times, top)
                ends.append(errors[j] + np.trapezoid(speeds, times))
            known = np.sort([GAINS[j] * ends[0], -GAINS[j] * ends[1]])
            middle, width = m.middle[FREE + k, b], m.width[FREE + k, b]
            assert [middle - width, middle + width] == pytest.approx(known, rel=1e-6)
            assert m.spread[FREE + k, b] == pytest.approx(np.abs(known).max(), rel=1e-6)
