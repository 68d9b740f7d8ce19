"""A path is proven as a whole: nothing is missed between samples."""

import numpy as np
import pytest

from armguard import bay_scene
from armguard.errors import SceneError
from armguard.geometry import Box, Pose, Sphere
from armguard.guard.continuous import RESOLUTION, check_path
from armguard.respond import Guard
from armguard.scene import Scene, two_pandas_scene
from arms import simple_arm
from grippers import Loop, guard_of, pick_scene
from sliding import APART, at_gap, slides


def wire_scene(thickness=0.001):
    """An arm, and a thin plate across its way."""
    scene = Scene(mode="fixed", buffer=0.0)
    arm = simple_arm(1, length=1.0, radius=0.01)
    scene.add_robot(arm, name="arm", home={"joint1": -1.0})
    scene.add(
        Box(size=(0.1, 2 * thickness, 0.6)),
        name="plate",
        pose=Pose(xyz=(0.8, 0.0, 0.2)),
    )
    return scene


@pytest.fixture(scope="module")
def wire():
    return Guard(wire_scene())


def test_a_thin_plate_between_two_samples_is_found(wire):
    ends = np.array([[-0.5], [0.5]])
    assert all(wire.judge_at_rest(q).nearest is None for q in ends)
    found = wire.check_path(ends)
    assert not found.clear
    # The rod is 10 mm thick, the plate 1 mm, at up to 0.85 m.
    first = -np.arctan2(0.011, 0.75)
    assert found.breach.q[0] == pytest.approx(first, abs=5e-3)
    assert found.breach.pair.b == "plate"
    assert found.breach.certain
    assert "plate" in found.sentence


def test_the_same_by_steps_would_miss_it(wire):
    """A dozen samples, as a path has them; the check judged the lines between."""
    steps = np.linspace(-0.5, 0.5, 12)[:, None]
    assert all(wire.judge_at_rest(q).nearest is None for q in steps)
    assert not wire.check_path(steps).clear


def test_a_path_that_just_passes_is_clear(wire):
    low = -np.arctan2(0.012, 0.74) - 0.01
    assert wire.check_path(np.array([[-1.5], [low]])).clear


def test_random_lines_agree_with_dense_samples():
    guard = Guard(bay_scene())
    rng = np.random.default_rng(3)
    lower, upper = guard.tables.lower, guard.tables.upper
    clear = 0
    for _ in range(150):
        start = np.clip(guard.home + rng.uniform(-0.5, 0.5, 14), lower, upper)
        end = np.clip(start + rng.uniform(-0.3, 0.3, 14), lower, upper)
        found = guard.check_path([start, end])
        shares = np.linspace(0.0, 1.0, 60)
        broken = [
            s
            for s in shares
            if any(
                p.headroom < 0.0
                for p in guard.judge_at_rest(start + s * (end - start)).near
            )
        ]
        if found.clear:
            clear += 1
            assert not broken
        else:
            assert not broken or found.breach.share <= broken[0]
            assert found.breach.share >= 0.0
    assert 10 < clear < 150


@pytest.mark.parametrize(("gap", "clear"), [(0.0051, True), (0.0049, False)])
def test_what_moves_is_taken_to_be_where_it_was_seen(gap, clear):
    guard = slides({}, mover={"top_speed": 0.5}, buffer=0.005)
    guard.place("ball", Pose(xyz=(APART, 0.0, 0.0)), stamp=0.0)
    # It may have come 10 cm nearer since.
    guard.step(at_gap(1.0), 0.2, velocity=[0.0], now=0.2)
    assert guard.check_path([at_gap(1.0), at_gap(gap)]).clear == clear


def test_a_path_leaves_the_loop_as_it_was(wire):
    q = np.array([-0.3])
    before = wire.step(q).tobytes()
    wire.check_path(np.array([[-0.5], [0.5]]))
    assert wire.step(q).tobytes() == before


@pytest.mark.parametrize("rows", [[[0.0, 1.0]], [[np.nan]], [0.0, 1.0, 2.0]])
def test_a_path_of_the_wrong_shape_is_refused(wire, rows):
    with pytest.raises(SceneError, match="path needs rows"):
        wire.check_path(rows)


def by_guard_alone(guard, rows):
    """The check of a path without the checker of batches."""
    none = np.zeros(len(rows) - 1, dtype=bool)
    return check_path(rows, guard._judge_line, RESOLUTION, none)


def assert_same_answer(found, right):
    assert found.clear == right.clear
    if right.clear:
        return
    for name in ("segment", "share", "certain"):
        assert getattr(found.breach, name) == getattr(right.breach, name)
    np.testing.assert_array_equal(found.breach.q, right.breach.q)
    assert found.breach.pair.to_dict() == right.breach.pair.to_dict()


def walks(guard, count, lines=40, step=0.02):
    """Paths about home of short lines, that turn at random."""
    rng = np.random.default_rng(8)
    lower, upper = guard.tables.lower, guard.tables.upper
    for _ in range(count):
        turns = rng.normal(0.0, step, (lines, len(lower))).cumsum(axis=0)
        rows = guard.home + np.cumsum(turns, axis=0) * 0.3
        yield np.clip(rows, lower, upper)


