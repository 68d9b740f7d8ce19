"""Mistakes in the cycles of a guard.

A function plays cycles; the answer is the verdict's `why`, what the call raises, or
what it logs.
"""

import numpy as np

from armguard import Pose
from mistakes.mistake import Mistake

REST = np.zeros(4)


def step(q=None, stamp=0.02, **given):
    """A cycle of an arm at rest with one input changed, after one that is right."""

    def play(guard):
        home = guard.home
        given.setdefault("velocity", REST)
        guard.step(home, 0.0, velocity=REST, now=given.get("now") and 0.0)
        return guard.step(home if q is None else q, stamp, **given).why

    return play


def first(q):
    """The first cycle of arms at rest at a position."""
    return lambda guard: guard.step(q, 0.0, velocity=REST).why


def desired(motion, form="filter"):
    """One cycle of a desired motion."""

    def play(guard):
        return getattr(guard, form)(guard.home, motion, 0.0, velocity=REST).why

    return play


def driven(motion, form="filter", cycles=80):
    """Cycles of arms that follow a desired motion, from a middle position."""

    def play(guard):
        q, v = np.array([0.5, 0.2, 0.5, 0.2]), REST
        for k in range(cycles):
            v = getattr(guard, form)(q, motion, 0.02 * k, velocity=v).velocity
            q = np.clip(q + 0.02 * v, guard.tables.lower, guard.tables.upper)
        return ""

    return play


WRONG_HOME = [0.5, 0.1, 0.5]

