"""The guard: levels, reasons, names, and that nothing gets out of the loop."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from armguard.errors import HomeContactError, SceneError, UnknownNameError
from armguard.geometry import Box, Pose, Sphere
from armguard.guard import Level, Reason
from armguard.respond import Guard
from armguard.scene import Scene, bay_scene, bay_task
from armguard.scene.settings import IndexSettings
from arms import simple_arm, wall_scene
from sliding import RADIUS, slide


@pytest.fixture(scope="module")
def guard():
    return Guard(wall_scene())


def facing_wall(gap):
    """The joint angle that brings the first link's end this near to the wall [rad]."""
    return np.array([np.arcsin((0.5 - 0.04 - gap) / 0.4), 0.0, 0.0])


def test_far_away_is_clear():
    guard = Guard(wall_scene())
    verdict = guard.step(np.array([-0.5, -0.5, 0.0]))
    assert verdict.level is Level.CLEAR
    assert verdict.reason is Reason.OK
    assert verdict.nearest is None
    assert verdict.near == ()


def test_within_the_margin_is_caution_and_within_the_buffer_a_stop():
    scene = Scene(mode="fixed")
    scene.add_robot(simple_arm(joints=1, length=1.0), name="arm")
    scene.add(Sphere(radius=0.1), name="ball", pose=Pose(xyz=(0.5, 0.5, 0.2)))
    guard = Guard(scene)
    for gap, level, reason in (
        (0.060, Level.CLEAR, Reason.OK),
        (0.040, Level.CAUTION, Reason.NEAR),
        (0.031, Level.CAUTION, Reason.NEAR),
        (0.030, Level.STOP, Reason.TOO_CLOSE),
        (-0.05, Level.STOP, Reason.TOO_CLOSE),
    ):
        # The ball's centre is √½ away, in the direction of 45 degrees.
        angle = np.pi / 4 - np.arcsin((0.1 + 0.04 + gap) / np.sqrt(0.5))
        verdict = guard.step(np.array([angle]))
        assert (verdict.level, verdict.reason) == (level, reason), gap
        if verdict.nearest is not None:
            assert verdict.nearest.distance == pytest.approx(gap, abs=1e-12)
            assert verdict.nearest.headroom == pytest.approx(gap - 0.03048, abs=1e-12)


def test_a_wider_margin_reports_pairs_that_are_farther_apart():
    scene = wall_scene()
    q = np.array([-0.5, -0.5, 0.0])
    assert Guard(scene).step(q).nearest is None
    scene.set_margin(0.8)
    assert scene.margin == 0.8
    verdict = Guard(scene).step(q)
    assert verdict.level is Level.CAUTION
    assert 0.3 < verdict.nearest.distance <= 0.8
    scene.set_margin(None)
    assert Guard(scene).step(q).nearest is None
    with pytest.raises(SceneError, match="margin"):
        scene.set_margin(float("nan"))


def test_the_nearest_pair_has_names_points_and_words():
    scene = Scene(mode="fixed")
    scene.add_robot(simple_arm(joints=1, length=1.0), name="arm")
    scene.add(Sphere(radius=0.1), name="ball", pose=Pose(xyz=(0.5, 0.16, 0.2)))
    near = Guard(scene).step(np.zeros(1)).nearest
    assert (near.a, near.b) == ("arm/link1", "ball")
    assert near.distance == pytest.approx(0.02, abs=1e-12)
    assert near.point_a == pytest.approx([0.5, 0.04, 0.2])
    assert near.point_b == pytest.approx([0.5, 0.06, 0.2])
    assert near.normal == pytest.approx([0, 1, 0])
    assert near.why == "arm/link1 20 mm from ball: must keep 30 mm"


def test_a_buffer_of_its_own_and_a_pair_rule():
    scene = Scene(mode="fixed", buffer=0.01)
    scene.add_robot(simple_arm(joints=1, length=1.0), name="arm", buffer=0.02)
    scene.add(Sphere(radius=0.1), name="ball", pose=Pose(xyz=(0.5, 0.155, 0.2)))
    scene.add(Sphere(radius=0.1), name="other", pose=Pose(xyz=(0.8, 0.155, 0.2)))
    scene.set_buffer("arm", "other", 0.005)
    near = {pair.b: pair for pair in Guard(scene).step(np.zeros(1)).near}
    assert near["ball"].buffer == 0.02
    assert near["ball"].headroom == pytest.approx(-0.005)
    assert near["other"].buffer == 0.005
    assert near["other"].headroom == pytest.approx(0.01)


