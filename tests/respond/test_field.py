"""Fields: goals are reached, buffers kept, local minima named; wrong goals refused."""

import numpy as np
import pytest

from armguard.errors import GoalError, PoseError, SceneError, UnknownNameError
from armguard.geometry import Pose
from armguard.guard.workspace import open_workspace
from armguard.kernel import kernel
from armguard.respond import Action, Blocked
from armguard.respond.field import STEEPEST, field_at, repel
from armguard.respond.lead_state import Source
from armguard.respond.state import open_response
from armguard.respond.tool_motion import solve_positive, turn_between
from armguard.scene import Scene
from bay_loop import LEFT, RIGHT, TOP, bay_guard, bay_loop, tool_pose
from sliding import at_gap, slides

# What every pair keeps at rest, and what the bay's arms may be measured wrong by [m].
FLOOR = 0.005

# Goals of both arms that a straight way leads to.
GOALS = (
    np.array([0.5, 0.3, -0.4, -0.5, 0.3, 0.2, 1.0]),
    np.array([-0.6, 0.2, 0.3, -0.8, -0.5, -0.3, -1.0]),
)


@kernel(entry=True)
def field(part, near):
    return field_at(part, near)


def push(part):
    """The full force."""
    return field(part, 1.0)[1]


@kernel(entry=True)
def turn_to(T, aim):
    return turn_between(T, aim)


@kernel(entry=True)
def solve(square):
    solve_positive(square.shape[0], square)


@kernel(entry=True)
def push_off(response, lines):
    a, w = open_response(response), open_workspace(lines)
    v, m = w.watch, w.motion
    repel(a, a.lead, w, v, m)


@pytest.fixture(scope="module")
def guard():
    return bay_guard(kind="field")


@pytest.fixture(scope="module")
def trap():
    return bay_guard(kind="field", box=True)


def least(loop):
    """Least distance of any near pair in all cycles [m]."""
    return min(c.verdict.nearest.distance for c in loop.commands if c.verdict.nearest)


def test_both_arms_reach_joint_goals_without_a_stop(guard):
    guard.reset()
    loop = bay_loop(guard)
    goal = guard.home
    goal[LEFT] += GOALS[0]
    goal[RIGHT] += GOALS[1]
    assert guard.check_path([guard.home, goal]).clear
    guard.field_goal("left", q=goal[LEFT])
    guard.field_goal("right", q=goal[RIGHT])
    loop.run(loop.still, 7000)
    assert loop.stops == []
    assert np.abs(loop.q - goal).max() < 1e-3
    assert least(loop) > FLOOR
    assert all(b is Blocked.NOT for b in loop.commands[-1].blocked.values())


def test_it_is_led_no_faster_than_its_field_and_gently(guard):
    guard.reset()
    loop = bay_loop(guard)
    guard.field_goal("left", q=guard.home[LEFT] + GOALS[0])
    loop.run(loop.still, 4000)
    commanded = np.array([c.velocity[LEFT] for c in loop.commands])
    assert (np.abs(commanded) <= 0.3 * TOP + 1e-9).all()
    assert np.abs(commanded).max() > 0.29 * 1.25
    jerk = np.diff(commanded, 2, axis=0) / 0.001**2
    # A first-order start at full acceleration would have thousands.
    assert np.abs(jerk).max() < 200.0


@pytest.mark.parametrize("tool", ["left", "left/link6"])
def test_a_pose_is_reached(guard, tool):
    guard.reset()
    q = guard.home
    q[LEFT] += 0.5 * GOALS[0]
    goal = tool_pose(guard, q, tool)
    guard.reset()
    loop = bay_loop(guard)
    guard.field_goal(tool, pose=Pose.from_matrix(goal))
    loop.run(loop.still, 7000)
    found = tool_pose(guard, loop.q, tool)
    assert loop.stops == []
    assert np.linalg.norm(found[:3, 3] - goal[:3, 3]) < 1e-3
    assert np.linalg.norm(found[:3, :3] - goal[:3, :3]) < 3e-3


