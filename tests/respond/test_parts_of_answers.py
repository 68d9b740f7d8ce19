"""What answers are made of: costs and rows, fields, lags, tools, fingers, sides."""

from itertools import product

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from armguard.guard.grips import GripperRow, LinkRow
from armguard.guard.intent import middle_of, velocity_of
from armguard.guard.levels import Reason
from armguard.guard.watch import (
    RECOVERING,
    RESTING,
    RUNNING,
    STOPPING,
    Given,
    LastCycle,
    Timing,
)
from armguard.kernel import kernel
from armguard.motion.figures import JointFigures, RobotFigures
from armguard.motion.state import PLANS, StopClock
from armguard.record import records
from armguard.respond import constraints, field, joint_bounds, leading, program
from armguard.respond import state as places
from armguard.respond.engagement import wait_if_ordered
from armguard.respond.escape_path import LIMIT_ROOM, speed_of, stand_on_way
from armguard.respond.escape_state import Approaching, EscapePlan
from armguard.respond.escape_ways import (
    FORMS,
    GOES,
    SIDES,
    lead_to_side,
    look_across,
    write_way,
)
from armguard.respond.lead_state import LeadMemory, LeadNotes, Source, ToolAim
from armguard.respond.missed import MISSING_TIME, note_missed
from armguard.respond.retreat import is_held_up
from armguard.respond.spares import steady_spare
from armguard.respond.tool_motion import tool_columns, turn_between
from armguard.robot.kinematics import PRISMATIC, REVOLUTE
from records import record

JOINTS, DT, DELAY, RAMP = 3, 0.004, 0.05, 0.02


def motion(rng):
    """Figures of one robot, and where its joints are."""
    joint_figures = records(JOINTS, JointFigures)
    for name, low, high in (
        ("velocity", 0.5, 2.0),
        ("acceleration", 5.0, 20.0),
        ("deceleration", 2.0, 6.0),
        ("position_error", 1e-3, 2e-3),
        ("tracking_error", 0.01, 0.05),
        ("settle", 0.0, 0.02),
    ):
        joint_figures[name] = rng.uniform(low, high, JOINTS)
    robot_figures = records(1, RobotFigures)
    robot_figures[0].joint_count = JOINTS
    robot_figures[0].ramp = RAMP
    clock = records(PLANS, StopClock)
    clock[0].reaction = DELAY
    return record(
        q=rng.uniform(-1.2, 1.2, JOINTS),
        joint_figures=joint_figures,
        robot_figures=robot_figures,
        robot_of_joint=np.zeros(JOINTS, dtype=np.int32),
        clock=clock,
    )


def watch(rng):
    """The last command of a robot, and that a cycle has passed since."""
    given, timing = records(1, Given)[0], records(1, Timing)[0]
    given.now, timing.period, timing.late = 5.0, 0.01, 0.0
    return record(
        commanded=rng.uniform(-0.5, 0.5, JOINTS),
        commanded_at=np.array([5.0 - DT]),
        sent_count=np.array([3]),
        given=given,
        timing=timing,
        stamps=np.array([5.0]),
        last=records(1, LastCycle)[0],
    )


def answers(rng):
    """Rows and limits of one robot."""
    low, high = -rng.uniform(0.1, 0.5, JOINTS), rng.uniform(0.1, 0.5, JOINTS)
    settings = records(1, places.Behaviour)
    settings.repulsion = 0.3
    loss = records(1, places.HeadroomLoss)[0]
    loss.time, loss.holding = DT, 0.4
    return record(
        raw=rng.normal(size=JOINTS),
        rows=rng.normal(size=(places.ROWS, JOINTS)),
        limits=np.zeros(places.ROWS),
        eased=np.zeros(places.ROWS),
        passing=np.zeros(places.ROWS),
        notes=records(1, places.RobotNotes),
        low=low,
        high=high,
        brake=np.clip(rng.uniform(-0.2, 0.2, JOINTS), low, high),
        settings=settings,
        loss=loss,
        closing_time=rng.uniform(0.05, 0.2, JOINTS),
        opening_time=rng.uniform(0.0, 0.05, JOINTS),
        missed=rng.uniform(-0.05, 0.05, JOINTS),
        requested=rng.normal(size=JOINTS),
    )


