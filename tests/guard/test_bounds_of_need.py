"""What a pair needs is what its two sides can come nearer, for each declared figure.

Each case makes one figure large and all others as small as they may be, so that the
need is the worst case of that figure: a little above it the arm goes on, and a little
below it is stopped.
"""

from dataclasses import replace

import numpy as np
import pytest

from armguard.geometry import Pose, Sphere
from armguard.guard import Level, Reason
from armguard.guard.watch import FEW
from armguard.respond import Guard
from armguard.robot.model import Link
from armguard.scene import Scene
from armguard.scene.settings import IndexSettings
from sliding import (
    APART,
    EXACT,
    MEASURED,
    RADIUS,
    REACH,
    UNTOLD_CYCLE,
    at_gap,
    let_go,
    slide,
    slides,
    worst_stop,
)

# How far above and below its need a pair is put [m].
GRAIN = 3e-4

# Time between cycles; none of the cases is about it unless it says so [s].
PERIOD = 1e-4

# Figures of the slide, and what else differs: its speed [m/s], the age of its
# measurement [s], settings of the scene. Without `now` the age is unknown.
CASES = {
    "floor": ({}, {"buffer": 0.05}),
    "age": ({}, {"speed": 1.0, "age": 0.1}),
    "age that is unknown": ({"sensing": 0.1}, {"speed": 1.0, "has_time": False}),
    "delay of an order": ({"command": 0.1}, {"speed": 1.0}),
    "period": ({}, {"speed": 1.0, "period": 0.1}),
    "lateness": ({}, {"speed": 1.0, "late": 0.1}),
    "acceleration": ({"acceleration": 20.0, "command": 0.05}, {}),
    "top speed": (
        {"acceleration": 40.0, "command": 0.1, "velocity": 1.0, "deceleration": 20.0},
        {},
    ),
    "deceleration": ({"deceleration": 5.0}, {"speed": 1.0}),
    "ramp": ({"ramp": 0.1}, {"speed": 1.0}),
    "stop within its ramp": ({"ramp": 0.8}, {"speed": 0.5}),
    "swing": ({"settle": 0.1, "settle_time": 0.1}, {"speed": 1.0}),
    "position error": ({"position_error": 0.04}, {}),
    "velocity error": ({"velocity_error": 1.0, "command": 0.05}, {"speed": 0.1}),
    "velocity error at top speed": (
        {"velocity": 1.0, "velocity_error": 0.5, "command": 0.1},
        {"speed": 0.9},
    ),
    "model error": ({"model_error": 0.04}, {}),
    "base error": ({"base_error": 0.04}, {}),
    "turn of the base": ({"base_turn": 1e-3}, {}),
}


def opposite(which, figures, **settings):
    """A guard of a slide with these figures, and which of the two it is: 0 or 1."""
    if which == "a ball":
        return slides(figures, **settings), 0
    if which == "a slide behind it":
        return slides(figures, {}, **settings), 0
    return slides({}, figures, **settings), 1


def judged(guard, which_slide, gap, speed, age, has_time):
    """Verdict of a slide that is this near, fast and old."""
    joints = len(guard.q_names)
    velocity = np.zeros(joints)
    velocity[which_slide] = -speed if which_slide == 1 else speed
    let_go(guard)
    stamps = dict.fromkeys(("left", "right")[:joints], 5.0)
    stamps[("left", "right")[which_slide]] -= age
    return guard.step(
        at_gap(gap, joints), stamps, velocity=velocity, now=5.0 if has_time else None
    )


@pytest.mark.parametrize("speed", [1.0, 0.8125])
def test_a_measured_stop_takes_the_place_of_the_figures(speed):
    figures = {"tables": {"joint": MEASURED}, "command": 0.02}
    guard = slides(figures, period=PERIOD)
    speeds, _, ways = np.array([(0.0, 0.0, 0.0), *MEASURED]).T
    # At full speed all the way: no stop is later at any place.
    need = speed * (0.02 + PERIOD) + np.interp(speed, speeds, ways)
    for gap in (need + GRAIN, need - GRAIN):
        verdict = judged(guard, 0, gap, speed, 0.0, has_time=True)
        assert verdict.nearest.headroom == pytest.approx(gap - need, abs=GRAIN / 3.0)
        assert (verdict.level is Level.STOP) == (gap < need)


