"""What joints may be driven to, by what was sent, when, and to which robots."""

from itertools import product

import numpy as np
import pytest

from armguard.guard import commands as kernels
from armguard.guard.change import bound_growth, joint_growth
from armguard.guard.layout import Header
from armguard.guard.levels import Reason
from armguard.guard.watch import (
    DELAY_SHARE,
    DELAY_STEPS,
    RECOVERING,
    RESTING,
    RUNNING,
    STOPPING,
    Agreement,
    Given,
    JudgedStop,
    LastCycle,
    Timing,
)
from armguard.kernel import kernel
from armguard.motion import figures as figure
from armguard.motion.figures import JointFigures, RobotFigures
from armguard.motion.joint_stop import JointStop
from armguard.motion.state import NEXT, NOW, PLANS, StopClock
from armguard.record import records
from armguard.robot.kinematics import FIXED, REVOLUTE
from records import record

# More joints than this are not needed: each belongs to a robot of its own.
JOINTS = 2

# How many commands are remembered.
ROOM = 4

DELAY, SENSING = 0.1, 0.03


def memory(rng, count=0, now=10.0):
    """A watch and a motion with random commands, oldest first in their ring."""
    sent_at = np.sort(rng.uniform(now - 0.3, now, max(count, 1)))
    sent = rng.uniform(-0.5, 0.5, (max(count, 1), JOINTS))
    held = rng.integers(0, 2, (max(count, 1), JOINTS))
    ring_at, ring, ring_held = (
        np.zeros(ROOM), np.zeros((ROOM, JOINTS)), np.zeros((ROOM, JOINTS), np.int64)
    )  # fmt: skip
    for k in range(count):
        ring_at[k % ROOM], ring[k % ROOM], ring_held[k % ROOM] = (
            sent_at[k],
            sent[k],
            held[k],
        )
    agreement = records(JOINTS, Agreement)
    agreement.earlier = np.nan
    given, timing = records(1, Given)[0], records(1, Timing)[0]
    given.now, given.commanded = now, 1
    timing.period, timing.late = 0.004, 0.003
    v = record(
        sent=ring,
        sent_at=ring_at,
        held=ring_held,
        sent_count=np.array([count]),
        stamps=now - rng.uniform(0.0, 0.1, JOINTS),
        given=given,
        timing=timing,
        under_way=np.zeros((JOINTS, 2)),
        driven_to=np.zeros((JOINTS, 2)),
        wanted=rng.uniform(-0.6, 0.6, JOINTS),
        commanded=rng.uniform(-0.6, 0.6, JOINTS),
        commanded_at=np.array([sent_at[-1]]),
        phase=np.array([RUNNING] * JOINTS),
        band=np.zeros((JOINTS, 2)),
        fastest=rng.uniform(0.1, 0.3, JOINTS),
        fastest_at=now - rng.uniform(0.0, 0.1, JOINTS),
        ordered=now - rng.uniform(0.0, 0.1, JOINTS),
        followed=np.tile([-np.inf, np.inf], (JOINTS, DELAY_STEPS)),
        delays=np.zeros(JOINTS),
        last=records(1, LastCycle)[0],
        agreement=agreement,
        lagged=np.zeros(JOINTS, np.int64),
    )
    joint_figures = records(JOINTS, JointFigures)
    joint_figures.velocity = 0.7, 0.9
    joint_figures.tracking_error = 0.05, 0.02
    joint_figures.acceleration = 2.0, 3.0
    joint_figures.deceleration = 4.0, 5.0
    robot_figures = records(JOINTS, RobotFigures)
    robot_figures.command, robot_figures.sensing = DELAY, SENSING
    robot_figures.first_joint = range(JOINTS)
    robot_figures.joint_count = 1
    robot_figures.mode = figure.PATH
    middle = rng.uniform(-0.4, 0.4, JOINTS)
    m = record(
        q=np.zeros(JOINTS),
        robot_of_joint=np.arange(JOINTS, dtype=np.int32),
        robot_figures=robot_figures,
        joint_figures=joint_figures,
        driven=np.zeros((PLANS * JOINTS, 2)),
        v_low=middle - 0.02,
        v_high=middle + 0.02,
    )
    return v, m, list(zip(sent_at, sent, held, strict=True))[:count]