@kernel(entry=True)
def waits(a, v):
    return wait_if_ordered(0, a, v)


@kernel(entry=True)
def miss(a, v, m):
    note_missed(a, v, m)


@kernel(entry=True)
def costs(a, v, m):
    program.write_costs(a, v, m)


@kernel(entry=True)
def lost(a, v, m):
    return constraints.lost_till_then(0, a, v, m)


@kernel(entry=True)
def within_limits(j, a, w, m):
    joint_bounds.lead_within_limits(j, a, w, m)


@kernel(entry=True)
def keep(at, limit, opens, a):
    constraints.keep_row(0, 0, 3, at, limit, limit, opens, a)


@kernel(entry=True)
def hold(left, a, v, m):
    constraints.add_holding(0, left, False, a, v, m)


@kernel(entry=True)
def part(own, its, a):
    return constraints.part_of(0, 1, own, its, a)


@kernel(entry=True)
def smooth(a, s, v, m):
    leading.smooth_lead(0, a, s, v, m)


@kernel(entry=True)
def pulled(most, attraction, s, v, m):
    return field.led_speed(0, most, attraction, s, v, m)


@kernel(entry=True)
def repel(share, a, s, m):
    field.repel_by(0, share, a, s, m)


@kernel(entry=True)
def way_of_tool(s, w):
    return field.tool_way(0, s, w)


@kernel(entry=True)
def columns_of(body, p, columns, w, m):
    tool_columns(body, p, 0, 3, 0, columns, w, m)


@kernel(entry=True)
def turn(T, aim):
    return turn_between(T, aim)


@kernel(entry=True)
def speed(obstacle):
    return speed_of(obstacle)


@kernel(entry=True)
def to_side(side, full, e, m):
    lead_to_side(side, 0, full, e, m)


@kernel(entry=True)
def middle(h, w):
    return middle_of(1, h, w)


@kernel(entry=True)
def velocity(p, body, u, m):
    return velocity_of(p, body, u, m)


@kernel(entry=True)
def stand(time, e, w, v, m):
    stand_on_way(0, time, e, w, v, m)


@kernel(entry=True)
def across_of(e, w, m):
    look_across(0, e, w, m)


@kernel(entry=True)
def held_up(a, s, v, m):
    return is_held_up(0, a, s, v, m)


@kernel(entry=True)
def spare(i, j, left, a, v):
    return steady_spare(i, j, left, a, v)


@kernel(entry=True)
def way_number(k, share, e, m):
    return write_way(k, 0, share, e, m)


def test_a_velocity_costs_a_pair_its_delay_and_its_stop():
    rng = np.random.default_rng(1)
    opening = 0
    for _ in range(30):
        a, v, m = answers(rng), watch(rng), motion(rng)
        v.commanded[0] *= 0.05
        costs(a, v, m)
        f = m.joint_figures
        d, gain = f.deceleration, f.acceleration * DT
        # Reaction, ramp and swing, and the stop from what can be commanded in a cycle.
        time = DELAY + 0.5 * RAMP + f.settle / f.velocity
        braking = 0.5 * gain / d
        last = np.abs(v.commanded)
        assert a.closing_time == pytest.approx(time + last / d + braking)
        turned = np.maximum(1.0 - last / gain, 0.0)
        assert a.opening_time == pytest.approx(turned * (time + braking))
        opening += (turned > 0.0).any()
    assert opening > 5


def test_until_it_matters_a_pair_loses_the_commands_and_what_drives_miss():
    rng = np.random.default_rng(2)
    closed = 0
    for _ in range(30):
        a, v, m = answers(rng), watch(rng), motion(rng)
        closing = max(float(a.raw @ v.commanded), 0.0)
        missed = np.abs(a.raw) @ m.joint_figures.tracking_error
        assert lost(a, v, m) == pytest.approx(DELAY * (closing + missed))
        closed += closing > 0.0
    assert closed > 5


