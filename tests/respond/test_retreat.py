"""Back along the way that led in, or to a safe configuration; waiting where it must."""

import numpy as np
import pytest

from approach import ball_scene
from armguard.errors import GoalError, NoRetreatError, UnknownNameError
from armguard.geometry import Pose, Sphere
from armguard.respond import Action, Blocked, Guard
from armguard.respond.lead_state import TRAIL
from armguard.respond.trail import TRAIL_STEP
from bay_loop import LEFT, TOP, bay_guard, bay_loop, tool_pose, wander
from driven import Driven

FLOOR = 0.005

RESPONSES = ("deflect", "slow", "stop", "field")


@pytest.fixture(scope="module", params=RESPONSES)
def any_guard(request):
    return bay_guard(kind=request.param)


@pytest.fixture(scope="module")
def guard():
    return bay_guard()


def led_in(guard, cycles=2500, desired=wander):
    """A loop whose left arm was led somewhere, then stopped, and now rests."""
    guard.reset()
    loop = bay_loop(guard)
    loop.run(desired, cycles)
    assert loop.stops == []
    loop.inward = len(loop.q_rows)
    loop.cycle(np.full(14, np.nan))
    while loop.cycle(loop.still).action >= Action.STOP:
        assert len(loop.commands) < cycles + 3000
    loop.rests = len(loop.q_rows)
    return loop


def until(loop, why, cycles=15000, desired=None):
    """Go on until the left arm says this; the last command."""
    for _ in range(cycles):
        command = loop.cycle(loop.still if desired is None else desired)
        if command.blocked["left"] is why:
            return command
    raise AssertionError(f"never {why.name}, but {command.blocked['left'].name}")


def from_the_way_in(loop, rows):
    """Farthest that rows are from where the arm was on its way in, at top speed [s]."""
    way = np.array(loop.q_rows[: loop.rests])[:, LEFT]
    return max(
        (np.abs(way - q[LEFT]) / TOP).max(axis=1).min() for q in np.array(rows)[::25]
    )


def test_it_goes_back_along_the_way_that_led_in(any_guard):
    loop = led_in(any_guard)
    any_guard.retreat("left")
    until(loop, Blocked.RETREATING)
    until(loop, Blocked.NOT)
    back = loop.q_rows[loop.rests :]
    assert from_the_way_in(loop, back) < 1.5 * TRAIL_STEP
    # It is where it began, but for what counts as there.
    assert (np.abs(loop.q - any_guard.home)[LEFT] / TOP).max() < TRAIL_STEP
    assert loop.stops[-1] in loop.commands[: loop.rests]


def test_it_goes_no_faster_than_it_resumes(guard):
    loop = led_in(guard)
    guard.retreat("left")
    until(loop, Blocked.RETREATING)
    until(loop, Blocked.NOT)
    speeds = np.abs(np.array(loop.v_rows[loop.rests :]))[:, LEFT] / TOP
    assert speeds.max() <= 0.1 + 1e-9
    assert speeds.max() > 0.095
    commanded = np.array([c.velocity[LEFT] for c in loop.commands[loop.rests :]])
    assert np.abs(np.diff(commanded, 2, axis=0)).max() / 0.001**2 < 200.0


def place_on_the_way(guard, loop, share):
    """Put the ball where the tool was on its way in; the tool's place."""
    q = loop.q_rows[int(share * loop.inward)]
    tip = tool_pose(guard, q)[:3, 3]
    guard.place("cart", Pose(xyz=tuple(tip)))
    return tip


def test_where_something_is_in_the_way_back_it_waits_and_says_so(any_guard):
    guard = any_guard
    loop = led_in(guard)
    try:
        place_on_the_way(guard, loop, 0.4)
        guard.retreat("left")
        until(loop, Blocked.WAY_BLOCKED)
        begin = len(loop.commands)
        waits = loop.run(loop.still, 1000)
        assert waits.blocked["left"] is Blocked.WAY_BLOCKED
        assert waits.action is Action.FOLLOW
        assert "waiting" in Blocked.WAY_BLOCKED.sentence
        near = [c.verdict.nearest for c in loop.commands[loop.rests :]]
        assert min(p.distance for p in near if p) >= FLOOR
        # It does not go round: all the time it is on its way.
        assert from_the_way_in(loop, loop.q_rows[loop.rests :]) < 1.5 * TRAIL_STEP
        speeds = np.abs([c.velocity[LEFT] for c in loop.commands[begin + 500 :]])
        assert speeds.max() < 0.01
    finally:
        guard.remove("cart")
    # What was in the way is gone: it goes on by itself.
    until(loop, Blocked.NOT)
    assert (np.abs(loop.q - guard.home)[LEFT] / TOP).max() < TRAIL_STEP