def test_an_allowed_pair_is_not_checked():
    scene = Scene(mode="fixed")
    scene.add_robot(simple_arm(joints=1, length=1.0), name="arm")
    scene.add(Sphere(radius=0.1), name="ball", pose=Pose(xyz=(0.5, 0.15, 0.2)))
    scene.allow("arm/link1", "ball", reason="the ball is soft")
    assert Guard(scene).step(np.zeros(1)).level is Level.CLEAR


def test_an_attached_object_rides_on_its_link():
    scene = Scene(mode="fixed")
    scene.add_robot(simple_arm(joints=1, length=1.0), name="arm")
    scene.add(
        Sphere(radius=0.05),
        name="cup",
        pose=Pose(xyz=(1.2, 0, 0)),
        attached_to="arm/link1",
    )
    scene.add(Sphere(radius=0.05), name="post", pose=Pose(xyz=(0, 1.2, 0.2)))
    guard = Guard(scene)
    assert guard.step(np.zeros(1)).level is Level.CLEAR
    near = guard.step(np.array([np.pi / 2])).nearest
    assert {near.a, near.b} == {"cup", "post"}
    assert near.distance == pytest.approx(-0.1, abs=1e-12)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("joint", [0, 2])
def test_a_joint_that_is_no_number_stops_with_its_name(guard, bad, joint):
    q = guard.home
    q[joint] = bad
    verdict = guard.step(q)
    assert verdict.level is Level.STOP
    assert verdict.reason is Reason.NOT_FINITE
    assert verdict.joint == f"arm/joint{joint + 1}"
    assert f"joint 'arm/joint{joint + 1}' is at {bad}" in verdict.why
    assert guard.step(guard.home).level is Level.CLEAR


def test_a_joint_outside_its_limits_stops_and_distances_are_still_reported(guard):
    verdict = guard.step(np.array([0.0, 2.5, 0.0]))
    assert verdict.reason is Reason.OUT_OF_LIMITS
    assert verdict.level is Level.STOP
    assert verdict.why == (
        "joint 'arm/joint2' is at 2.5000: stop, its limits are [-2.0000, 2.0000]; move "
        "the joint back inside by hand or with the robot's own controller, or check "
        "units and order"
    )
    inside = guard.step(np.array([2.1, 0.0, 0.0]))
    assert inside.reason is Reason.OUT_OF_LIMITS


class Hostile:
    """An object that raises whatever is asked of it."""

    def __array__(self, *args, **kwargs):
        raise RuntimeError("never mind")


@pytest.mark.parametrize(
    ("q", "says"),
    [
        (np.zeros(2), r"q has shape \(2,\); it must be 3 numbers"),
        (np.zeros((3, 1)), r"q has shape \(3, 1\)"),
        (1.0, r"q has shape \(\)"),
        ("left", "q is a str"),
        (None, "q"),
        ({"arm/joint1": 0.0}, "q names 'arm/joint1', no robot; known"),
        (Hostile(), "q is a Hostile"),
        ([[0.0], [0.0, 1.0]], "q is a list"),
        ([0.0, "x", 1.0], "q is a list"),
    ],
)
def test_what_is_no_joint_vector_stops_and_never_raises(guard, q, says):
    verdict = guard.step(q)
    assert verdict.level is Level.STOP
    if q is not None:
        assert verdict.reason is Reason.WRONG_INPUT
        import re

        assert re.search(says, verdict.why)
    assert guard.step(guard.home).level is Level.CLEAR


@pytest.mark.parametrize(
    "q",
    [
        [0.1, 0.2, 0.3],
        (0.1, 0.2, 0.3),
        np.array([0.1, 0.2, 0.3], dtype=np.float32),
        np.array([0.1, 0.0, 0.2, 0.0, 0.3])[::2],
        np.asfortranarray(np.array([[0.1, 0.2, 0.3]]))[0],
    ],
)
def test_other_ways_to_write_a_vector_are_taken(guard, q):
    assert guard.step(q).reason is Reason.OK