def test_a_joint_beyond_its_limit_may_only_come_back():
    rng = np.random.default_rng(3)
    for _ in range(60):
        a, m = answers(rng), motion(rng)
        w = record(lower=np.full(JOINTS, -1.0), upper=np.full(JOINTS, 1.0))
        for j in range(JOINTS):
            f = m.joint_figures[j]
            error, missed = f.position_error, f.tracking_error
            low, high, brake = a.low[j], a.high[j], a.brake[j]
            if m.q[j] - 1.0 > error:
                high = min(high, max(-missed, low))
            elif -1.0 - m.q[j] > error:
                low = max(low, min(missed, high))
            within_limits(j, a, w, m)
            assert (a.low[j], a.high[j]) == (low, high)
            assert a.brake[j] == np.clip(brake, low, high)


@pytest.mark.parametrize("opens", [False, True])
def test_a_row_is_kept_if_what_is_in_reach_can_break_it(opens):
    rng, kept = np.random.default_rng(4), 0
    corners = np.array(list(product((0, 1), repeat=JOINTS)), dtype=bool)
    for _ in range(60):
        a, limit = answers(rng), rng.uniform(-0.6, 1.0)
        row = a.rows[2] / np.linalg.norm(a.rows[2])
        bound = limit / np.linalg.norm(a.rows[2])
        reached = np.where(corners, a.high, a.low) @ row
        braked = row @ a.brake
        eased = max(bound, braked)
        # Harder than declared, by half of what joints can do.
        harder = max(bound, braked - 0.5 * (braked - reached.min()))
        keep(2, limit, opens, a)
        assert a.rows[2] == pytest.approx(row)
        assert a.eased[2] == pytest.approx(eased)
        assert a.limits[2] == pytest.approx(harder if opens else eased)
        breaks = reached.max() > a.limits[2]
        assert a.notes[0].row_count == breaks
        kept += breaks
    assert 10 < kept < 60


def test_a_joint_that_opens_a_pair_is_given_no_credit_for_going_on():
    rng = np.random.default_rng(5)
    for _ in range(30):
        a, v, m = answers(rng), watch(rng), motion(rng)
        a.low[:], a.high[:] = -50.0, 50.0
        hold(0.01, a, v, m)
        opens = a.raw * v.commanded < 0.0
        time = np.where(opens, a.opening_time, a.closing_time)
        row = a.raw * (DT + time)
        limit = 0.4 * 0.01 + a.raw @ (time * v.commanded)
        limit -= DT * np.maximum(a.raw * a.missed, 0.0).sum()
        length = np.linalg.norm(row)
        assert a.rows[0] == pytest.approx(row / length)
        known = max(limit / length, row @ a.brake / length)
        assert a.limits[0] == pytest.approx(known)


def test_a_robot_that_is_yielded_to_has_all_and_the_other_what_is_left():
    settings = records(2, places.Behaviour)
    settings.sharing = places.BY_PRIORITY
    for its, above, known in ((0.3, 1.0, 1.0), (0.3, -1.0, 0.0), (0.0, -1.0, 1.0)):
        settings[0].priority = above
        assert part(0.2, its, record(settings=settings)) == known
    settings.priority = 0.0
    assert part(0.2, 0.6, record(settings=settings)) == pytest.approx(0.25)
    assert part(-1.0, -1.0, record(settings=settings)) == 0.5


def lead(rng):
    """What leads one robot."""
    tool_aim = records(1, ToolAim)
    tool_aim.pose, tool_aim.origin = rng.normal(size=12), rng.normal(size=3)
    return record(
        notes=records(1, LeadNotes),
        memory=records(1, LeadMemory),
        first_lag=rng.normal(size=JOINTS),
        second_lag=rng.normal(size=JOINTS),
        pull=rng.normal(size=JOINTS),
        push=rng.normal(size=JOINTS),
        weight=rng.uniform(0.0, 0.1, 1),
        tool_aim=tool_aim,
    )


def test_what_leads_a_robot_passes_two_lags_of_20_ms():
    rng = np.random.default_rng(6)
    a, v, m, s = answers(rng), watch(rng), motion(rng), lead(rng)
    s.notes[0].source = Source.OPERATOR
    smooth(a, s, v, m)
    assert (s.first_lag == v.commanded).all()
    assert (s.second_lag == v.commanded).all()
    s.notes[0].source = Source.FIELD
    wanted, kept = a.requested.copy(), np.exp(-DT / 0.02)
    for k in range(1, 20):
        a.requested[:] = wanted
        smooth(a, s, v, m)
        # Steps of two equal lags, one after the other.
        left = kept**k * (1.0 + k * (1.0 - kept))
        assert a.requested == pytest.approx(wanted + left * (v.commanded - wanted))