@pytest.mark.parametrize("make", [bay_scene, two_pandas_scene])
def test_a_long_path_has_the_answer_of_the_guard_alone(make):
    guard = Guard(make(), self_test=False)
    clear = 0
    for rows in walks(guard, 60):
        right = by_guard_alone(guard, rows)
        assert_same_answer(guard.check_path(rows), right)
        clear += right.clear
    assert 5 < clear < 55


def test_lines_that_the_checker_proves_are_not_judged_again(wire, monkeypatch):
    judged = []
    judge = wire._judge_line
    monkeypatch.setattr(
        wire, "_judge_line", lambda *line: judged.append(line) or judge(*line)
    )
    rows = np.linspace(-1.4, -0.5, 41)[:, None]
    assert wire.check_path(rows).clear
    assert not judged
    assert not wire.check_path(np.linspace(-1.4, 0.5, 41)[:, None]).clear
    # Those before the plate are proven, and the first that is not is bisected.
    assert 10 < len(judged) < 40


@pytest.fixture
def ball_beside():
    """A guard of an arm of one joint, and an absent ball."""
    scene = Scene(mode="fixed", buffer=0.0)
    scene.add_robot(simple_arm(1, length=1.0, radius=0.01), name="arm")
    scene.add(Sphere(radius=0.05), name="ball", present=False)
    return Guard(scene, self_test=False)


# Rows of a path of many lines past the front of that arm.
SWEEP = np.linspace(-0.5, 0.5, 41)[:, None]


def test_a_long_path_meets_objects_where_they_are_now(ball_beside):
    guard = ball_beside
    first = guard.checkpoint()
    assert guard.check_path(SWEEP).clear
    guard.place("ball", Pose(xyz=(0.8, 0.0, 0.2)))
    before = guard.checkpoint()
    assert not guard.check_path(SWEEP).clear
    guard.place("ball", Pose(xyz=(1.1, 0.0, 0.2)))
    assert guard.check_path(SWEEP).clear
    guard.place("ball", Pose(xyz=(1.1, 0.0, 0.2)), shape=Sphere(radius=0.15))
    assert not guard.check_path(SWEEP).clear
    guard.remove("ball")
    assert guard.check_path(SWEEP).clear
    guard.place("ball", Pose(xyz=(1.4, 0.0, 0.2)))
    assert guard.check_path(SWEEP).clear
    guard.restore(before)
    assert not guard.check_path(SWEEP).clear
    guard.place("ball", Pose(xyz=(1.4, 0.0, 0.2)))
    guard.restore(first)
    assert guard.check_path(SWEEP).clear


def test_an_object_is_back_at_its_place_in_the_scene():
    guard = Guard(wire_scene(), self_test=False)
    first = guard.checkpoint()
    guard.place("plate", Pose(xyz=(0.8, 0.0, 2.0)))
    assert guard.check_path(SWEEP).clear
    guard.restore(first)
    assert not guard.check_path(SWEEP).clear


@pytest.mark.parametrize("figure", [{"model_error": 0.01}, {"base_error": 0.01}])
@pytest.mark.parametrize(("gap", "clear"), [(0.0151, True), (0.0149, False)])
def test_a_long_path_keeps_the_static_errors_too(figure, gap, clear):
    guard = slides(figure, buffer=0.005)
    rows = np.linspace(at_gap(1.0), at_gap(gap), 41)
    assert guard.check_path(rows).clear == clear


def at(guard, q, **positions):
    """Joint positions, some of them others."""
    found = q.copy()
    for name, value in positions.items():
        found[guard.q_names.index(f"arm/{name}")] = value
    return found


def test_a_long_path_minds_what_is_held_and_where_it_was_released():
    loop = Loop(guard_of(pick_scene()))
    guard, fingers = loop.guard, ("arm/open_left", "arm/open_right")
    free = np.linspace(loop.q, at(guard, loop.q, x=0.2), 41)
    assert guard.check_path(free).clear
    assert loop.go({"arm/z": 0.1}, speed=0.08)
    assert loop.go(dict.fromkeys(fingers, 0.02), speed=0.02)
    guard.grasp("arm", "block")
    assert loop.go({"arm/z": 0.4}, speed=0.1)
    # The block reaches 10 mm below the fingers: only it comes too near to the table.
    lowered = np.linspace(loop.q, at(guard, loop.q, z=0.098), 41)
    assert not guard.check_path(lowered).clear
    assert_same_answer(guard.check_path(lowered), by_guard_alone(guard, lowered))
    assert loop.go({"arm/x": 0.3})
    assert loop.go({"arm/z": 0.1}, speed=0.08)
    guard.release("arm", "block")
    assert loop.go(dict.fromkeys(fingers, 0.04), speed=0.02)
    assert loop.go({"arm/z": 0.4}, speed=0.1)
    for x, clear in ((0.0, True), (0.3, False)):
        above = at(guard, loop.q, x=x, open_left=0.01, open_right=0.01)
        rows = np.linspace(above, at(guard, above, z=0.13), 41)
        assert guard.check_path(rows).clear == clear
        assert_same_answer(guard.check_path(rows), by_guard_alone(guard, rows))
