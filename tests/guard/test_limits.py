"""A joint is refused for what it surely does, not for what its measurement may do."""

import numpy as np
import pytest

from approach import FIGURES, PERIOD
from armguard.geometry import Pose
from armguard.guard import Level, Reason
from armguard.motion.outermost import led_beyond, true_limits
from armguard.respond import Action, Guard
from armguard.scene import Scene
from arms import simple_arm
from driven import Driven

LIMIT = 2.0
ERROR = 2e-3
MISSED = 0.03
FIGURES_AT_LIMIT = {**FIGURES, "position_error": ERROR, "tracking_error": MISSED}


def arm_at_limit(mode="path", side=1.0, home=LIMIT, **figures):
    """An arm in the open whose first joint is at home at its limit."""
    scene = Scene(mode=mode)
    scene.add_robot(
        simple_arm(joints=2),
        name="arm",
        stopping={**FIGURES_AT_LIMIT, **figures},
        home={"joint1": side * home},
    )
    return Guard(scene, self_test=False)


@pytest.fixture(scope="module", params=[1.0, -1.0], ids=["upper", "lower"])
def at_limit(request):
    """A guard, and on which side its joint is at its limit."""
    return arm_at_limit(side=request.param), request.param


def seen(guard, beyond, side, count=3):
    """Verdict of a joint at rest that is measured beyond its limit."""
    guard.reset()
    q = [side * (LIMIT + beyond), 0.0]
    for k in range(count):
        verdict = guard.step(q, k * PERIOD, velocity=[0.0, 0.0])
    return verdict


@pytest.mark.parametrize("share", [-1.0, 0.0, 0.5, 1.0])
def test_a_joint_at_its_limit_may_be_measured_an_error_beyond(at_limit, share):
    guard, side = at_limit
    assert seen(guard, share * ERROR, side).level is Level.CLEAR


def test_farther_beyond_is_a_stop_with_the_joint_and_its_limits(at_limit):
    guard, side = at_limit
    verdict = seen(guard, 1.001 * ERROR + 1e-9, side)
    assert verdict.reason is Reason.OUT_OF_LIMITS
    assert verdict.levels == {"arm": Level.STOP}
    assert verdict.joint == "arm/joint1"
    assert ": stop, its limits are [-2.0000, 2.0000]; move the joint" in verdict.why


@pytest.mark.parametrize("other", ["path", None])
def test_joints_in_mode_fixed_have_no_errors(other):
    scene = Scene(mode="fixed")
    for k, mode in enumerate(("fixed", other)):
        if mode is not None:
            scene.add_robot(
                simple_arm(joints=1),
                name=f"arm{k}",
                mode=mode,
                base=Pose(xyz=(5.0 * k, 0.0, 0.0)),
                stopping=FIGURES_AT_LIMIT,
            )
    guard = Guard(scene, self_test=False)
    still = np.zeros(len(guard.home))
    for k, beyond in enumerate((0.0, 0.1 * ERROR)):
        q = guard.home
        q[0] = LIMIT + beyond
        verdict = guard.step(q, k * PERIOD, velocity=still)
        assert (verdict.reason is Reason.OUT_OF_LIMITS) is (beyond > 0.0)


class Noisy(Driven):
    """An arm that is measured wrong by its declared error, now here, now there."""

    def __init__(self, guard, seed=0, **options):
        super().__init__(guard, **options)
        self.rng = np.random.default_rng(seed)

    def cycle(self, desired, form="filter"):
        true = self.q
        self.q = true + self.rng.choice([-1.0, 1.0], len(true)) * ERROR
        command = super().cycle(desired, form)
        self.q = true + self.v * PERIOD
        return command


def test_an_arm_at_its_limit_rests_and_is_led_inwards(at_limit):
    guard, side = at_limit
    guard.reset()
    loop = Noisy(guard)
    loop.run([0.0, 0.0], 300)
    assert loop.stops == []
    assert not np.any([c.velocity for c in loop.commands])
    # Outwards it gets no command.
    loop.run([side * 0.5, 0.0], 300)
    assert not np.any([c.velocity for c in loop.commands])
    loop.run([-side * 0.5, 0.0], 300)
    assert loop.stops == []
    assert loop.commands[-1].velocity[0] == -side * 0.5


@pytest.mark.parametrize("delay", [0, 3])
def test_what_creeps_beyond_its_limit_is_led_back(at_limit, delay):
    guard, side = at_limit
    guard.reset()
    loop = Noisy(guard, delay=delay)
    beyond = []
    for _ in range(3000):
        loop.cycle([0.0, 0.0])
        # It misses its commands outwards, all the time.
        loop.q[0] += side * 0.99 * MISSED * PERIOD
        loop.v[0] += side * 0.99 * MISSED
        beyond.append(side * loop.q[0] - LIMIT)
    assert loop.stops == []
    assert max(beyond) <= led_beyond(guard.tables)[0]
    # It was led back, and is so for as long as it creeps.
    commanded = [side * c.velocity[0] for c in loop.commands]
    assert min(commanded) == pytest.approx(-MISSED)
    assert max(commanded) == 0.0


@pytest.mark.parametrize("ramp", [0.0, 0.05])
@pytest.mark.parametrize("settle", [0.0, 0.02])
def test_no_stop_carries_a_joint_beyond_its_limit(ramp, settle):
    figures = {"ramp": ramp, "settle": settle, "settle_time": 0.2 if settle else 0.0}
    guard = arm_at_limit(home=1.0, **figures)
    loop = Driven(guard, delay=3, miss=MISSED)
    f = guard.tables.robots[0].stopping
    loop.run([2.0, 0.0], 100)
    farthest = 0.0
    while loop.cycle([2.0, 0.0]).velocity[0] > 0.0:
        # A stop ordered now: what is under way first, then as little as it must brake.
        under_way = [commanded[0] + MISSED for commanded in loop.queue]
        v = float(under_way[-1])
        way = PERIOD * sum(under_way) + 0.5 * v * ramp + 0.5 * v * v / f.deceleration[0]
        way += settle * v / f.velocity[0]
        farthest = max(farthest, loop.q[0] + way)
    assert loop.stops == []
    assert 1.99 < farthest <= LIMIT


def test_levers_hold_as_far_as_joints_are_not_refused():
    guard = arm_at_limit()
    lower, upper = true_limits(guard.tables)
    for commanded in (False, True):
        allowed = led_beyond(guard.tables) if commanded else np.zeros(2)
        assert (upper >= guard.tables.upper + allowed + 2.0 * ERROR).all()
        assert (lower <= guard.tables.lower - allowed - 2.0 * ERROR).all()


def test_a_robot_in_mode_fixed_is_refused_beyond_its_limits_at_once():
    guard = arm_at_limit(mode="fixed")
    lower, upper = true_limits(guard.tables)
    assert (lower == guard.tables.lower).all()
    assert (upper == guard.tables.upper).all()


def test_it_retreats_to_a_place_at_its_limit():
    guard = arm_at_limit(home=1.9)
    loop = Driven(guard)
    loop.cycle([0.0, 0.0])
    guard.retreat("arm", to=[LIMIT, 0.0])
    for _ in range(3000):
        command = loop.cycle([0.0, 0.0])
        assert command.action is Action.FOLLOW
    assert command.blocked["arm"].name == "NOT"
    assert loop.q[0] > LIMIT - 3.0 * ERROR - 2e-3
