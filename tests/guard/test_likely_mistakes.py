"""Inputs in another unit or order: the verdict names the likely mistake."""

import logging

import numpy as np
import pytest

from approach import FIGURES, ball_scene
from armguard import Guard, Level, Pose, Reason, Scene
from armguard.guard.pace import IN_A_ROW
from armguard.guard.sentences import OUTSIDE
from armguard.recording.frames import frame_of
from armguard.recording.recorded import RecordedGuard
from armguard.recording.ring import RingReader, RingWriter
from arms import simple_arm

PERIOD = 0.001


def two_arms(**settings):
    """Two arms of two and three joints, far from each other, and their guard."""
    scene = Scene(period=PERIOD, **settings)
    for name, joints, x in (("left", 2, 0.0), ("right", 3, 9.0)):
        home = {f"joint{k + 1}": 0.2 * k for k in range(joints)}
        scene.add_robot(
            simple_arm(joints),
            name,
            base=Pose(xyz=(x, 0, 0)),
            stopping=FIGURES,
            home=home,
        )
    return Guard(scene, self_test=False)


@pytest.fixture(scope="module")
def guard():
    return two_arms()


@pytest.fixture(autouse=True)
def fresh(guard):
    guard.reset()


def narrow(guard, low, high):
    """Limits of all joints, in place."""
    guard.tables.lower[:], guard.tables.upper[:] = low, high


@pytest.fixture
def signs(guard):
    """Limits in which the first joint of an arm is positive and the last negative."""
    known = guard.tables.lower.copy(), guard.tables.upper.copy()
    narrow(guard, [0.1, -2, 0.1, -2, -2], [2, -0.1, 2, 2, -0.1])
    yield np.array([0.5, -0.5, 0.7, 0.0, -0.7])
    narrow(guard, *known)


def why(guard, q):
    """Sentence of a cycle that is refused for its positions."""
    verdict = guard.step(q, 0.0, velocity=np.zeros(len(q)))
    assert verdict.level >= Level.STOP
    assert verdict.reason is Reason.OUT_OF_LIMITS
    assert verdict.why.startswith("joint '")
    assert "its limits are" in verdict.why
    return verdict.why


def test_degrees_are_named(guard):
    said = why(guard, np.array([0.0, -45.0, 90.0, 10.0, 0.0]))
    assert said.startswith("joint 'left/joint2' is at -45.0000: stop, its limits are")
    assert said.endswith("; the positions look like degrees; give radians")
    guard.reset()
    command = guard.filter(np.full(5, 45.0), np.zeros(5), 0.0, velocity=np.zeros(5))
    assert command.verdict.why.endswith("give radians")


@pytest.mark.parametrize(
    "q",
    [
        [0.0, 2.1, 0.0, 0.0, 0.0],  # a little outside, in radians
        [0.0, 300.0, 0.0, 0.0, 0.0],  # outside in degrees as well
    ],
)
def test_what_is_no_evidence_gets_no_hint(guard, q):
    assert why(guard, np.array(q)).endswith(f"]; {OUTSIDE}")


def test_reverse_order_is_named(guard, signs):
    assert guard.step(signs, 0.0, velocity=0.0 * signs).level < Level.STOP
    left, right = signs[:2], signs[2:]
    for q in ([*left[::-1], *right], [*left[::-1], *right[::-1]]):
        guard.reset()
        said = why(guard, np.array(q))
        assert said.endswith(
            "the joints seem to be in reverse order; see guard.q_names"
        )
    guard.reset()
    assert why(guard, np.array([*right, *left])).endswith(
        "the robots seem to be in reverse order; see guard.q_names"
    )
    guard.reset()
    said = why(guard, np.array([0.5, 0.5, 0.5, 0.0, 0.5]))
    assert said.endswith(f"]; {OUTSIDE}")


def test_a_guard_of_fixed_buffers_names_it_too():
    scene = Scene(mode="fixed")
    scene.add_robot(simple_arm(), "arm")
    verdict = Guard(scene, self_test=False).step([0.0, 45.0, 90.0])
    assert verdict.reason is Reason.OUT_OF_LIMITS
    assert verdict.why.endswith("the positions look like degrees; give radians")


def loop(guard, count, gap):
    """Cycles of an arm at rest with stamps so far apart; the verdicts."""
    q = guard.home
    return [
        guard.filter(q, 0 * q, gap * k, velocity=0 * q).verdict for k in range(count)
    ]


@pytest.mark.parametrize(
    ("gap", "unit"),
    [
        (1.0, "milliseconds"),
        (20.0, "milliseconds"),
        (2e4, "microseconds"),
        (1e6, "nanoseconds"),
    ],
)
def test_stamps_in_another_unit_are_named(guard, gap, unit, caplog):
    fresh_guard = Guard(ball_scene(), self_test=False)
    with caplog.at_level(logging.WARNING, logger="armguard"):
        verdicts = loop(fresh_guard, IN_A_ROW + 2, gap)
    assert verdicts[1].reason is Reason.CYCLE_LATE
    assert f"if stamps are in {unit}, give seconds; else set Scene(" in verdicts[1].why
    (record,) = caplog.records
    assert f"stamps look like {unit}; give seconds" in record.getMessage()