def test_a_field_pulls_gently_and_less_towards_its_goal():
    rng = np.random.default_rng(7)
    reasons = set()
    for before, left in product((0.0, 0.3, 0.9), (0.001, 0.05, 1.0)):
        v, m, s = watch(rng), motion(rng), lead(rng)
        s.memory[0].speed, s.memory[0].time_left = before, left
        f = m.joint_figures
        rate = 0.3 * (f.acceleration / f.velocity).min()
        risen = min(0.8, before + rate * DT)
        known = [risen, np.sqrt(rate * left), 3.0 * left]
        assert pulled(0.8, 3.0, s, v, m) == pytest.approx(min(known))
        assert s.memory[0].speed == pytest.approx(risen)
        reasons.add(int(np.argmin(known)))
    assert len(reasons) >= 2


# Time to the goal at top speed [s], and by what its push has faded there [-].
@pytest.mark.parametrize(("left", "fade"), [(0.02, 0.04), (0.099, 0.9801), (0.3, 1.0)])
@pytest.mark.parametrize("share", [0.0, 0.3, 0.8, 1.0])
def test_a_pair_takes_what_closes_it_and_pushes(share, left, fade):
    rng = np.random.default_rng(8)
    for _ in range(10):
        a, m, s = answers(rng), motion(rng), lead(rng)
        s.memory[0].time_left = left
        pull, off, weight = s.pull.copy(), s.push.copy(), s.weight.copy()
        repel(share, a, s, m)
        square = a.raw @ a.raw + 0.1**2
        closing = max(float(a.raw @ pull), 0.0)
        taken = (1.0 - share) * closing / square
        x = max(share, 0.5)
        force = 0.25 * (1.0 / x - 1.0) / x**2
        # From a half on its tangent.
        force -= 8.0 * min(share - 0.5, 0.0)
        push = 0.3 * fade * force
        assert s.pull == pytest.approx(pull - taken * a.raw)
        assert s.push == pytest.approx(off - push**2 * a.raw / square)
        assert s.weight == pytest.approx(weight + push)


def pose(rng):
    """A random pose, as a row of [R | p]."""
    R = Rotation.from_rotvec(rng.normal(size=3)).as_matrix()
    return np.concatenate([R, rng.normal(size=(3, 1))], axis=1).ravel()


def test_what_is_left_for_a_tool_is_its_shift_and_its_turn():
    rng = np.random.default_rng(9)
    for _ in range(20):
        s, T = lead(rng), pose(rng)
        s.tool_aim[0].pose[:] = pose(rng)
        shift, turned = way_of_tool(s, record(T_world=T[None]))
        R, aim = T.reshape(3, 4), s.tool_aim[0].pose.reshape(3, 4)
        point = R[:, :3] @ s.tool_aim[0].origin + R[:, 3]
        assert shift == pytest.approx(aim[:, 3] - point)
        known = Rotation.from_matrix(aim[:, :3] @ R[:, :3].T).as_rotvec()
        assert turned == pytest.approx(known)


@pytest.mark.parametrize("axis", [*np.eye(3), (0.6, 0.8, 0.0), (0.0, 0.6, 0.8)])
def test_half_a_turn_has_an_axis_though_it_has_no_sine(axis):
    R = Rotation.from_rotvec(np.pi * np.array(axis)).as_matrix()
    aim = np.concatenate([R, np.zeros((3, 1))], axis=1).ravel()
    found = np.array(turn(np.eye(3, 4).ravel(), aim))
    assert np.linalg.norm(found) == pytest.approx(np.pi)
    assert abs(found @ axis) == pytest.approx(np.pi)