def test_an_operator_who_desires_motion_leads_and_then_the_field_again(guard):
    guard.reset()
    loop = bay_loop(guard)
    guard.field_goal("left", q=guard.home[LEFT] + GOALS[0])
    loop.run(loop.still, 500)
    desired = loop.still.copy()
    desired[0] = -0.2
    command = loop.run(desired, 300)
    assert command.velocity == pytest.approx(desired, abs=1e-12)
    loop.run(loop.still, 6000)
    assert np.abs(loop.q[LEFT] - guard.home[LEFT] - GOALS[0]).max() < 1e-3


def test_where_positions_are_commanded_no_field_leads(guard):
    guard.reset()
    loop = bay_loop(guard)
    guard.field_goal("left", q=guard.home[LEFT] + GOALS[0])
    loop.run(guard.home, 500, "filter_positions")
    assert np.abs(loop.q - guard.home).max() < 1e-6


def test_after_a_stop_it_sets_out_again_only_when_it_is_engaged(guard):
    guard.reset()
    loop = bay_loop(guard)
    guard.field_goal("left", q=guard.home[LEFT] + GOALS[0])
    loop.run(loop.still, 800)
    assert loop.cycle(loop.still + np.nan).action is Action.STOP
    command = loop.run(loop.still, 1500)
    assert command.actions["left"] is Action.HOLD
    assert command.blocked["left"] is Blocked.STOPPED
    rests = loop.q.copy()
    loop.run(loop.still, 300)
    assert (loop.q == rests).all()
    guard.engage("left")
    assert loop.run(loop.still, 300).blocked["left"] is Blocked.NOT
    loop.run(loop.still, 5000)
    assert np.abs(loop.q[LEFT] - guard.home[LEFT] - GOALS[0]).max() < 1e-3


def into_the_box(guard):
    """A loop whose left arm is drawn to behind the back wall of the box."""
    goal = tool_pose(guard, guard.home)
    goal[0, 3] += 0.35
    guard.reset()
    loop = bay_loop(guard)
    guard.field_goal("left", pose=goal)
    return loop


def test_an_open_box_is_a_local_minimum_that_is_named_in_time(trap):
    loop = into_the_box(trap)
    while loop.cycle(loop.still).blocked["left"] is not Blocked.LOCAL_MINIMUM:
        assert len(loop.commands) < 6000
    named = len(loop.commands)
    # The goal came nearer last no more than two seconds before.
    tips = [tool_pose(trap, q)[:3, 3] for q in loop.q_rows[::50]]
    ways = [np.linalg.norm(tip - tips[-1]) for tip in tips]
    assert loop.stops == []
    assert "local minimum" in Blocked.LOCAL_MINIMUM.sentence
    assert ways[0] > 0.1
    # It rests there, and says so all the time.
    command = loop.run(loop.still, 1500)
    assert command.blocked["left"] is Blocked.LOCAL_MINIMUM
    assert command.action is Action.HOLD
    held = command.held["left"]
    assert "local minimum" in held.cause
    assert "engage('left')" in held.remedy
    assert not held.until_engaged
    assert (np.diff(loop.q_rows[-500:], axis=0) == 0.0).all()
    assert least(loop) > FLOOR
    assert named > 1000


def test_there_is_no_chatter_on_the_way_into_it(trap):
    loop = into_the_box(trap)
    loop.run(loop.still, 5000)
    commanded = np.array([c.velocity[LEFT] for c in loop.commands])
    change = np.diff(commanded, axis=0)
    # Changes that matter: more than a thousandth of what the acceleration allows.
    large = np.where(np.abs(change) > 1e-3 * np.abs(change).max(), np.sign(change), 0.0)
    turns = [np.count_nonzero(np.diff(s[s != 0.0])) for s in large.T]
    assert max(turns) < 20


