"""What operators mean to grip succeeds; what they do not mean is never touched."""

import numpy as np
import pytest

from armguard.geometry import Box, Cylinder, Pose
from armguard.respond import Guard
from armguard.scene import Scene
from episodes.records import Records
from gripping.panda import (
    BASE,
    HAND,
    PANDA,
    POSTURE,
    SIGHT,
    PandaArm,
    PandaJudge,
    scene_of_panda,
)
from gripping.unintended import (
    KINDS,
    SPEEDS,
    Accident,
    Unguarded,
    carry_out,
    drawn_place,
)
from gripping.workplace import Workplace, box, cylinder, gaps
from gripping_campaign import CAMPAIGN, EXTREME, is_broken, summed_up
from peers.shapes import coal_pair


def test_a_sample_of_objects_that_are_picked_and_placed():
    found = summed_up("placing", list(CAMPAIGN.run("placing", range(6))))
    assert found["certified"] == found["episodes"] == 6
    assert found["grasps_done"] == found["placements_done"] == 6
    assert not is_broken(found)
    assert found["least_not_meant_mm"] >= 5.0


def test_a_panda_picks_and_places():
    found = summed_up("panda", list(CAMPAIGN.run("panda", range(2))))
    assert found["certified"] == found["episodes"] == 2
    assert found["grasps_done"] == found["placements_done"] == 2
    assert not is_broken(found)
    assert found["least_not_meant_mm"] >= 5.0


def test_a_sample_of_operators_who_change_their_minds():
    found = summed_up("changing", list(CAMPAIGN.run("changing", range(6))))
    assert found["episodes"] == 6
    assert found["changes_of_mind"] > 20
    assert found["things_touched_as_meant"] > 0
    assert not is_broken(found)
    assert found["least_not_meant_mm"] >= 5.0


def test_unintended_grasps_are_held_back():
    """One of each kind; without a guard each of them touches something."""
    episodes = list(CAMPAIGN.run("unintended", range(6)))
    found = CAMPAIGN.figures_of("unintended", episodes)
    assert not found["left_out"]
    assert found["of_each"] == dict.fromkeys(sorted(KINDS), 1)
    assert not is_broken(found)


def test_an_accident_without_a_guard_is_seen_by_the_judge():
    for seed in range(6):
        kind = KINDS[seed]
        rng = np.random.default_rng(seed)
        place = drawn_place(kind, rng)
        guard = Unguarded(Guard(place.scene(), self_test=False))
        accident = Accident(kind, SPEEDS[kind][1], False)
        picker = carry_out(accident, place, guard, seed)
        assert picker.judge.findings.touched, kind


def test_the_same_seed_gives_the_same_episode():
    one, other = (next(CAMPAIGN.run("changing", [3])) for _ in range(2))
    del one["worked_s"], other["worked_s"]
    assert one == other


def solid_and_shape(rng):
    """A solid of the judge, and the same as a shape."""
    at = rng.uniform(-0.05, 0.05, 3)
    half = rng.uniform(0.01, 0.05, 3)
    if rng.random() < 0.5:
        return box(half, at), Box(size=tuple((2.0 * half).tolist()))
    radius, half_height = float(half[0]), float(half[2])
    shape = Cylinder(radius=radius, height=2.0 * half_height)
    return cylinder(radius, half_height, at), shape


@pytest.mark.parametrize("seed", range(3))
def test_the_judge_sees_the_same_distances_as_coal(seed):
    rng = np.random.default_rng(seed)
    seen = {True: 0, False: 0}
    for _ in range(200):
        (a, shape_a), (b, shape_b) = solid_and_shape(rng), solid_and_shape(rng)
        T_a, T_b = np.eye(4), np.eye(4)
        T_a[:3, 3], T_b[:3, 3] = a.at, b.at
        pair = coal_pair(shape_a, T_a, shape_b, T_b)
        theirs = pair.functor(pair.T_a, pair.T_b, pair.request, pair.result)
        ours = float(gaps(a, b))
        seen[ours > 0.0] += 1
        assert (ours > 0.0) == (theirs > 0.0)
        if ours > 0.0:
            assert ours == pytest.approx(theirs, abs=1e-6)
    assert min(seen.values()) > 20