@kernel(entry=True)
def look(v, m):
    kernels.look_under_way(v, m)


@kernel(entry=True)
def drive(v, m):
    kernels.set_drives(v, m)


@kernel(entry=True)
def keep(r, share, v, m):
    kernels.keep_under_way(r, share, v, m)


@kernel(entry=True)
def follows(v, m, out):
    return kernels.is_as_commanded(v, m, out)


@kernel(entry=True)
def passed(v):
    return kernels.time_passed(v)


@kernel(entry=True)
def rest(r, time, v, m):
    kernels.lead_to_rest(r, time, v, m)


@kernel(entry=True)
def send(v, m):
    kernels.send(v, m)


@kernel(entry=True)
def growth(j, v, m):
    return joint_growth(j, v, m)


@kernel(entry=True)
def grow(w, v, m):
    return bound_growth(w, v, m)


@kernel(entry=True)
def expect(j, v, m):
    next_slot = v.sent_count[0] % v.sent_at.shape[0]
    kernels.expect_followed(j, next_slot, v, m)


def known_under_way(sent, since, j, top):
    """Velocities that may be obeyed: sent later than a time, and the one before."""
    kept = sent[-ROOM:]
    late = [one for one in kept if one[0] > since]
    early = [one for one in kept if one[0] <= since]
    if not early and len(sent) > ROOM:
        return (-top, top), (-top, top)
    mine = early[-1:] + late
    speeds = [one[1][j] for one in mine] + ([] if early else [0.0])
    drives = [one[1][j] for one in mine if one[2][j] == 0]
    around = (min(speeds), max(speeds))
    return around, (min(drives, default=np.inf), max(drives, default=-np.inf))


@pytest.mark.parametrize("has_time", [True, False])
@pytest.mark.parametrize("count", range(9))
def test_what_is_under_way_is_what_was_sent_since_and_the_last_before(count, has_time):
    rng = np.random.default_rng(1)
    for _ in range(30):
        v, m, sent = memory(rng, count)
        if not has_time:
            v.given.now = np.nan
        look(v, m)
        for j in range(JOINTS):
            since = v.stamps[j] - DELAY - (0.0 if has_time else SENSING)
            top = m.joint_figures[j].velocity
            around, drives = known_under_way(sent, since, j, top)
            assert tuple(v.under_way[j]) == pytest.approx(around)
            assert tuple(v.driven_to[j]) == pytest.approx(drives)


@pytest.mark.parametrize("commanded", [True, False])
def test_a_joint_is_driven_to_what_is_under_way_and_then_to_what_is_wanted(commanded):
    rng = np.random.default_rng(2)
    for _ in range(50):
        v, m, _ = memory(rng)
        v.given.commanded = commanded
        v.driven_to[:] = np.sort(rng.uniform(-0.9, 0.9, (JOINTS, 2)), axis=1)
        drive(v, m)
        for j in range(JOINTS):
            f = m.joint_figures[j]
            top, error = f.velocity, f.tracking_error
            least, most = (
                np.clip([max(reached) + error, error - min(reached)], 0.0, top)
                for reached in (v.driven_to[j], [*v.driven_to[j], v.wanted[j]])
            )
            if not commanded:
                least = most = np.array([top, top])
            assert m.driven[NEXT * JOINTS + j] == pytest.approx(most)
            assert m.driven[NOW * JOINTS + j] == pytest.approx(least)