def test_a_robot_led_out_of_a_minimum_is_drawn_again(trap):
    loop = into_the_box(trap)
    while loop.cycle(loop.still).blocked["left"] is not Blocked.LOCAL_MINIMUM:
        assert len(loop.commands) < 6000
    desired = loop.still.copy()
    desired[1] = -0.3
    assert loop.run(desired, 400).blocked["left"] is Blocked.NOT
    before = loop.q.copy()
    command = loop.run(loop.still, 300)
    assert command.blocked["left"] is Blocked.NOT
    assert np.abs(loop.q - before).max() > 0.01


def test_an_object_that_appears_beside_an_arm_pushes_it_off(guard):
    guard.reset()
    loop = bay_loop(guard)
    goal = guard.home[LEFT]
    guard.field_goal("left", q=goal + GOALS[0])
    loop.run(loop.still, 7000)
    tip = tool_pose(guard, loop.q)[:3, 3]
    try:
        guard.place("cart", Pose(xyz=tuple(tip + np.array([0.0, 0.16, 0.0]))))
        guard.field_goal("left", q=goal + GOALS[0] + 0.3)
        loop.run(loop.still, 3000)
        assert loop.stops == []
        assert least(loop) > FLOOR
    finally:
        guard.remove("cart")


def test_the_same_goals_give_the_same_bits(trap):
    runs = []
    for _ in range(2):
        loop = into_the_box(trap)
        loop.run(loop.still, 1500)
        runs.append(
            b"".join(c.velocity.tobytes() + c.verdict.tobytes() for c in loop.commands)
        )
    assert runs[0] == runs[1]


@pytest.mark.parametrize(
    ("name", "goal", "error", "words"),
    [
        (
            "lefd",
            {"q": np.zeros(7)},
            UnknownNameError,
            "known names are 'left', 'right'",
        ),
        ("left", {"q": np.zeros(6)}, GoalError, "it must be 7 numbers"),
        ("left", {"q": np.full(7, np.nan)}, GoalError, "nan"),
        ("left", {"q": "home"}, GoalError, "it must be 7 numbers"),
        ("left", {"q": np.full(7, 4.0)}, GoalError, "'left/joint1' is to go to 4.0"),
        ("left", {"pose": np.zeros((4, 4))}, PoseError, "pose"),
        ("left", {"pose": np.full((4, 4), np.nan)}, PoseError, "pose"),
        ("left", {"q": np.zeros(7), "pose": Pose()}, GoalError, "give one of them"),
    ],
)
def test_a_goal_that_is_none_is_refused_and_changes_nothing(
    guard, name, goal, error, words
):
    guard.reset()
    loop = bay_loop(guard)
    with pytest.raises(error, match=words):
        guard.field_goal(name, **goal)
    loop.run(loop.still, 50)
    assert (loop.q == guard.home).all()


def test_a_robot_with_another_response_has_no_goal():
    other = bay_guard(kind="deflect")
    with pytest.raises(GoalError, match="has the response 'deflect'"):
        other.field_goal("left", q=other.home[LEFT])


def test_a_goal_is_forgotten_when_none_is_given(guard):
    guard.reset()
    loop = bay_loop(guard)
    guard.field_goal("left", q=guard.home[LEFT] + GOALS[0])
    guard.field_goal("left")
    loop.run(loop.still, 100)
    assert (loop.q == guard.home).all()


@pytest.mark.parametrize(
    "wrong",
    [
        {"influence": 0.0},
        {"repulsion": -1.0},
        {"attraction": np.nan},
        {"patience": np.inf},
        {"field_speed": 1.5},
    ],
)
def test_settings_that_cannot_be_are_errors(wrong):
    (name,) = wrong
    with pytest.raises(SceneError, match=name):
        bay_guard(kind="field", **wrong)


def test_what_pushes_is_seen_from_where_its_push_begins():
    assert Scene(mode="path").margin < 0.1
    assert bay_guard(kind="field", influence=0.15).tables.margin >= 0.15


