"""Sightings of objects that cannot be true: each a stop that names the object."""

import numpy as np
import pytest

from armguard.errors import SceneError
from armguard.geometry import Box, Capsule, Hull, Pose, Sphere
from armguard.guard import Level, Reason
from armguard.guard.objects import SightingError
from armguard.respond import Guard
from armguard.scene import Scene
from armguard.scene.archive import archive_of, scene_of
from armguard.scene.file import load_scene
from sliding import APART, EXACT, at_gap, let_go, slides, worst_stop

PERIOD = 1e-3
TOP = 0.5
FAR = (APART, 5.0, 0.0)


def watched(**more):
    """A guard of a slide and a ball that moves, seen at 5 s."""
    guard = slides({"sensing": 0.002}, mover={"top_speed": TOP, **more}, period=PERIOD)
    let_go(guard)
    guard.place("ball", Pose(xyz=FAR), 5.0)
    assert cycle(guard, 5.001).reason is Reason.OK
    return guard


def cycle(guard, now):
    """Verdict of a cycle in which the slide rests."""
    return guard.step([-20.0], now - 0.0005, velocity=[0.0], now=now)


def at(x):
    """A pose so far from where the ball was seen first [m]."""
    return Pose(xyz=(FAR[0] + x, FAR[1], FAR[2]))


# What is seen next: pose, stamp, velocity; and the reason.
WRONG = {
    "before the last one": (at(0.0), 4.9, None, Reason.OBJECT_BACKWARDS),
    "twice at a time": (at(0.01), 5.0, None, Reason.OBJECT_REPEATED),
    "too far away": (at(7.0), 5.001, None, Reason.OBJECT_JUMPED),
    "just too far away": (at(0.0103 * TOP), 5.010, None, Reason.OBJECT_JUMPED),
    "too fast": (at(0.0), 5.001, (0.0, 0.6, 0.0), Reason.OBJECT_TOO_FAST),
    "a velocity that is NaN": (
        at(0.0),
        5.001,
        (np.nan, 0.0, 0.0),
        Reason.OBJECT_NOT_FINITE,
    ),
    "a pose that is NaN": (
        np.full((4, 4), np.nan),
        5.001,
        None,
        Reason.OBJECT_NOT_FINITE,
    ),
    "at a time that is NaN": (at(0.0), np.nan, None, Reason.OBJECT_NOT_FINITE),
}


@pytest.mark.parametrize("case", WRONG)
def test_a_wrong_sighting_is_refused_and_a_stop_until_one_is_believed(case):
    pose, stamp, velocity, reason = WRONG[case]
    guard = watched()
    before = guard.index.world.rows.copy()
    with pytest.raises(SightingError, match="object 'ball'") as error:
        guard.place("ball", pose, stamp, velocity=velocity)
    assert error.value.reason == reason.name
    assert (guard.index.world.rows == before).all()
    for k in range(2, 12):
        verdict = cycle(guard, 5.0 + k * PERIOD)
        assert verdict.reason is reason
        assert verdict.level is Level.STOP
        assert verdict.subject == "ball"
        assert verdict.why.startswith("'ball': stop, ")
    guard.place("ball", at(0.0), 5.011)
    assert cycle(guard, 5.012).reason is not reason


def test_right_sightings_are_believed():
    guard = watched()
    guard.place("ball", at(0.0099 * TOP), 5.010, velocity=(TOP, 0.0, 0.0))
    guard.place("ball", at(0.0099 * TOP), 5.010)
    assert guard._watch.doubt.max() == 0
    assert guard._watch.seen_at[guard._watch.movers[0]] == 5.010


def test_what_is_removed_may_come_back_anywhere():
    guard = watched()
    with pytest.raises(SightingError):
        guard.place("ball", at(7.0), 5.001)
    guard.remove("ball")
    assert cycle(guard, 5.002).reason is Reason.OK
    guard.place("ball", at(7.0), 5.0025)
    assert cycle(guard, 5.003).reason is Reason.OK


def test_after_a_reset_the_clock_may_begin_again():
    guard = watched()
    guard.reset()
    guard.place("ball", at(3.0), 0.0)
    assert cycle(guard, 0.001).reason is not Reason.OBJECT_BACKWARDS


@pytest.mark.parametrize("ahead", [0.5e-3, 1e3])
def test_a_sighting_from_the_future_is_a_stop(ahead):
    guard = watched()
    guard.place("ball", at(0.0), 5.002 + ahead)
    verdict = cycle(guard, 5.002)
    assert verdict.reason is Reason.OBJECT_AHEAD
    assert verdict.level is Level.STOP
    assert verdict.subject == "ball"