@pytest.mark.parametrize("which", ["a ball", "a slide behind it", "a slide before it"])
@pytest.mark.parametrize("case", CASES)
def test_a_pair_needs_the_worst_case_of_each_figure_and_no_more(case, which):
    figures, rest = CASES[case]
    options = {"speed": 0.0, "age": 0.0, "has_time": True, "period": PERIOD, **rest}
    speed, age, has_time = (options.pop(key) for key in ("speed", "age", "has_time"))
    unknown = 0.0 if has_time else figures["sensing"]
    reaction = age + unknown + figures.get("command", 0.0)
    reaction += options["period"] + options.get("late", 0.0)
    if which == "a ball":
        reaction += UNTOLD_CYCLE * unknown
    way, _ = worst_stop(figures, speed, reaction)
    standing = [figures.get(key, 0.0) for key in ("model_error", "base_error")]
    standing.append(2.0 * np.sin(0.5 * figures.get("base_turn", 0.0)) * REACH)
    need = way + sum(standing) + options.get("buffer", 0.0)
    assert need > 0.03
    guard, which_slide = opposite(which, figures, **options)
    above = judged(guard, which_slide, need + GRAIN, speed, age, has_time)
    assert above.nearest.headroom == pytest.approx(GRAIN, abs=GRAIN / 3.0)
    assert above.level < Level.STOP
    # However few near pairs are to be reported, those that have to stop are.
    margin = options.get("buffer", 0.0)
    guard, which_slide = opposite(which, figures, margin=margin, **options)
    below = judged(guard, which_slide, need - GRAIN, speed, age, has_time)
    assert below.nearest.headroom == pytest.approx(-GRAIN, abs=GRAIN / 3.0)
    assert below.level is Level.STOP


# The same where the ball moves: figures of the slide, its speed [m/s], the age of its
# measurement and of the ball's [s].
MOVING = {
    "since it was seen": ({}, {"seen": 0.6}),
    "since it was seen, in a time that is unknown": (
        {"sensing": 0.2},
        {"has_time": False},
    ),
    "until the slide rests, which was measured before": (
        {"deceleration": 5.0},
        {"speed": 1.0, "age": 0.1},
    ),
    "until the slide rests": ({"deceleration": 5.0}, {"speed": 1.0}),
    "until the slide has settled": ({"settle_time": 0.2}, {"speed": 0.02}),
}
TOP_SPEED = 0.5


@pytest.mark.parametrize(
    ("kind", "others"), [("octree", 0), ("octree", FEW), ("brute_force", 0)]
)
@pytest.mark.parametrize("case", MOVING)
def test_a_ball_that_moves_is_reckoned_with(case, kind, others):
    figures, rest = MOVING[case]
    options = {"speed": 0.0, "age": 0.0, "seen": 0.0, "has_time": True, **rest}
    guard = slides(
        figures,
        mover={"top_speed": TOP_SPEED},
        others=others,
        margin=0.0,
        period=PERIOD,
        index=IndexSettings(kind=kind),
    )
    unknown = 0.0 if options["has_time"] else figures["sensing"]
    age = options["age"] + unknown
    cycle = PERIOD + UNTOLD_CYCLE * unknown
    way, rests = worst_stop(figures, options["speed"], age + cycle)
    # From when it was seen until the slide has settled, which was measured then.
    approach = options["seen"] + unknown + rests - age + figures.get("settle_time", 0.0)
    need = way + TOP_SPEED * approach
    assert need > 0.1
    for above in (True, False):
        guard.place("ball", Pose(xyz=(APART, 0, 0)), stamp=5.0 - options["seen"])
        gap = need + GRAIN if above else need - GRAIN
        verdict = judged(
            guard, 0, gap, options["speed"], options["age"], options["has_time"]
        )
        assert verdict.nearest.headroom == pytest.approx(gap - need, abs=GRAIN / 3.0)
        assert (verdict.level is Level.STOP) is not above


@pytest.mark.parametrize("going_on", [2, 1])
@pytest.mark.parametrize("speeds", [(1.0, 0.9), (0.9, 1.0)])
def test_of_two_slides_no_more_are_stopped_than_have_to(going_on, speeds):
    period = 0.02
    guard = slides({}, {}, period=period)
    stops = [worst_stop({}, speed, 0.0)[0] for speed in speeds]
    # The faster one is the first to be stopped.
    need = sum(stops) + period * sum(sorted(speeds)[:going_on])
    for gap in (need + GRAIN, need - GRAIN):
        let_go(guard)
        velocity = [speeds[0], -speeds[1]]
        levels = guard.step(at_gap(gap, 2), 5.0, velocity=velocity, now=5.0).levels
        stopped = [level is Level.STOP for level in levels.values()]
        assert sum(stopped) == 2 - going_on + (gap < need)
        if sum(stopped) == 1:
            assert stopped[int(np.argmax(speeds))]


def test_the_time_that_is_left_is_what_is_left_by_the_speed():
    guard, speed = slides({}, period=PERIOD), 0.8
    need, _ = worst_stop({}, speed, PERIOD)
    for left in (0.01, 0.04):
        verdict = judged(guard, 0, need + left, speed, 0.0, has_time=True)
        assert verdict.headroom.m == pytest.approx(left, abs=1e-6)
        assert verdict.headroom.s == pytest.approx(left / speed, abs=1e-6)


@pytest.mark.parametrize("spare", [-GRAIN, GRAIN])
def test_without_a_budget_levers_alone_may_prove_a_pair(spare):
    guard, speed = slides({}, period=PERIOD), 1.0
    guard._motion.effort.budget = 0
    need, _ = worst_stop({}, speed, PERIOD)
    verdict = judged(guard, 0, need + spare, speed, 0.0, has_time=True)
    assert (verdict.level is Level.STOP) == (spare < 0.0)
    assert (verdict.reason is Reason.BUDGET_SPENT) == (spare < 0.0)
    assert verdict.nearest.headroom == pytest.approx(spare, abs=GRAIN / 3.0)