def test_positions_by_name(guard):
    q = guard.q({"arm/joint2": 0.5, "arm/joint1": 0.1, "arm/joint3": -0.2})
    assert q.tolist() == [0.1, 0.5, -0.2]
    with pytest.raises(UnknownNameError, match="did you mean 'arm/joint1'"):
        guard.q({"arm/jiont1": 0.0})
    with pytest.raises(UnknownNameError, match="missing for 'arm/joint3'"):
        guard.q({"arm/joint1": 0.0, "arm/joint2": 0.0})


def test_time_must_not_go_back(guard):
    guard.reset()
    assert guard.step(guard.home, stamp=1.0).reason is Reason.OK
    assert guard.step(guard.home, stamp=1.0).reason is Reason.OK
    for stamp in (0.5, float("nan"), "late"):
        verdict = guard.step(guard.home, stamp=stamp)
        assert verdict.reason is Reason.TIME_BACKWARDS
        assert verdict.level is Level.STOP
    assert guard.step(guard.home, stamp=1.1).reason is Reason.OK
    guard.reset()


def test_every_reason_has_a_sentence_and_only_three_are_no_stop():
    assert all(reason.sentence for reason in Reason)
    passing = {reason for reason in Reason if reason.level < Level.STOP}
    assert passing == {Reason.OK, Reason.NEAR, Reason.SHORT_TIME}


def test_the_page_of_concepts_has_every_reason_with_its_level():
    page = Path(__file__).parents[2].joinpath("docs/concepts.md").read_text("utf-8")
    rows = re.findall(r"^\| `([A-Z_]+)` \| ([A-Z_]+) \|", page, flags=re.MULTILINE)
    known = {(reason.name, reason.level.name) for reason in Reason}
    assert known <= set(rows)


def test_a_robot_that_overlaps_something_at_home_is_refused():
    scene = wall_scene()
    scene.add(Sphere(radius=0.2), name="ball", pose=Pose(xyz=(0.3, 0, 0.2)))
    with pytest.raises(HomeContactError, match="arm/link1 and ball by") as caught:
        Guard(scene)
    assert caught.value.contacts[0].b == "ball"
    assert "give another `home`" in str(caught.value)


def test_a_scene_without_a_robot_is_refused():
    with pytest.raises(SceneError, match="no robot"):
        Guard(Scene())


def test_a_verdict_is_a_snapshot():
    scene = Scene(mode="fixed")
    scene.add_robot(simple_arm(joints=1, length=1.0), name="arm")
    scene.add(Sphere(radius=0.1), name="ball", pose=Pose(xyz=(0.5, 0.155, 0.2)))
    guard = Guard(scene)
    first = guard.step(np.zeros(1))
    before = first.tobytes()
    guard.step(np.array([-1.0]))
    assert first.tobytes() == before
    assert first.level is Level.STOP


def test_more_near_pairs_than_there_is_room_for_is_a_stop(monkeypatch):
    import armguard.guard.answer as module

    monkeypatch.setattr(module, "NEAR_CAPACITY", 3)
    scene = Scene(mode="fixed")
    scene.add_robot(simple_arm(joints=1, length=1.0), name="arm")
    for k in range(8):
        at = (0.3 + 0.08 * k, 0.12, 0.2)
        scene.add(Sphere(radius=0.03), name=f"b{k}", pose=Pose(xyz=at))
    guard = Guard(scene)
    # Rows that are missing are not there to be kept for an arm at rest.
    for _ in range(2):
        verdict = guard.step(np.zeros(1))
        assert verdict.reason is Reason.CAPACITY
        assert verdict.level is Level.STOP
        assert len(verdict.near) == 3
    assert guard.step(np.array([-1.5])).reason is Reason.OK


def both_guards():
    octree, brute = bay_scene(), bay_scene()
    brute.index = IndexSettings(kind="brute_force")
    return Guard(octree), Guard(brute)


@pytest.mark.parametrize("task", [150, 700, 2000])
def test_octree_and_brute_force_say_the_same_over_a_task(task):
    octree, brute = both_guards()
    q = bay_task(task).for_scene(bay_scene())
    for row in q:
        assert octree.step(row).tobytes() == brute.step(row).tobytes()
    octree.index.check()