def test_without_a_time_of_the_cycle_objects_may_be_seen_a_little_later_than_robots():
    for late, reason in ((0.0019, Reason.OK), (0.0021, Reason.OBJECT_AHEAD)):
        guard = watched()
        guard.place("ball", at(0.0), 5.002 + late)
        verdict = guard.step([-20.0], 5.002, velocity=[0.0])
        assert verdict.reason is reason


def test_a_sighting_gets_too_old_where_it_is_declared_to():
    for share in (0.99, 1.01):
        guard = watched(stale=0.05)
        for k in range(2, 49):
            verdict = cycle(guard, 5.0 + k * PERIOD)
            assert verdict.reason is Reason.OK
        verdict = cycle(guard, 5.0 + share * 0.05)
        assert (verdict.reason is Reason.OBJECT_STALE) == (share > 1.0)


def test_an_error_of_what_is_seen_is_kept_and_allowed_for():
    error = 0.02
    guard = watched(error=error)
    guard.place("ball", at(0.01 * TOP + 2.0 * error - 1e-6), 5.010)
    with pytest.raises(SightingError):
        guard.place("ball", at(0.0), 5.011)
    need, _ = worst_stop({}, 0.0, PERIOD)
    for share, level in ((1.02, Level.STOP), (0.98, Level.STOP)):
        guard = slides({}, mover={"top_speed": TOP, "error": error}, period=PERIOD)
        guard.place("ball", Pose(xyz=(APART, 0.0, 0.0)), 5.0)
        let_go(guard)
        gap = share * (need + error + TOP * PERIOD)
        verdict = guard.step(at_gap(gap), 5.0, velocity=[0.0], now=5.0)
        assert (verdict.level < level) == (share > 1.0)


SHAPES = {
    "box": Box(size=(0.6, 0.2, 0.2)),
    "capsule": Capsule(start=(-0.3, 0, 0), end=(0.3, 0, 0), radius=0.02),
    "hull": Hull(points=[(0.3, 0, 0), (-0.3, 0, 0), (0, 0.1, 0), (0, 0, 0.1)]),
}


@pytest.mark.parametrize("kind", SHAPES)
def test_an_object_that_turns_too_fast_has_jumped_as_well(kind):
    scene = Scene(period=PERIOD)
    from arms import simple_arm

    scene.add_robot(simple_arm(joints=1), name="arm", stopping={**EXACT})
    scene.add(SHAPES[kind], name="rod", pose=Pose(xyz=(9.0, 0.0, 0.0)), top_speed=TOP)
    guard = Guard(scene, self_test=False)
    guard.place("rod", Pose(xyz=(9.0, 0.0, 0.0)), 5.0)
    # Its end goes 0.3 m times the angle; a fifth of what it may, and five times that.
    guard.place("rod", Pose(xyz=(9.0, 0.0, 0.0), rpy=(0.0, 0.0, 0.03)), 5.1)
    with pytest.raises(SightingError, match="top speed"):
        guard.place("rod", Pose(xyz=(9.0, 0.0, 0.0), rpy=(0.0, 0.0, 1.5)), 5.2)


def test_figures_of_sightings_go_through_files_and_archives(tmp_path):
    path = tmp_path / "scene.yaml"
    path.write_text(
        "mode: fixed\nrobots: {arm: {urdf: panda}}\nobjects:\n  cart:\n"
        "    sphere: {radius: 0.05}\n    at: {xyz: [2, 0, 0]}\n"
        "    top_speed: 0.5\n    error: 0.01\n    stale: 0.2\n"
    )
    scene = load_scene(path)
    for found in (scene, scene_of(archive_of(scene))):
        assert found.objects["cart"].error == 0.01
        assert found.objects["cart"].stale == 0.2
    with pytest.raises(SceneError, match="no top_speed"):
        Scene().add(Sphere(radius=0.1), name="cup", stale=1.0)
    with pytest.raises(SceneError, match="stale is 0"):
        Scene().add(Sphere(radius=0.1), name="cup", top_speed=1.0, stale=0.0)


def test_a_doubt_is_part_of_a_checkpoint():
    guard, other = watched(), watched()
    with pytest.raises(SightingError):
        guard.place("ball", at(7.0), 5.001)
    other.restore(guard.checkpoint())
    assert cycle(other, 5.002).reason is Reason.OBJECT_JUMPED