CYCLES = {
    "degrees": Mistake(
        *("is at 45.0000", "joint 'a/turn'", "give radians"), first([45, 0.1, 45, 0.1])
    ),
    "degrees of a hypothetical position": Mistake(
        *("is at 45.0000", "joint 'a/turn'", "give radians"),
        lambda guard: guard.judge_at_rest([45, 0.1, 45, 0.1]).why,
    ),
    "millimetres": Mistake(
        *("is at 100.0000", "joint 'a/lift'", "give metres"),
        first([0.5, 100, 0.5, 100]),
    ),
    "degrees a second": Mistake(
        *("at 30.00 a second", "joint 'a/turn'", "check its unit, rad/s"),
        step(velocity=[30, 0, 0, 0]),
    ),
    "NaN": Mistake(
        *("is at nan", "joint 'a/lift'", "it must be finite; check the sensor"),
        step([0.5, np.nan, 0.5, 0.1]),
    ),
    "joints in reverse order": Mistake(
        *("is at 0.5000", "joint 'a/lift'", "reverse order; see guard.q_names"),
        first([0.1, 0.5, 0.1, 0.5]),
    ),
    "too few positions": Mistake(
        *("shape (3,)", "q has", "it must be 4 numbers in the order of guard.q_names"),
        step(WRONG_HOME),
    ),
    "text for positions": Mistake(
        *("a str", "q is", "it must be 4 numbers"), step("abc")
    ),
    "positions that jump": Mistake(
        *("at 25.00 a second", "joint 'a/turn'", "check units, joint order"),
        step([1.0, 0.1, 0.5, 0.1]),
    ),
    "stamps in milliseconds": Mistake(
        *("20000.0 ms", "since the last cycle", "if stamps are in milliseconds, give"),
        step(stamp=20.0),
    ),
    "a slower loop than declared": Mistake(
        *("40.0 ms", "but the scene declares period 20.0 ms", "set Scene(period=0.04)"),
        step(stamp=0.04),
    ),
    "a stamp that goes back": Mistake(
        *("by 500.0 ms", "a stamp is older", "check the clocks"), step(stamp=-0.5)
    ),
    "a stamp that stays": Mistake(
        *("0.000000 s", "the time of the cycle", "check the clock"), step(stamp=0.0)
    ),
    "two clocks": Mistake(
        *("1699999999980.0 ms", "'a'", "of the same clock"),
        step(stamp=1.7e9, now=0.02),
    ),
    "an old measurement": Mistake(
        *("(900.0 ms)", "'a'", "check sensor, network"), step(stamp=0.0, now=0.9)
    ),
    "no stamp": Mistake(
        *("no finite stamp", "'a'", "pass the time of the measurement"),
        step(stamp=None),
    ),
    "text for a stamp": Mistake(
        *("'now'", "stamp is", "they must be numbers [s]"), step(stamp="now")
    ),
    "a stamp of another robot": Mistake(
        *("'c'", "a stamp for", "known names are 'a', 'b'"), step(stamp={"c": 0.02})
    ),
    "desired degrees": Mistake(
        *("is 45", "q_desired of joint 'a/turn'", "give radians"),
        driven([45, 0.1, 45, 0.1], "filter_positions", 2),
        logged=True,
    ),
    "desired millimetres": Mistake(
        *("is 100", "q_desired of joint 'b/lift'", "give metres"),
        driven({"a": [0.5, 0.1], "b": [0.5, 100]}, "filter_positions", 2),
        logged=True,
    ),
    "desired degrees a second": Mistake(
        *("is 45 rad/s", "v_desired of joint 'a/turn'", "give rad/s: 0.7854"),
        driven([45, 0, 0, 0]),
        logged=True,
    ),
    "desired millimetres a second": Mistake(
        *("is 200 m/s", "v_desired of joint 'b/lift'", "give m/s: 0.2"),
        driven({"b/lift": 200}),
        logged=True,
    ),
    "a twist in millimetres a second": Mistake(
        *("is 150 m/s", "the twist of robot 'a'", "give m/s: 0.15"),
        driven({"a": [0, 0, 150, 0, 0, 0]}, "filter_twists"),
        logged=True,
    ),
    "a twist in degrees a second": Mistake(
        *("is 45 rad/s", "the twist of robot 'b'", "give rad/s: 0.7854"),
        driven({"b": [0, 0, 0, 0, 0, 45]}, "filter_twists"),
        logged=True,
    ),
    "a desired NaN": Mistake(
        *("is nan", "v_desired of 'b/turn'", "it must be finite"),
        desired([0, 0, np.nan, 0]),
    ),
    "a desired NaN in an array": Mistake(
        *("is nan", "v_desired of joint 'b/turn'", "it must be finite"),
        driven(np.array([0, 0, np.nan, 0])),
        logged=True,
    ),
    "too few desired velocities": Mistake(
        *(
            "shape (3,)",
            "v_desired has",
            "it must be 4 numbers in the order of guard.q",
        ),
        desired([0, 0, 0]),
    ),
    "a desired joint that is not there": Mistake(
        *("'a/trun'", "v_desired names", "known names are 'a', 'b', 'a/turn'"),
        desired({"a/trun": 0.1}),
    ),
    "a desired robot that is not there": Mistake(
        *("'panda'", "v_desired names", "known names are 'a', 'b'"),
        desired({"panda": [0, 0]}),
    ),
    "a robot without a desired position": Mistake(
        *("no vector", "q_desired has", "of robot 'b'"),
        desired({"a": [0.5, 0.1]}, "filter_positions"),
    ),
    "five numbers of a twist": Mistake(
        *("shape (5,)", "the twist of 'a'", "it must be 6 numbers in the order of vx"),
        desired({"a": [0] * 5}, "filter_twists"),
    ),
    "a twist of another tool": Mistake(
        *("'hand'", "there is a twist for", "known names are 'a', 'b', 'a/base'"),
        desired({"hand": [0] * 6}, "filter_twists"),
    ),
    "degrees of a retreat": Mistake(
        *("go to 45.0000", "joint 'a/turn'", "give radians"),
        lambda guard: guard.retreat("a", to=[45, 0.1]),
    ),
    "another robot to engage": Mistake(
        *("'panda'", "no robot is named", "known names are 'a', 'b'"),
        lambda guard: guard.engage("panda"),
    ),
    "millimetres of a contact": Mistake(
        *("is 2 m", "'a/tip' may touch 'ball': depth", "give metres: 0.002"),
        lambda guard: guard.allow("a/tip", "ball", depth=2),
    ),
    "millimetres of an obstacle": Mistake(
        *("800 m", "object 'ball': pose", "give metres: 0.8"),
        lambda guard: guard.place("ball", Pose(xyz=(800, 0, 0))),
        logged=True,
    ),
    "an obstacle that is not there": Mistake(
        *("'bal'", "no fixed object is named", "did you mean 'ball'?"),
        lambda guard: guard.place("bal", Pose()),
    ),
    "a path of too few joints": Mistake(
        *("shape (1, 3)", "a path", "rows of 4 finite positions"),
        lambda guard: guard.check_path([WRONG_HOME]),
    ),
}