def arm(rng):
    """Three joints on random axes; the second one slides."""
    axes = rng.normal(size=(JOINTS, 6))
    axes[:, :3] /= np.linalg.norm(axes[:, :3], axis=1)[:, None]
    return record(
        joint_kind=np.array([REVOLUTE, PRISMATIC, REVOLUTE], dtype=np.int32),
        q_index=np.arange(JOINTS, dtype=np.int32),
        gain=np.stack([rng.uniform(0.5, 2.0, JOINTS), np.zeros(JOINTS)], axis=-1),
        axes=axes,
        parent=np.arange(-1, JOINTS - 1, dtype=np.int32),
        joints=np.tile(np.arange(JOINTS, dtype=np.int32), (JOINTS, 1)),
        length=np.arange(1, JOINTS + 1, dtype=np.int32),
    )


def ways_of(m, point):
    """How each joint moves a point and turns its body, shape (n, 6)."""
    rows = np.zeros((JOINTS, 6))
    for j in range(JOINTS):
        axis, origin = m.axes[j, :3], m.axes[j, 3:]
        slides = m.joint_kind[j] == PRISMATIC
        rows[j, :3] = axis if slides else np.cross(axis, point - origin)
        rows[j, 3:] = 0.0 if slides else axis
    return m.gain[:, :1] * rows


def test_a_tool_and_a_point_move_as_their_joints_turn_and_slide():
    rng = np.random.default_rng(10)
    for _ in range(10):
        m, T, columns = arm(rng), pose(rng), np.zeros((JOINTS, 6))
        w = record(T_world=np.tile(T, (JOINTS, 1)))
        p = rng.normal(size=3)
        columns_of(JOINTS - 1, tuple(p), columns, w, m)
        R = T.reshape(3, 4)
        known = ways_of(m, R[:, :3] @ p + R[:, 3])
        assert columns == pytest.approx(known)
        u = rng.normal(size=JOINTS)
        for body in range(JOINTS):
            ridden = np.arange(JOINTS) <= body
            moves = (u * ridden) @ ways_of(m, p)[:, :3]
            assert velocity(tuple(p), body, u, m) == pytest.approx(moves)


def test_the_middle_of_a_gripper_is_the_mean_of_its_fingers_middles():
    rng = np.random.default_rng(11)
    boxes = np.sort(rng.normal(size=(6, 2, 3)), axis=1).reshape(6, 6)
    grippers, fingers = records(2, GripperRow), records(3, LinkRow)
    grippers[1].first_finger, grippers[1].end_finger = 1, 3
    fingers.first, fingers.end = (0, 1, 3), (1, 3, 6)
    h = record(grippers=grippers, fingers=fingers)
    w = record(world=record(boxes=boxes))
    middles = boxes.reshape(6, 2, 3).mean(axis=1)
    known = 0.5 * (middles[1:3].mean(axis=0) + middles[3:6].mean(axis=0))
    assert middle(h, w) == pytest.approx(known)


def test_a_robot_is_led_to_a_side_by_the_joints_that_lead_there():
    rng = np.random.default_rng(12)
    obstacle = records(1, Approaching)[0]
    obstacle.velocity[:] = 1.0, -2.0, 2.0
    assert speed(obstacle) == 3.0
    for side, full in product(range(SIDES + 1), (False, True)):
        m = motion(rng)
        across = Rotation.from_rotvec(rng.normal(size=3)).as_matrix()
        e = record(
            trial=np.zeros(JOINTS),
            columns=rng.normal(size=(JOINTS, 3)),
            across=across,
            useful=np.array([1, 1, 0], dtype=np.int64),
        )
        angle = 2.0 * np.pi * side / SIDES
        to = np.cos(angle) * across[0] + np.sin(angle) * across[1]
        to = across[2] if side == SIDES else to
        shares = e.columns @ to * m.joint_figures.velocity * e.useful
        shares /= np.abs(shares).max()
        known = np.clip(shares / 0.4, -1.0, 1.0) if full else shares
        to_side(side, full, e, m)
        assert e.trial == pytest.approx(known)


def escape(rng):
    """What looks for ways of one robot."""
    return record(
        plan=records(1, EscapePlan)[0],
        approaching=records(2, Approaching),
        trial=rng.uniform(-0.5, 0.5, JOINTS),
        way=np.zeros(JOINTS),
        q=np.zeros(JOINTS),
        own=np.zeros(1, dtype=np.int32),
        T=np.zeros((JOINTS, 12)),
        rows=np.zeros((1, 16)),
        boxes=np.zeros((1, 6)),
        closest=np.zeros(10),
        across=np.zeros((3, 3)),
        columns=np.ones((JOINTS, 3)),
        useful=np.ones(JOINTS, dtype=np.int64),
        spreads=rng.uniform(-1.0, 1.0, (64, JOINTS)),
    )