@pytest.mark.parametrize("near", [0.0, 0.3, 1.0])
def test_the_force_is_minus_the_gradient_of_the_potential(near):
    # Deep on the tangent, where it begins, on Khatib's own, where it is cut, beyond.
    parts = np.concatenate([np.linspace(-0.5, 1.5, 401), [STEEPEST, 1.0]])
    step = 1e-5
    for part in parts.tolist():
        before, after = field(part - step, near)[0], field(part + step, near)[0]
        potential, force = field(part, near)
        assert force == pytest.approx((before - after) / (2.0 * step), abs=1e-6)
        assert potential >= 0.0 and force >= 0.0
    assert field(1.0, near) == (0.0, 0.0)


def test_the_field_fades_with_the_square_of_the_way_to_the_goal():
    for part in (0.0, 0.4, 0.7):
        full = np.array(field(part, 1.0))
        assert np.array(field(part, 0.3)) == pytest.approx(0.09 * full, rel=1e-14)


def test_the_push_is_khatibs_where_it_is_not_too_steep():
    for x in (0.5, 0.6, 0.9, 1.0):
        assert push(x) == pytest.approx((1.0 / x - 1.0) / (4.0 * x * x))
    assert push(0.5) == pytest.approx(1.0)
    # On from there it is a straight line of the same slope.
    slope = (push(STEEPEST + 1e-6) - push(STEEPEST)) / 1e-6
    assert push(0.0) == pytest.approx(push(STEEPEST) - slope * STEEPEST, rel=1e-4)


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-3, 1.0, 3.0, np.pi - 1e-6, np.pi])
def test_turns_lead_where_they_should(angle):
    rng = np.random.default_rng(1)
    for _ in range(50):
        axis = rng.normal(size=3)
        axis /= np.linalg.norm(axis)
        K = np.cross(np.eye(3), axis)
        R = np.eye(3) + np.sin(angle) * K + (1.0 - np.cos(angle)) * (K @ K)
        start = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        start *= np.sign(np.linalg.det(start))
        rows = [np.column_stack([M, np.zeros(3)]).ravel() for M in (start, R @ start)]
        turn = np.array(turn_to(*rows))
        # At half a turn both directions lead there.
        gap = min(np.abs(turn - s * angle * axis).max() for s in (1.0, -1.0))
        assert gap < 1e-6
        if angle < np.pi - 1e-3:
            assert np.abs(turn - angle * axis).max() < 1e-9


def test_positive_systems_are_solved():
    rng = np.random.default_rng(2)
    for _ in range(20):
        J = rng.normal(size=(6, 7))
        A, b = J @ J.T + 4e-4 * np.eye(6), rng.normal(size=6)
        square = np.column_stack([A, b])
        solve(square)
        assert np.allclose(A @ square[:, 6], b, atol=1e-8)


@pytest.mark.parametrize("margin", [0.06, 0.5])
def test_a_near_pair_pushes_a_robot_in_a_field_from_where_its_influence_begins(margin):
    guard = slides({}, {}, response="field", buffer=FLOOR, margin=margin)
    for left, right in (
        (Source.FIELD, Source.OPERATOR),
        (Source.OPERATOR, Source.FIELD),
        (Source.FIELD, Source.FIELD),
    ):
        for share in (0.5, 0.98, 1.02):
            guard.reset()
            # It sees no farther than the margin.
            reach = min(0.1, margin - FLOOR)
            q, still = at_gap(FLOOR + share * reach, 2), np.zeros(2)
            guard.filter(q, still, 0.0, velocity=still, now=0.0)
            lead, settings = guard._lead, guard._response.settings
            assert settings[0].influence == 0.1
            lead.notes.source = left, right
            # Its goal is far.
            lead.memory.time_left = 1.0
            lead.pull[:] = 0.3, -0.2
            push_off(guard._response_lines, guard._lines.ctypes.data)
            led = np.array([left, right]) == Source.FIELD
            near = led & (share < 1.0)
            force = settings.repulsion * near * push(share)
            assert lead.weight == pytest.approx(force)
            # The lever of a slide is 1, beside which 0.1 m is kept.
            square = 1.0 + 0.1**2
            assert lead.push == pytest.approx(force**2 / square * [-1.0, 1.0])
            taken = near * (1.0 - share) / square
            assert lead.pull == pytest.approx(np.array([0.3, -0.2]) * (1.0 - taken))