@pytest.mark.parametrize("share", [0.0, 0.3, 1.0])
def test_what_is_new_is_taken_back_to_what_is_under_way(share):
    rng = np.random.default_rng(4)
    for _ in range(30):
        v, m, _ = memory(rng)
        v.under_way[:] = np.sort(rng.uniform(-0.5, 0.5, (JOINTS, 2)), axis=1)
        before = v.wanted.copy()
        keep(1, share, v, m)
        known = np.clip(before[1], *v.under_way[1])
        assert v.wanted[0] == before[0]
        assert v.wanted[1] == pytest.approx(known + share * (before[1] - known))


@pytest.mark.parametrize("phase", [RUNNING, RECOVERING, RESTING])
def test_a_joint_that_is_faster_than_its_commands_is_named_with_its_speed(phase):
    rng, out = np.random.default_rng(5), records(1, Header)[0]
    for beyond in (-1e-3, 1e-3):
        for sign in (-1.0, 1.0):
            v, m, _ = memory(rng, 1)
            v.phase[:] = phase
            v.band[:] = -0.1, 0.2
            # No older command explains more.
            v.followed[:] = [-0.1, 0.2] * DELAY_STEPS
            edge = 0.2 + 0.02 if sign > 0.0 else 0.1 + 0.02
            m.v_low[:], m.v_high[:] = -0.01, 0.01
            near = sign * (edge + beyond)
            m.v_low[1], m.v_high[1] = (
                min(near, near + 0.06 * sign),
                max(near, near + 0.06 * sign),
            )
            before = m.v_low.copy(), m.v_high.copy()
            right = follows(v, m, out)
            assert right == (beyond < 0.0 or phase == RESTING)
            if not right:
                assert (out.reason, out.joint) == (Reason.NOT_FOLLOWED, 1)
                assert out.value == pytest.approx(near + 0.03 * sign)
            elif phase != RESTING:
                # It is no faster than it can have become.
                assert m.v_low[1] == max(before[0][1], -0.1 - 0.02)
                assert m.v_high[1] == min(before[1][1], 0.2 + 0.02)
            else:
                assert (m.v_low[1], m.v_high[1]) == (before[0][1], before[1][1])


# How many of the delays that are looked for are too short to explain the motion.
@pytest.mark.parametrize("short", range(DELAY_STEPS + 1))
def test_a_joint_that_older_commands_explain_is_named_with_the_delay_of_its_drive(
    short,
):
    step = DELAY_SHARE * DELAY
    for beyond, sign in product((-1e-3, 1e-3), (-1.0, 1.0)):
        v, m, _ = memory(np.random.default_rng(12), 1)
        out = records(1, Header)[0]
        v.band[:] = -0.1, 0.2
        v.followed[1] = [-0.1, 0.2] * short + [-0.9, 0.9] * (DELAY_STEPS - short)
        v.delays[:] = 0.0, 2.5 * step
        speed = 0.2 + 0.02 + beyond if sign > 0.0 else -0.1 - 0.02 - beyond
        m.v_low[:] = m.v_high[:] = 0.0, speed
        assert follows(v, m, out) == (beyond < 0.0)
        # A drive is not quicker than it has shown before.
        shown = short * step if beyond > 0.0 else 0.0
        assert v.delays == pytest.approx([0.0, max(shown, 2.5 * step)])
        if beyond < 0.0:
            continue
        assert out.joint == 1
        if short < DELAY_STEPS:
            assert out.reason == Reason.DRIVE_LAGS
            assert out.value == v.delays[1]
        else:
            assert out.reason == Reason.NOT_FOLLOWED
            assert out.value == pytest.approx(speed)


def test_the_time_since_the_last_commands_is_no_longer_than_a_cycle_may_take():
    v, _, _ = memory(np.random.default_rng(6), 3)
    for since, known in (
        (0.002, 0.002),
        (0.0069, 0.0069),
        (0.02, 0.007),
        (-1.0, 0.004),
    ):
        v.commanded_at[0] = v.given.now - since
        assert passed(v) == pytest.approx(known)
    v.sent_count[0] = 0
    assert passed(v) == 0.004