def test_a_pause_of_the_loop_is_no_other_unit(guard, caplog):
    verdict = loop(guard, 2, 0.5)[1]
    assert verdict.reason is Reason.CYCLE_LATE
    assert "milliseconds" not in verdict.why
    assert not caplog.records


def test_two_clocks_are_named(guard):
    q = guard.home
    guard.step(q, 999.9, velocity=0 * q, now=1000.0)
    ahead = guard.step(q, 1e6, velocity=0 * q, now=1000.001)
    assert ahead.reason is Reason.STAMP_AHEAD
    assert ahead.why.endswith("; give stamp and now in seconds, of the same clock")
    guard.reset()
    said = guard.step(q, 1000.01, velocity=0 * q, now=1000.0).why
    assert "of the same clock" not in said


def by_name(guard, vector):
    """The same vector by robot name, in another order of the robots."""
    return {"right": vector[2:].tolist(), "left": vector[:2]}


def test_vectors_by_robot_name_are_the_same_cycle(guard):
    q, v = guard.home, np.linspace(0.01, 0.05, 5)
    other = two_arms()
    for k in range(5):
        plain = guard.filter(q, v, PERIOD * k, velocity=0 * q)
        named = other.filter(
            by_name(other, q),
            by_name(other, v),
            PERIOD * k,
            velocity=by_name(other, 0 * q),
        )
        assert np.array_equal(plain.numbers, named.numbers, equal_nan=True)
        assert plain.verdict.tobytes() == named.verdict.tobytes()
    positions = guard.filter_positions(q, by_name(guard, q), 0.005, velocity=0 * q)
    again = other.filter_positions(q, q, 0.005, velocity=0 * q)
    assert np.array_equal(positions.numbers, again.numbers, equal_nan=True)
    assert guard.judge_at_rest(by_name(guard, q)).level is Level.CLEAR


def test_a_robot_without_desired_velocities_rests(guard):
    q = guard.home
    guard.filter(q, 0 * q, 0.0, velocity=0 * q)
    command = guard.filter(q, {"left": [0.005, 0.005]}, PERIOD, velocity=0 * q)
    assert command.velocity.tolist() == [0.005, 0.005, 0.0, 0.0, 0.0]


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"left": [0, 0]}, "q has no vector of robot 'right'"),
        (
            {"left": [0, 0], "rihgt": [0, 0, 0]},
            "q names 'rihgt', no robot; known names are 'left', 'right'",
        ),
        (
            {"left": [0, 0, 0], "right": [0, 0, 0]},
            "q of robot 'left' has shape (3,); it must be 2 numbers in the order of "
            "guard.q_names",
        ),
        ({"left": [0, "a"], "right": [0, 0, 0]}, "q is no mapping of vectors by robot"),
        ({}, "q has no vector of robot 'left'"),
    ],
)
def test_wrong_vectors_by_name_are_a_stop_with_a_reason(guard, given, says):
    verdict = guard.step(given, 0.0)
    assert verdict.reason is Reason.WRONG_INPUT
    assert verdict.why.removeprefix("stopped: ").startswith(says)


def test_wrong_names_of_desired_motion_are_a_stop_with_a_reason(guard):
    q = guard.home
    command = guard.filter(q, {"lefd": [0.1, 0.1]}, 0.0, velocity=0 * q)
    assert command.verdict.reason is Reason.WRONG_COMMAND
    assert command.verdict.why.removeprefix("stopped: ").startswith(
        "v_desired names 'lefd', no joint and no robot; known names are 'left', 'right'"
    )
    mixed = {"left": [0.1, 0.1], "right/joint1": 0.1}
    command = guard.filter(q, mixed, PERIOD, velocity=0 * q)
    said = command.verdict.why.removeprefix("stopped: ")
    assert said.startswith("v_desired names 'right/joint1', no robot")
    command = guard.filter_positions(q, {"left": q[:2]}, 2 * PERIOD, velocity=0 * q)
    assert command.verdict.why == "stopped: q_desired has no vector of robot 'right'"


def test_vectors_by_name_are_recorded_as_vectors(guard, tmp_path):
    taped = RecordedGuard(guard, RingWriter(tmp_path / "ring"))
    q, v = guard.home, np.linspace(0.01, 0.05, 5)
    taped.filter(by_name(guard, q), by_name(guard, v), 0.0, velocity=by_name(guard, q))
    guard.reset()
    taped.filter(np.full(5, 45.0), v, PERIOD, velocity=0 * v)
    found = [frame_of(data) for data in RingReader(tmp_path / "ring").unread()]
    first, last = found[-2:]
    assert np.array_equal(first.q, q) and np.array_equal(first.velocity, q)
    assert np.array_equal(first.asked, v)
    assert "degrees" in last.text["fault"] and last.text["wrong"] == ""