def slide_on_slides():
    """Three slides on one line, each on the one before; the second has no ball."""
    model = slide()
    ball, joint = model.links["ball"], model.joints["joint"]
    links, joints, above = {"base": model.links["base"]}, {}, "base"
    for name, x, shapes in (
        ("first", 0.0, ball.collisions),
        ("second", 0.0, ()),
        ("third", APART, ball.collisions),
    ):
        links[name] = Link(name=name, collisions=shapes)
        place = Pose(xyz=(x, 0.0, 0.0)).matrix()
        ends = {"name": name, "parent": above, "child": name}
        joints[name] = replace(joint, **ends, T_parent_joint=place)
        above = name
    return replace(model, links=links, joints=joints)


@pytest.mark.parametrize("spare", [-GRAIN, GRAIN])
def test_two_links_of_one_arm_need_what_the_joints_between_them_do(spare):
    speeds = np.array([0.9, 0.3, -0.5])
    scene = Scene(buffer=0.0, margin=1.0, period=PERIOD)
    scene.add_robot(slide_on_slides(), name="arm", stopping=EXACT)
    guard = Guard(scene, self_test=False)
    let_go(guard)
    need = sum(worst_stop({}, abs(speed), PERIOD)[0] for speed in speeds[1:])
    # The second and the third one both lead the third ball back to the first one.
    speeds[1] *= -1.0
    q = [0.0, 0.0, need + spare + 2.0 * RADIUS - APART]
    verdict = guard.step(q, 5.0, velocity=speeds, now=5.0)
    assert verdict.nearest.headroom == pytest.approx(spare, abs=GRAIN / 3.0)
    assert (verdict.level is Level.STOP) == (spare < 0.0)


def test_only_the_slide_that_is_too_near_to_something_is_stopped():
    scene = Scene(buffer=0.0, margin=1.0, period=PERIOD)
    for name, x in (("left", 0.0), ("right", APART)):
        base = Pose(xyz=(x, 0.0, 0.0))
        scene.add_robot(slide(), name=name, base=base, stopping=EXACT)
    scene.add(Sphere(radius=RADIUS), name="ball", pose=Pose(xyz=(0.5 * APART, 0, 0)))
    guard, (near,) = Guard(scene, self_test=False), at_gap(0.5 * APART + GRAIN)
    for which, q in (("left", [near, 0.0]), ("right", [0.0, -near])):
        let_go(guard)
        velocity = np.sign(q) * 0.5
        levels = guard.step(q, 5.0, velocity=velocity, now=5.0).levels
        assert {name for name, level in levels.items() if level >= Level.STOP} == {
            which
        }


@pytest.mark.parametrize("share", [0.97, 1.03])
@pytest.mark.parametrize("slower", [0, 1])
def test_time_is_short_for_a_slide_with_a_quarter_of_the_closing_speed(slower, share):
    # Together they close 1 m/s.
    speeds = np.full(2, 1.0 - 0.25 * share)
    speeds[slower] = 0.25 * share
    guard, left = slides({}, {}, period=PERIOD), 0.05
    need = sum(worst_stop({}, speed, PERIOD)[0] for speed in speeds)
    let_go(guard)
    velocity = speeds * [1.0, -1.0]
    verdict = guard.step(at_gap(need + left, 2), 5.0, velocity=velocity, now=5.0)
    slowed = [level is Level.SLOW for level in verdict.levels.values()]
    assert slowed[1 - slower]
    assert slowed[slower] == (share > 1.0)
    assert verdict.headroom.s == pytest.approx(left, abs=1e-6)


# Time left below which an arm is slowed, and one at which its pair is reported [s].
SLOWS, SHORT = 0.1, 1.25 * 0.1


@pytest.mark.parametrize("share", [0.98, 1.02])
def test_beyond_the_margin_a_pair_is_reported_while_it_is_nearly_short(share):
    guard, speed = slides({}, period=PERIOD, margin=0.0), 0.8
    need, _ = worst_stop({}, speed, PERIOD)
    verdict = judged(guard, 0, need + share * SHORT * speed, speed, 0.0, has_time=True)
    assert len(verdict.near) == (share < 1.0)


@pytest.mark.parametrize("filtered", [False, True])
@pytest.mark.parametrize("joints", [1, 2])
def test_beyond_the_margin_a_pair_is_reported_where_it_may_be_measured_nearer(
    joints, filtered
):
    """Two errors of a position: one in what it has left, one that is to come."""
    error = 2e-3
    figures = [{"position_error": error}] * joints
    guard, still = slides(*figures, period=PERIOD, margin=0.0), np.zeros(joints)
    hidden = 2.0 * joints * error if filtered else 0.0
    for spare in (-GRAIN, 0.98 * hidden - 1e-6, 1.02 * hidden + 1e-6):
        let_go(guard)
        q = at_gap(joints * error + spare, joints)
        if filtered:
            verdict = guard.filter(q, still, 5.0, velocity=still, now=5.0).verdict
        else:
            verdict = guard.step(q, 5.0, velocity=still, now=5.0)
        assert len(verdict.near) == (spare < hidden)