def test_a_robot_is_led_to_rest_as_its_stop_is_declared():
    rng = np.random.default_rng(7)
    for _ in range(60):
        v, m, _ = memory(rng, 3)
        v.phase[:] = STOPPING, RESTING
        rest(0, 0.01, v, m)
        rest(1, 0.01, v, m)
        assert v.wanted[1] == 0.0
        effect = v.ordered[0] + DELAY
        most = v.fastest[0] + 2.0 * max(effect - v.fastest_at[0], 0.0)
        last = np.sign(v.commanded[0]) * min(abs(v.commanded[0]), most)
        assert v.wanted[0] == pytest.approx(np.sign(last) * max(abs(last) - 0.04, 0.0))


def test_commands_are_remembered_with_the_robots_that_are_held():
    rng = np.random.default_rng(8)
    for count in range(7):
        v, m, _ = memory(rng, count)
        v.phase[:] = RUNNING, RESTING
        v.sent_count[0] = count
        wanted = v.wanted.copy()
        send(v, m)
        assert v.commanded == pytest.approx([wanted[0], 0.0])
        assert v.sent[count % ROOM] == pytest.approx([wanted[0], 0.0])
        assert v.held[count % ROOM].tolist() == [0, 1]
        assert v.sent_at[count % ROOM] == v.commanded_at[0] == v.given.now
        assert v.sent_count[0] == count + 1
        assert (v.band[:, 0] == np.minimum(v.under_way[:, 0], m.v_low)).all()
        assert (v.band[:, 1] == np.maximum(v.under_way[:, 1], m.v_high)).all()


@pytest.mark.parametrize("phase", [RUNNING, RECOVERING, RESTING])
@pytest.mark.parametrize("count", range(9))
def test_a_drive_follows_what_its_delay_leaves_or_is_on_its_way_there(count, phase):
    rng = np.random.default_rng(13)
    for _ in range(10):
        v, m, sent = memory(rng, count)
        v.phase[:] = phase
        bounds = np.sort(rng.uniform(-0.5, 0.5, (JOINTS, DELAY_STEPS, 2)))
        v.followed[:] = bounds.reshape(JOINTS, -1)
        for j in range(JOINTS):
            expect(j, v, m)
            error = m.joint_figures[j].tracking_error
            for k in range(DELAY_STEPS):
                since = v.stamps[j] - (k + 1) * DELAY_SHARE * DELAY
                (low, high), _ = known_under_way(sent, since, j, np.inf)
                if phase == RESTING:
                    low, high = -np.inf, np.inf
                now_low = max(m.v_low[j], bounds[j, k, 0] - error)
                now_high = min(m.v_high[j], bounds[j, k, 1] + error)
                found = v.followed[j, 2 * k : 2 * k + 2]
                assert found.tolist() == [min(low, now_low), max(high, now_high)]


def farthest_of(stops):
    """How far each stop leads: to its end and a swing on, or to a swing back."""
    return np.maximum(stops.travel + stops.swing, stops.swing_back)


def stops(rng):
    """Stops of joints that were judged, and others that get farther."""
    before = records((2, PLANS * JOINTS), JointStop)
    for name in before.dtype.names:
        before[name] = np.abs(rng.normal(size=before.shape))
    before.opposite_speed = 0.0
    after = before.copy()
    for name in ("travel", "swing", "swing_back"):
        after[name] += rng.uniform(-0.1, 0.1, after.shape)
    judged = records(2 * PLANS * JOINTS, JudgedStop)
    for side in range(2):
        judged.travel[side::2] = farthest_of(before[side])
        judged.opposite_speed[side::2] = before[side].opposite_speed
        judged.settled[side::2] = before[side].settled
        judged.rest_travel[side::2] = before[side].travel
    return before, after, judged


