"""Commands to robots: the desired motion, or something near it, or a stop."""

import re
from pathlib import Path

import numpy as np
import pytest

from approach import CENTRE, PERIOD, angle_at
from armguard.errors import SceneError
from armguard.guard import Level, Reason
from armguard.respond import RESPONSES, Action, Guard
from armguard.respond.daqp_interface import FUNCTION, ITERATIONS, SETTINGS
from armguard.scene import bay_scene
from armguard.scene.settings import CHOICES
from driven import Driven, ball_guard, wall_guard

FLOOR = 0.005


def gap(q):
    """True distance of arm and ball, by hand [m]."""
    return CENTRE * np.sin(np.pi / 4 - q[0]) - 0.14


def test_every_response_a_scene_may_name_is_in_the_table():
    assert set(RESPONSES) == set(CHOICES["kind"])


def test_the_page_of_the_filter_has_every_response():
    page = Path(__file__).parents[2].joinpath("docs/filter.md").read_text("utf-8")
    rows = re.findall(r"^\| `([a-z]+)` \| ", page, flags=re.MULTILINE)
    assert set(RESPONSES) <= set(rows)


def test_in_clear_space_the_desired_motion_is_commanded_bit_for_bit():
    loop = Driven(ball_guard())
    desired = np.array([-0.123456789])
    loop.run(desired, 40)
    assert loop.commands[-1].velocity.tobytes() == desired.tobytes()
    assert loop.commands[-1].passed == {"arm": 1.0}


def test_commands_change_no_faster_than_the_acceleration():
    loop = Driven(ball_guard())
    for desired in (2.0, -2.0, 0.3):
        loop.run([desired], 150)
    commanded = np.array([c.velocity[0] for c in loop.commands])
    assert np.abs(np.diff(commanded)).max() <= 8.0 * PERIOD * (1.0 + 1e-9)


@pytest.mark.parametrize(
    ("response", "delay", "miss"),
    [("slow", 0, 0.0), ("slow", 3, 0.0), ("deflect", 0, 0.0), ("deflect", 2, 0.01)],
)
def test_desired_motion_into_the_ball_ends_at_the_floor_without_a_stop(
    response, delay, miss
):
    loop = Driven(ball_guard(response), delay=delay, miss=miss)
    loop.run([1.0], 3500)
    assert loop.stops == []
    gaps = [gap(q) for q in loop.q_rows]
    assert min(gaps) >= FLOOR
    # It comes near, too: no more than what a resting arm needs for its errors.
    assert gaps[-1] < FLOOR + 0.002
    # An arm that is slowed gently: never harder than its declared stop.
    commanded = np.array([c.velocity[0] for c in loop.commands])
    assert np.diff(commanded).min() >= -4.0 * PERIOD * (1.0 + 1e-9)


def test_the_response_stop_goes_on_as_asked_and_then_stops():
    loop = Driven(ball_guard("stop"))
    loop.run([1.0], 1700)
    first = next(k for k, c in enumerate(loop.commands) if c.action > 0)
    assert loop.commands[first].verdict.reason is Reason.TOO_CLOSE
    # Until then nothing of the desired motion was taken back.
    assert loop.commands[first - 1].velocity[0] == 1.0
    rest = loop.run([1.0], 600)
    assert rest.velocity[0] == 0.0
    assert FLOOR <= gap(loop.q) < 0.05
    # Slower than that, it goes on nearer.
    slowed = np.diff([c.velocity[0] for c in loop.commands[first:][:200]])
    assert slowed.min() >= -4.0 * PERIOD * (1.0 + 1e-9)


def test_deflect_slides_along_a_wall_where_slow_comes_to_rest():
    # The arm is stretched out towards the wall, and is to sweep along it.
    start = [0.2, 0.2, 0.1]
    desired = np.array([0.5, 0.0, 0.0])
    ways = {}
    for response in ("slow", "deflect"):
        loop = Driven(wall_guard(response), q=start)
        loop.run(desired, 2500)
        assert loop.stops == []
        ways[response] = np.abs(loop.q - start).max()
        nearest = loop.commands[-1].verdict.nearest
        assert nearest is not None
        assert nearest.distance >= FLOOR
    assert ways["deflect"] > 3.0 * ways["slow"]


def test_slow_keeps_the_desired_direction():
    loop = Driven(wall_guard("slow"), q=[0.2, 0.2, 0.1])
    desired = np.array([0.4, 0.2, 0.1])
    loop.run(desired, 1500)
    for command in loop.commands[200:]:
        commanded = command.velocity
        if np.linalg.norm(commanded) > 1e-4:
            cosine = (
                commanded
                @ desired
                / np.linalg.norm(commanded)
                / np.linalg.norm(desired)
            )
            assert cosine > 0.999


def test_commands_keep_every_proof_so_that_the_next_cycle_never_stops():
    rng = np.random.default_rng(4)
    loop = Driven(wall_guard(), q=[0.2, 0.2, 0.2])
    for _ in range(30):
        loop.run(rng.uniform(-1.5, 1.5, 3), 120)
    assert loop.stops == []
    headroom = [c.verdict.headroom.m for c in loop.commands]
    assert min(headroom) >= 0.0


def test_no_chatter_at_the_boundary():
    loop = Driven(wall_guard(), q=[0.2, 0.2, 0.1])
    loop.run([0.8, 0.0, 0.0], 2500)
    commanded = np.array([c.velocity for c in loop.commands[1500:]])
    jerk = np.diff(commanded, 2, axis=0) / PERIOD**2
    # What rounding leaves: a hundredth of what one step of full acceleration makes.
    assert np.abs(jerk).max() < 0.01 * 8.0 / PERIOD