def test_on_its_way_a_robot_goes_on_then_turns_to_it_and_comes_to_rest():
    rng = np.random.default_rng(13)
    held = 0
    for halted in (False, True) * 10:
        e, m, v = escape(rng), motion(rng), watch(rng)
        w = record(
            lower=np.full(JOINTS, -1.0),
            upper=np.full(JOINTS, 1.0),
            parent=np.arange(-1, JOINTS - 1, dtype=np.int32),
            joint_kind=np.full(JOINTS, REVOLUTE, dtype=np.int32),
            q_index=np.arange(JOINTS, dtype=np.int32),
            gain=np.tile([1.0, 0.0], (JOINTS, 1)),
            T_parent_joint=np.tile(np.eye(3, 4).ravel(), (JOINTS, 1)),
            axis=np.tile([0.0, 0.0, 1.0], (JOINTS, 1)),
            world=record(kinds=np.zeros(1, dtype=np.int32)),
            local_rows=np.zeros((1, 16)),
            bodies=np.zeros(1, dtype=np.int32),
        )
        delay, rise, go, fall = 0.05, 0.1, 0.4, 0.3
        halt = 0.37 if halted else np.inf
        plan = e.plan
        plan.delay, plan.rise, plan.brake_at, plan.fall = delay, rise, go, fall
        plan.halt_at = halt
        for time in (0.03, 0.11, 0.4, 0.6, 2.0):
            times = np.linspace(0.0, min(time, halt), 20_001)
            moments = delay + np.array([0.0, rise, go, go + fall])
            for j in range(JOINTS):
                speeds = [v.commanded[j], e.trial[j], e.trial[j], 0.0]
                way = np.trapezoid(np.interp(times, moments, speeds), times)
                away = 2.0 * m.joint_figures[j].position_error + LIMIT_ROOM
                low, high = min(away - 1.0, m.q[j]), max(1.0 - away, m.q[j])
                known = np.clip(m.q[j] + way, low, high)
                stand(time, e, w, v, m)
                assert e.q[j] == pytest.approx(known, abs=1e-6)
                held += known != m.q[j] + way
    assert held > 5
    assert e.plan.placed == e.plan.own_count == 0


def test_aside_is_away_from_what_comes_and_across_its_way():
    rng = np.random.default_rng(14)
    for _ in range(10):
        e, m = escape(rng), arm(rng)
        velocity = e.approaching[1].velocity
        velocity[:] = rng.normal(size=3)
        e.plan.obstacle = 1
        n = rng.normal(size=3)
        n /= np.linalg.norm(n)
        point = rng.normal(size=3)
        e.closest[1:4], e.closest[7:] = point, n
        across_of(e, record(bodies=np.array([2], dtype=np.int32)), m)
        ahead = velocity / np.linalg.norm(velocity)
        # From the object to the arm.
        aside = -n + (n @ ahead) * ahead
        aside /= np.linalg.norm(aside)
        known = [aside, np.cross(ahead, aside), ahead]
        assert e.across == pytest.approx(np.array(known))
        assert e.columns == pytest.approx(ways_of(m, point)[:, :3])


