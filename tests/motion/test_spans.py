"""A slide that does its worst never leaves the spans of time its path is divided into.

Where a bound is exact its worst motion touches it, so a little less would be left.
"""

from itertools import product

import numpy as np
import pytest

from armguard.kernel import kernel
from armguard.motion.state import NEXT, NODES, Motion
from armguard.motion.stop_path import make_node
from armguard.table import Ledger, opener
from sliding import EXACT, let_go, motion_of, rest_of, slides

open_motion = opener(Motion)

# The whole path, its halves and so on, down to sixteenths.
SPANS = range(1, 32)

PLACES = np.linspace(-1.0, 1.0, 101)

# What small steps may be off by [m].
GRAIN = 1e-6

PERIOD = 1e-3

# Figures of a slide, its speed [m/s] and the age of its measurement [s].
CASES = {
    "a hard stop": ({}, 1.0, 0.0),
    "an old measurement": ({}, 1.0, 0.05),
    "an error of its position": ({"position_error": 0.01}, 1.0, 0.0),
    "an error of its velocity": ({"velocity_error": 0.2}, 1.0, 0.0),
    "a late order": ({"command": 0.1, "acceleration": 5.0}, 0.5, 0.0),
    "a ramp": ({"ramp": 0.1}, 1.0, 0.0),
    "a swing": ({"settle": 0.02, "settle_time": 0.1}, 1.0, 0.0),
    "a swing after a ramp": (
        {"settle": 0.02, "settle_time": 0.1, "ramp": 0.05, "command": 0.02},
        1.0,
        0.0,
    ),
    "a stop of unknown hardness": (
        {"settle": 0.01, "deceleration": 4.0, "deceleration_most": np.inf},
        0.6,
        0.0,
    ),
    "most of it at once": (
        {"acceleration": 8.0, "deceleration": 2.0, "command": 0.05, "settle": 0.005},
        -0.2,
        0.02,
    ),
}


@kernel(entry=True)
def write_span(plan, node, lines):
    make_node(plan, node, open_motion(lines))


def span(guard, node):
    """Start and end of a span [s], and its least and greatest positions at PLACES."""
    motion = guard._motion
    write_span(NEXT, node, Ledger(motion).lines)
    at = NEXT * NODES + node
    body = int(np.flatnonzero(motion.q_index == 0)[-1])
    way, wide, grow = (
        rows[at, body] for rows in (motion.node_way, motion.node_wide, motion.node_grow)
    )
    middle = motion.node_q[at, 0] - motion.q[0] + PLACES * way
    first = 1 << (node.bit_length() - 1)
    share = (np.array([node, node + 1]) - first) / first
    start, end = motion.span.horizon * share
    return start, end, middle - wide - PLACES * grow, middle + wide + PLACES * grow


def motions(figures, speed, age):
    """Slides at the corners of what is declared: rest, times [s] from now on, ways [m].

    Each is pushed one way or the other, stops as late as it may or earlier, as hard as
    it may or less, and swings on or back as soon as it rests.
    """
    f = {"settle": 0.0, "velocity_error": 0.0, "ramp": 0.0, **EXACT, **figures}
    reaction = age + f.get("command", 0.0) + PERIOD
    hardest = min(f["deceleration_most"], 50.0)
    for error, push, effect, ramp, brake, turn in product(
        (-1.0, 1.0),
        (-f["acceleration"], f["acceleration"]),
        (0.0, 0.5 * reaction, reaction),
        {0.0, f["ramp"]},
        np.geomspace(f["deceleration"], hardest, 4),
        (-1.0, 1.0) if f["settle"] else (1.0,),
    ):
        own = {**figures, "deceleration": brake, "ramp": ramp}
        speed_now = speed + error * f["velocity_error"]
        times, speeds, ways = motion_of(own, speed_now, push, effect)
        begins = speeds[np.searchsorted(times, effect)]
        rest = rest_of(times, speeds)
        ways[times > rest] += turn * f["settle"] * begins / f["velocity"]
        for off in (-f["position_error"], f["position_error"]):
            yield rest - age, times - age, ways + off


@pytest.mark.parametrize("sign", [-1.0, 1.0])
@pytest.mark.parametrize("case", CASES)
def test_no_motion_within_its_figures_leaves_a_span(case, sign):
    figures, speed, age = CASES[case]
    guard = slides(figures, period=PERIOD)
    let_go(guard)
    guard.step([0.0], 5.0 - age, velocity=[sign * speed], now=5.0)
    spans = [span(guard, node) for node in SPANS]
    horizon = guard._motion.span.horizon
    for rest, times, ways in motions(figures, sign * speed, age):
        assert rest <= horizon
        for start, end, low, high in spans:
            moments = start + 0.5 * (PLACES + 1.0) * (end - start)
            way = np.interp(moments, times, ways)
            assert (way <= high + GRAIN).all()
            assert (way >= low - GRAIN).all()


def test_a_slide_with_a_command_to_rest_stops_going_back_as_hard_as_it_may():
    figures = {"acceleration": 100.0, "command": 0.05, "deceleration": 5.0}
    guard, speed, x = slides(figures, period=PERIOD), -0.3, 0.0
    let_go(guard)
    for k in range(200):
        now, desired = 5.0 + k * PERIOD, speed if k < 100 else 0.0
        guard.filter([x], [desired], now, velocity=[speed], now=now)
        x += speed * PERIOD
        if k < 100:
            continue
        # It is not driven forward, but may be made to stand at once.
        standing = -speed / figures["acceleration"]
        times, _, ways = motion_of(figures, speed, figures["acceleration"], standing)
        for node in SPANS:
            start, end, _, high = span(guard, node)
            moments = start + 0.5 * (PLACES + 1.0) * (end - start)
            assert (np.interp(moments, times, ways) <= high + GRAIN).all()