def test_joints_slow_down_before_their_limits():
    loop = Driven(wall_guard(), q=[-1.0, 0.0, 0.0])
    last = loop.run([-2.0, 0.0, 0.0], 2500)
    assert loop.stops == []
    assert -2.0 <= loop.q[0] < -1.99
    assert abs(last.velocity[0]) < 1e-3


@pytest.mark.parametrize("response", ["slow", "deflect"])
@pytest.mark.parametrize("share", [0.2, 0.5, 0.9])
def test_nor_does_one_pass_its_limit_because_another_one_is_faster(response, share):
    # A response that keeps directions slows down all joints in proportion, not there.
    loop = Driven(wall_guard(response), q=[-1.6, 0.0, -0.5])
    loop.run([-2.0 * share, 0.0, 2.0], 1500)
    assert loop.stops == []
    assert -2.0 <= loop.q[0] < -1.98


def test_desired_motion_above_the_top_speed_is_scaled():
    loop = Driven(wall_guard(), q=[-1.0, 0.0, 0.0])
    loop.run([0.0, 8.0, 4.0], 400)
    fastest = max((c.velocity for c in loop.commands), key=lambda v: abs(v).max())
    assert np.allclose(fastest, [0.0, 2.0, 1.0])


def test_twists_move_the_tool_as_asked():
    guard = wall_guard()
    loop = Driven(guard, q=[-0.6, 0.7, 0.6])
    loop.run({"arm": [0.0, -0.1, 0.0, 0.0, 0.0, 0.0]}, 100, "filter_twists")
    before = tool_point(loop.q)
    loop.run({"arm": [0.0, -0.1, 0.0, 0.0, 0.0, 0.0]}, 200, "filter_twists")
    way = tool_point(loop.q) - before
    assert way == pytest.approx([0.0, -0.02], abs=1e-3)


def tool_point(q):
    """Where link3's frame is, by hand [m]."""
    return 0.4 * (
        np.array([np.cos(q[0]), np.sin(q[0])])
        + np.array([np.cos(q[0] + q[1]), np.sin(q[0] + q[1])])
    )


@pytest.mark.parametrize(
    ("desired", "words"),
    [
        ([np.nan], "nan"),
        ([np.inf], "inf"),
        ([0.0, 0.0], "shape (2,)"),
        ("fast", "numbers"),
        (None, "shape ()"),
        ({"arm/joint9": 1.0}, "arm/joint9"),
    ],
)
def test_invalid_desired_motion_stops_the_arms_and_says_why(desired, words):
    loop = Driven(ball_guard())
    loop.run([0.5], 100)
    command = loop.cycle(desired)
    assert command.action is Action.STOP
    assert command.verdict.level is Level.STOP
    assert command.verdict.reason is Reason.WRONG_COMMAND
    assert words in command.verdict.why
    assert 0.0 < command.velocity[0] < 0.5


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_positions_that_are_no_numbers_stop_the_arms(value):
    loop = Driven(ball_guard())
    loop.run([0.5], 100)
    command = loop.guard.filter([value], [0.5], loop.t, velocity=[0.5])
    assert command.action is Action.STOP
    assert command.verdict.reason is Reason.NOT_FINITE
    assert np.isfinite(command.velocity).all()
    assert command.velocity[0] < 0.5


def test_a_wrong_twist_is_refused_by_name():
    loop = Driven(wall_guard())
    command = loop.cycle({"amr": np.zeros(6)}, "filter_twists")
    assert command.verdict.reason is Reason.WRONG_COMMAND
    assert "'amr'" in command.verdict.why
    assert "'arm'" in command.verdict.why


def test_an_arm_that_is_faster_than_its_commands_is_stopped():
    loop = Driven(ball_guard())
    loop.run([-0.2], 60)
    loop.v = np.array([-0.5])
    command = loop.cycle([-0.2])
    assert command.verdict.reason is Reason.NOT_FOLLOWED
    assert command.verdict.joint == "arm/joint1"
    assert command.action is Action.STOP


@pytest.mark.parametrize("native", [True, False])
def test_a_solver_that_fails_stops_the_arm(monkeypatch, native):
    monkeypatch.setattr("armguard.respond.guard.nearest_velocity", lambda *_: None)
    guard = ball_guard()
    memory = guard._response.solver
    if native:
        # None of its iterations is enough.
        assert memory[FUNCTION] != 0
        memory[SETTINGS:].view(np.int32)[2 * ITERATIONS + 1] = 0
    else:
        memory[FUNCTION] = 0
    loop = Driven(guard)
    loop.run([1.0], 2500)
    assert loop.stops[0].verdict.reason is Reason.NO_WAY
    assert min(gap(q) for q in loop.q_rows) >= FLOOR


def test_a_fixed_scene_cannot_be_filtered():
    guard = Guard(bay_scene())
    with pytest.raises(SceneError, match="'path' or 'speed'"):
        guard.filter(guard.home, guard.home * 0.0, 0.0)


def test_a_verdict_of_a_filtered_cycle_is_the_same_bits_again():
    runs = []
    for _ in range(2):
        loop = Driven(wall_guard(), q=[0.2, 0.2, 0.1])
        loop.run([0.8, -0.2, 0.3], 600)
        runs.append(
            b"".join(c.velocity.tobytes() + c.verdict.tobytes() for c in loop.commands)
        )
    assert runs[0] == runs[1]


def test_the_start_of_the_ball_scene_is_where_the_tests_think():
    assert angle_at(0.1) < np.pi / 4
    assert gap([angle_at(0.1)]) == pytest.approx(0.1)