def changed(rng):
    """A watch and a motion in which stops have changed since they were judged."""
    before, after, judged = stops(rng)
    clock = records(PLANS * JOINTS, StopClock)
    for name in ("age", "reaction", "passed"):
        clock[name] = rng.uniform(0.0, 0.1, PLANS * JOINTS)
    v = record(
        judged_stops=judged,
        judged_clock=clock.copy(),
        ahead=np.full(1, 5.0),
        grown=np.zeros(1),
    )
    m = record(
        q=np.zeros(JOINTS),
        robot_of_joint=np.arange(JOINTS, dtype=np.int32),
        robot_figures=records(JOINTS, RobotFigures),
        clock=clock,
        up=after[0],
        down=after[1],
        rate=np.zeros(1),
        parent=np.array([-1, 0, 1], dtype=np.int32),
        joint_kind=np.array([FIXED, REVOLUTE, REVOLUTE], dtype=np.int32),
        q_index=np.array([0, 0, 1], dtype=np.int32),
        gain=np.array([[1.0, 0.0], [-0.5, 0.0], [2.0, 0.0]]),
        sizes=np.zeros(3),
        reach=np.full((PLANS, 1), 0.4),
        length=np.array([0, 1, 2], dtype=np.int32),
        joints=np.array([[-1, -1], [1, -1], [1, 2]], dtype=np.int32),
        levers=np.array([[0.7, 0.3]]),
    )
    grown = farthest_of(after) - farthest_of(before)
    most = np.maximum(grown.reshape(2, PLANS, JOINTS).max((0, 1)), 0.0)
    return v, m, most


def test_how_much_farther_a_joint_gets_is_the_most_of_all_its_stops():
    rng = np.random.default_rng(9)
    for _ in range(40):
        v, m, most = changed(rng)
        for j in range(JOINTS):
            assert growth(j, v, m) == pytest.approx(most[j])
        w = record(bodies=np.array([2], dtype=np.int32))
        assert grow(w, v, m)
        assert m.sizes == pytest.approx([0.0, 0.5 * most[0], 2.0 * most[1]])
        assert v.grown[0] == pytest.approx(m.sizes[1] * 0.7 + m.sizes[2] * 0.3)


def test_a_stop_that_settles_later_may_swing_where_the_joint_rested_before():
    rng = np.random.default_rng(12)
    for _ in range(40):
        for later in (-1e-6, 1e-6):
            v, m, most = changed(rng)
            m.up.settled[:] += later
            rested = v.judged_stops.rest_travel[::2].reshape(PLANS, JOINTS)
            swings = farthest_of(m.up).reshape(PLANS, JOINTS) - rested
            expected = np.maximum(most, swings.max(0)) if later > 0.0 else most
            for j in range(JOINTS):
                assert growth(j, v, m) == pytest.approx(expected[j])


def test_what_may_turn_round_or_has_other_clocks_is_judged_anew():
    rng = np.random.default_rng(10)
    for at, name in ((0, "age"), *((2, name) for name in StopClock.__annotations__)):
        v, m, _ = changed(rng)
        m.clock[name][at] += 1
        assert growth(0, v, m) == np.inf
        assert growth(1, v, m) < np.inf
    for speed in (0.0, 0.2):
        v, m, _ = changed(rng)
        v.judged_stops.opposite_speed = 0.3
        m.up.opposite_speed[:] = speed
        assert growth(0, v, m) == np.inf


def test_what_gets_beyond_what_was_looked_for_is_looked_for_anew():
    v, m, _ = changed(np.random.default_rng(11))
    w = record(bodies=np.array([2], dtype=np.int32))
    assert grow(w, v, m)
    grown = v.grown[0]
    for ahead, known in ((grown, True), (0.999 * grown, False), (np.nan, False)):
        v.ahead[0] = ahead
        assert grow(w, v, m) == known