def test_a_retreat_that_is_requested_during_a_stop_begins_when_it_rests(guard):
    guard.reset()
    loop = bay_loop(guard)
    loop.run(wander, 1500)
    assert loop.cycle(np.full(14, np.nan)).action is Action.STOP
    guard.retreat()
    until(loop, Blocked.RETREATING)
    until(loop, Blocked.NOT)
    assert (np.abs(loop.q - guard.home)[LEFT] / TOP).max() < TRAIL_STEP


def test_an_operator_who_never_let_go_neither_ends_it_nor_has_the_arm_then(guard):
    loop = led_in(guard, 600)
    guard.retreat("left")
    desired = wander(loop)
    until(loop, Blocked.RETREATING, desired=desired)
    command = until(loop, Blocked.STOPPED, desired=desired)
    assert (np.abs(loop.q - guard.home)[LEFT] / TOP).max() < TRAIL_STEP
    loop.run(desired, 100)
    assert np.abs(command.velocity[LEFT]).max() < 0.02
    loop.cycle(loop.still)
    assert loop.run(desired, 300).velocity == pytest.approx(desired)


def test_an_operator_who_let_go_and_desires_motion_has_it_at_once(guard):
    loop = led_in(guard)
    guard.retreat("left")
    loop.run(loop.still, 500)
    desired = -0.1 * wander(loop)
    command = loop.run(desired, 400)
    assert command.blocked["left"] is Blocked.NOT
    assert command.velocity == pytest.approx(desired)


def test_engaging_ends_it(guard):
    loop = led_in(guard)
    guard.retreat("left")
    until(loop, Blocked.RETREATING)
    guard.engage("left")
    command = loop.run(loop.still, 300)
    assert command.blocked["left"] is Blocked.NOT
    assert (command.velocity == 0.0).all()


def test_another_stop_ends_it(guard):
    loop = led_in(guard)
    guard.retreat("left")
    loop.run(loop.still, 500)
    loop.cycle(np.full(14, np.nan))
    command = loop.run(loop.still, 1500)
    assert command.blocked["left"] is Blocked.NOT
    assert (command.velocity == 0.0).all()


def test_a_robot_with_desired_positions_meets_its_leader_arm_again_afterwards(guard):
    guard.reset()
    loop = bay_loop(guard)
    leader = guard.home.copy()

    def lead(loop):
        leader[:] += 0.001 * wander(loop)
        return leader

    loop.run(lead, 1500, "filter_positions")
    loop.cycle(np.full(14, np.nan), "filter_positions")
    loop.run(leader, 1000, "filter_positions")
    guard.retreat("left")
    for _ in range(20000):
        command = loop.cycle(leader, "filter_positions")
        if command.blocked["left"] is Blocked.STOPPED:
            break
    assert (np.abs(loop.q - guard.home)[LEFT] / TOP).max() < TRAIL_STEP
    rests = loop.q.copy()
    loop.run(leader, 300, "filter_positions")
    assert (loop.q == rests).all()
    # The leader arm comes to where the arm is, and has it again.
    command = loop.run(loop.q + 0.01, 50, "filter_positions")
    assert command.blocked["left"] is Blocked.NOT


def test_to_positions_it_goes_straight_where_that_is_free(guard):
    loop = led_in(guard, 1000)
    goal = loop.q[LEFT] + 0.1
    there = loop.q.copy()
    there[LEFT] = goal
    assert guard.check_path([loop.q, there]).clear
    begin = loop.q.copy()
    guard.retreat("left", to=goal)
    until(loop, Blocked.RETREATING)
    until(loop, Blocked.NOT)
    assert (np.abs(loop.q[LEFT] - goal) / TOP).max() < 0.005
    # All joints at the same place of the line.
    way = (np.array(loop.q_rows[loop.rests :]) - begin)[:, LEFT]
    assert np.ptp(way, axis=1).max() < 5e-3


def round_a_corner(loop):
    """Desired motion that turns the left arm, and then leans it forward."""
    v = np.zeros(14)
    v[0 if loop.t < 1.45 else 1] = 0.5
    return v


