"""A path is proven as a whole: nothing is missed between samples."""

import numpy as np
import pytest

from armguard import bay_scene
from armguard.errors import SceneError
from armguard.geometry import Box, Pose
from armguard.respond import Guard
from armguard.scene import Scene
from arms import simple_arm
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