def test_the_judge_has_the_hand_of_a_panda_where_the_guard_has_it():
    scene = Scene(mode="fixed")
    scene.add_robot("panda", name="arm", base=Pose(xyz=BASE))
    guard = Guard(scene, self_test=False)
    arm = PandaArm(scene.robots["arm"].model, {})
    frame = guard.tables.links[f"arm/{HAND}"]
    rng = np.random.default_rng(1)
    for k in range(20):
        q = np.array([*rng.uniform(*arm.limits), rng.uniform(0.0, 0.04)])
        guard.step(q, float(k))
        T = np.eye(4)
        T[:3] = guard._workspace.T_world[frame.body].reshape(3, 4)
        assert arm.hand(q) == pytest.approx(T @ frame.T_body_link, abs=1e-9)


def test_the_judge_of_a_panda_sees_what_a_finger_is_over():
    # A block straight under the fingers' tips, and nothing else near the arm.
    panda = scene_of_panda().robots["arm"].model
    q = np.array([*POSTURE, 0.03])
    x, y, z = PandaArm(panda, {}).hand(q)[:3, 3]
    for under in (0.01, -0.001):
        top = z - PANDA.tips - under
        block = box((0.05, 0.08, 0.02), (x, y, top - 0.02))
        place = Workplace({"block": block}, {}, "deflect", "octree", True, np.zeros(5))
        judge = PandaJudge(place, PandaArm(panda, place.objects))
        found = {pair: d for pair, d in judge.near(q).items() if d < SIGHT}
        assert set(found) == {("left", "block"), ("right", "block")}
        assert list(found.values()) == pytest.approx([under, under], abs=3e-4)


def test_an_episode_in_which_something_was_touched_breaks_the_promise():
    episodes = list(CAMPAIGN.run("changing", [0]))
    assert not is_broken(summed_up("changing", episodes))
    episodes[0]["touched"] = [("hand", "thing00", 17)]
    assert is_broken(summed_up("changing", episodes))


def test_what_was_run_is_known_and_not_run_again(tmp_path):
    path = tmp_path / "found.json"
    episodes = list(CAMPAIGN.run("changing", range(4)))
    records = Records(path, lambda kind: f"{kind} 1", EXTREME)
    assert list(records.todo("changing", 0, 4)) == [0, 1, 2, 3]
    records.add("changing", CAMPAIGN.figures_of("changing", episodes[:1]))
    records.add("changing", CAMPAIGN.figures_of("changing", episodes[2:]))
    again = Records(path, lambda kind: f"{kind} 1", EXTREME)
    assert list(again.todo("changing", 0, 6)) == [1, 4, 5]
    found = again.add("changing", CAMPAIGN.figures_of("changing", episodes[1:2]))
    whole = CAMPAIGN.figures_of("changing", episodes)
    for key in ("simulated_s", "worked_s"):
        assert found.pop(key) == pytest.approx(whole.pop(key))
    assert found.pop("version") == "changing 1" and found.pop("kernels")
    assert found == whole
    # With other kernels all of them are to be run again, and nothing is mixed.
    other = Records(path, lambda kind: f"{kind} 2", EXTREME)
    assert list(other.todo("changing", 0, 2)) == [0, 1]
    found = other.add("changing", CAMPAIGN.figures_of("changing", episodes[:1]))
    assert found["episodes"] == 1


def test_two_campaigns_that_run_at_once_lose_nothing_of_each_other(tmp_path):
    path = tmp_path / "found.json"
    one, other = (Records(path, lambda kind: f"{kind} 1", EXTREME) for _ in range(2))
    episodes = list(CAMPAIGN.run("changing", range(3)))
    one.add("changing", CAMPAIGN.figures_of("changing", episodes[:1]))
    other.add("placing", CAMPAIGN.figures_of("changing", episodes[:1]))
    found = other.add("changing", CAMPAIGN.figures_of("changing", episodes[1:2]))
    assert found["episodes"] == 2
    one.add("changing", CAMPAIGN.figures_of("changing", episodes[2:]))
    # What both ran counts once.
    other.add("changing", CAMPAIGN.figures_of("changing", episodes[1:]))
    kinds = Records(path, lambda kind: f"{kind} 1", EXTREME).kinds
    assert kinds["changing"]["episodes"] == 3
    assert kinds["placing"]["episodes"] == 1