def test_else_it_goes_back_along_its_way_first(guard):
    loop = led_in(guard, 2400, round_a_corner)
    # A place of the last link on the straight way home, beside the way that led in.
    T = tool_pose(guard, loop.q + 0.5 * (guard.home - loop.q))
    way = loop.q_rows[: loop.inward : 50][::-1]
    try:
        guard.place("cart", Pose(xyz=tuple(T[:3, 3] + 0.12 * T[:3, 2])))
        assert not guard.check_path([loop.q, guard.home]).clear
        assert guard.check_path(way).clear
        guard.retreat("left", to=guard.home[LEFT])
        until(loop, Blocked.RETREATING)
        until(loop, Blocked.NOT)
        assert (np.abs(loop.q[LEFT] - guard.home[LEFT]) / TOP).max() < 0.005
        near = [c.verdict.nearest for c in loop.commands[loop.rests :]]
        assert min(p.distance for p in near if p) >= FLOOR
    finally:
        guard.remove("cart")


def test_positions_without_a_free_way_are_refused_and_nothing_moves(guard):
    loop = led_in(guard, 800)
    q = guard.home
    q[LEFT] += [0.5, 0.3, -0.4, -0.5, 0.3, 0.2, 1.0]
    tip = tool_pose(guard, q)[:3, 3]
    try:
        guard.place("cart", Pose(xyz=tuple(tip)))
        with pytest.raises(NoRetreatError, match="no free way leads robot 'left'"):
            guard.retreat("left", to=q[LEFT])
        rests = loop.q.copy()
        loop.run(loop.still, 200)
        assert (loop.q == rests).all()
    finally:
        guard.remove("cart")


@pytest.mark.parametrize(
    ("name", "to", "error", "words"),
    [
        ("lefd", "path", UnknownNameError, "known names are 'left', 'right'"),
        ("left", "home", GoalError, "must be 'path' or positions"),
        ("left", np.zeros(6), GoalError, "it must be 7 numbers"),
        ("left", np.full(7, np.inf), GoalError, "inf"),
        ("left", np.full(7, 9.0), GoalError, "its limits are"),
        (None, np.zeros(7), GoalError, "name it"),
    ],
)
def test_a_retreat_that_is_none_is_refused(guard, name, to, error, words):
    led_in(guard, 300)
    with pytest.raises(error, match=words):
        guard.retreat(name, to)


def test_before_the_first_cycle_there_is_no_way_back(guard):
    guard.reset()
    with pytest.raises(NoRetreatError, match="nothing is known"):
        guard.retreat()
    with pytest.raises(NoRetreatError, match="before the first cycle"):
        guard.retreat("left", to=guard.home[LEFT])


def test_between_two_bodies_too_near_it_waits_for_one_of_them_to_go():
    scene = ball_scene()
    for name in ("one", "other"):
        scene.add(Sphere(radius=0.1), name=name, present=False)
    guard = Guard(scene, self_test=False)
    loop = Driven(guard)
    loop.run([0.3], 600)
    for name, side in (("one", 0.19), ("other", -0.19)):
        angle = loop.q[0] + side
        guard.place(name, Pose(xyz=(0.7 * np.cos(angle), 0.7 * np.sin(angle), 0.2)))
    loop.run([0.0], 400)
    guard.retreat()
    pinched = loop.run([0.0], 200)
    assert pinched.blocked == {"arm": Blocked.PINCHED}
    assert pinched.velocity[0] == 0.0
    # The obstacle behind it goes: it leaves the other one, and goes back all the way.
    guard.remove("other")
    leaving = loop.run([0.0], 30)
    assert leaving.blocked == {"arm": Blocked.TOO_NEAR}
    assert leaving.velocity[0] < 0.0
    loop.run([0.0], 4000)
    assert loop.q[0] == pytest.approx(guard.home[0], abs=0.02)
    assert loop.commands[-1].blocked == {"arm": Blocked.NOT}


def test_what_is_remembered_is_bounded_and_shortened_by_going_back(guard):
    guard.reset()
    loop = bay_loop(guard)
    desired = loop.still.copy()
    desired[0] = 0.5
    loop.run(desired, 1500)
    places = guard._lead.notes[0].count
    assert 20 < places < 40
    loop.run(-desired, 1500)
    assert guard._lead.notes[0].count < 0.3 * places
    # Round and round: the oldest places are forgotten.
    for _ in range(2):
        loop.run(lambda loop: circle(loop.t), 15000)
    assert guard._lead.notes[0].count == TRAIL


def circle(t):
    """Desired motion of the left wrist round in free space."""
    v = np.zeros(14)
    v[4], v[6] = 1.5 * np.cos(3.0 * t), 1.5 * np.sin(3.0 * t)
    return v


def test_the_same_retreat_gives_the_same_bits(guard):
    runs = []
    for _ in range(2):
        loop = led_in(guard, 800)
        guard.retreat("left")
        loop.run(loop.still, 1500)
        runs.append(
            b"".join(c.velocity.tobytes() + c.verdict.tobytes() for c in loop.commands)
        )
    assert runs[0] == runs[1]