def test_each_joint_has_a_way_of_its_own_in_both_directions():
    rng = np.random.default_rng(15)
    e, m = escape(rng), motion(rng)
    for place, length in product(range(2 * JOINTS), range(len(GOES))):
        k = (FORMS * (SIDES + 1) + place) * len(GOES) + length
        assert way_number(k, 0.6, e, m) == GOES[length]
        known = np.zeros(JOINTS)
        known[place // 2] = 0.6 * m.joint_figures[place // 2].velocity
        assert e.trial == pytest.approx(known * (-1.0 if place % 2 else 1.0))


@pytest.mark.parametrize("ordered", [False, True])
@pytest.mark.parametrize("phase", [RESTING, RUNNING, STOPPING])
def test_a_robot_that_rests_or_runs_waits_for_the_reason_of_its_standstill(
    phase, ordered
):
    why = int(Reason.STOP_ORDERED) if ordered else 777
    for before in (Reason.OK, 555):
        a = record(
            notes=records(1, places.RobotNotes),
            request=records(1, places.Request)[0],
        )
        a.request.form = places.STANDSTILL
        a.request.stop_reason = why
        v = record(phase=np.array([phase]), cause=np.array([before]))
        assert waits(a, v)
        # What stopped it before is reported on, unless a person ordered this stop.
        kept = phase == STOPPING or (before != Reason.OK and not ordered)
        assert v.cause[0] == (before if kept else why)
        assert a.notes[0].ordered_stop == (why if ordered else 0)
        a.request.form = places.VELOCITIES
        assert waits(a, v) == ordered


@pytest.mark.parametrize("measured", [False, True])
@pytest.mark.parametrize("phase", [RUNNING, RECOVERING, RESTING, STOPPING])
def test_what_drives_miss_is_how_far_they_are_outside_what_is_under_way(
    phase, measured
):
    rng = np.random.default_rng(16)
    part = 1.0 - np.exp(-DT / MISSING_TIME)
    for _ in range(10):
        a, m, watched = answers(rng), motion(rng), watch(rng)
        middle, velocity = rng.uniform(-0.3, 0.3, (2, JOINTS))
        watched.given.has_velocity = measured
        v = record(
            **watched._asdict(),
            phase=np.array([phase]),
            velocity=velocity,
            under_way=np.sort(rng.uniform(-0.2, 0.2, (JOINTS, 2)), axis=1),
        )
        m = record(**m._asdict(), v_low=middle - 0.02, v_high=middle + 0.02)
        before = a.missed.copy()
        miss(a, v, m)
        speed = velocity if measured else middle
        off = speed - np.clip(speed, *v.under_way.T)
        most = m.joint_figures.tracking_error
        known = before + part * (np.clip(off, -most, most) - before)
        driven = phase in (RUNNING, RECOVERING)
        assert a.missed == pytest.approx(known if driven else np.zeros(JOINTS))


@pytest.mark.parametrize("share", [0.98, 1.02])
def test_a_retreat_is_held_up_when_no_joint_goes_at_5_percent_of_what_it_asks(share):
    rng = np.random.default_rng(17)
    a, v, m, s = answers(rng), watch(rng), motion(rng), lead(rng)
    top = m.joint_figures.velocity
    a.requested[:] = [0.2, -0.4, 0.1] * top
    v.commanded[:] = [0.0, 0.0, share * 0.05 * 0.4] * top
    for pull in (0.5, 0.01):
        s.memory[0].speed = pull
        # It is said after 0.1 s.
        cycles = int(0.1 / DT)
        said = [held_up(a, s, v, m) for _ in range(cycles + 2)]
        assert not any(said[: cycles - 1])
        assert said[-1] == (share < 1.0)
        # It goes on as gently as it began.
        gentle = min(pull, 0.05 * 0.4 * (1.0 + share))
        assert s.memory[0].speed == pytest.approx(gentle if share < 1.0 else pull)
        s.memory[0].at_rest = 0.0


def test_what_two_pairs_have_left_of_late_is_remembered_of_each():
    rng = np.random.default_rng(18)
    v = watch(rng)
    spare_of = records(places.REMEMBERED, places.RememberedPair)
    spare_of.fill(places.NEVER)
    a = record(spares=np.full(places.REMEMBERED, np.inf), spare_of=spare_of)
    # Several of them have the same place.
    pairs = [(i, j) for i in range(2) for j in range(i + 1, 38)]
    left = rng.uniform(0.01, 0.02, len(pairs))
    part = 1.0 - np.exp(-DT / 0.03)
    # More is believed little by little, less at once.
    for count, more in enumerate((0.0, 0.01, -0.005), 1):
        v.sent_count[0] = count
        found = [
            spare(*pair, x, a, v) for pair, x in zip(pairs, left + more, strict=True)
        ]
        left = left + (part if more > 0.0 else 1.0) * more
        assert found == pytest.approx(left)