def test_jumps_leave_no_trace():
    """After any past the verdict is that of a fresh guard, to the last bit."""
    octree, _ = both_guards()
    rng = np.random.default_rng(0)
    low, high = octree.tables.lower, octree.tables.upper
    probes = rng.uniform(low, high, size=(40, len(low)))
    for _ in range(20):
        for row in rng.uniform(low, high, size=(50, len(low))):
            octree.step(row)
        octree.index.check()
        fresh = Guard(bay_scene())
        for row in probes[:4]:
            assert octree.step(row).tobytes() == fresh.step(row).tobytes()


def test_only_what_moves_is_looked_after():
    guard = Guard(bay_scene())
    q = guard.home
    guard.step(q)
    assert guard.step(q).counts.links_checked == 0
    q[13] += 1e-3
    counts = guard.step(q).counts
    assert (counts.bodies_moved, counts.links_checked) == (1, 1)
    q[0] += 1e-3
    assert guard.step(q).counts.links_checked == 7
    q += 1e-3
    assert guard.step(q).counts.links_checked == 14


def test_a_link_of_several_shapes_is_looked_after_once():
    model = slide()
    (ball,) = model.links["ball"].collisions
    link = replace(model.links["ball"], collisions=(ball, ball, ball))
    scene = Scene(mode="fixed")
    scene.add_robot(replace(model, links={**model.links, "ball": link}), name="slide")
    guard = Guard(scene)
    guard.step([0.0])
    assert guard.step([1e-3]).counts.links_checked == 1


def test_a_kept_pair_is_the_measured_pair():
    """Pairs that stood still keep their rows; a reset measures them anew."""
    task = bay_task(2000)
    q = task.for_scene(bay_scene())
    guard, anew = Guard(bay_scene()), Guard(bay_scene())
    kept = 0
    for row in q[::3]:
        verdict = guard.step(row)
        kept += verdict.counts.pairs_kept
        anew.reset()
        assert verdict.tobytes() == anew.step(row).tobytes()
    assert kept > 0


def test_kept_and_measured_pairs_are_in_order():
    """One ball rests beside another one, and a third one comes to it."""
    scene = Scene(mode="fixed", margin=0.1)
    for name, x in (("left", 0.0), ("right", 0.3)):
        scene.add_robot(slide(), name=name, base=Pose(xyz=(x, 0.0, 0.0)))
    scene.add(Sphere(radius=RADIUS), name="ball", pose=Pose(xyz=(0.0, 0.18, 0.0)))
    guard, anew = Guard(scene), Guard(scene)
    for place in (0.0, -0.11, -0.12):
        anew.reset()
        verdict = guard.step([0.0, place])
        assert verdict.tobytes() == anew.step([0.0, place]).tobytes()
        others = ["right/ball", "ball"] if place else ["ball"]
        assert [pair.b for pair in verdict.near] == others


def test_the_cycle_allocates_nothing():
    from numba.core.runtime import _nrt_python, rtsys

    _nrt_python.memsys_enable_stats()
    guard = Guard(bay_scene())
    q = bay_task(700).for_scene(bay_scene())
    nothing = np.full(14, np.nan)

    def allocations(rows):
        before = rtsys.get_allocation_stats().alloc
        for row in rows:
            guard.step(row)
        return rtsys.get_allocation_stats().alloc - before

    # Handing an array to compiled code allocates its header; a cycle that returns at
    # once does so too, and does nothing else.
    assert allocations(q) == allocations([nothing] * len(q))


def test_steps_compile_nothing():
    from armguard.guard.cycle import run_cycle

    guard = Guard(bay_scene())
    before = len(run_cycle.signatures)
    q = bay_task(150).for_scene(bay_scene())
    for row in q:
        guard.step(row)
        guard.step(row.astype(np.float32))
        guard.step(row.tolist())
    assert len(run_cycle.signatures) == before


def test_the_bay_has_the_papers_numbers():
    tables = Guard(bay_scene()).tables
    assert len(tables.kinds) == 35
    assert tables.moving_count == 14
    assert tables.buffers.max() == pytest.approx(1.2 * 0.0254)


def test_two_boxes_of_one_object_are_not_checked_against_each_other():
    scene = Scene(mode="fixed")
    scene.add_robot(simple_arm(), name="arm")
    block = Box(size=(0.2, 0.2, 0.2))
    scene.add([block, block], name="pile", pose=Pose(xyz=(0, -1.5, 0)))
    assert Guard(scene).home_verdict.level is Level.CLEAR
