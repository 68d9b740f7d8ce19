"""Judges of true states, beside trigonometry and beside meshes as they are."""

import numpy as np
import pytest

from armguard.geometry import Pose, Sphere
from armguard.plans.coal_world import CoalWorld, checked_pairs
from armguard.scene import Scene, compile_scene
from armguard.simulation.judge import CheckerJudge, CoalJudge
from arms import simple_arm

BALL = np.array([0.25, 0.25])


def scene_of(buffer):
    """An arm of one capsule from 0.1 m to 0.4 m, and a ball beside it."""
    scene = Scene(mode="fixed", buffer=buffer)
    scene.add_robot(simple_arm(1), name="arm")
    scene.add(Sphere(radius=0.05), name="ball", pose=Pose(xyz=(*BALL, 0.2)))
    return scene


def gaps(turn):
    """Distance of the capsule from the ball at some angles [m]."""
    along = np.stack((np.cos(turn), np.sin(turn)), axis=-1)
    nearest = np.clip(along @ BALL, 0.1, 0.4)[..., None] * along
    return np.linalg.norm(nearest - BALL, axis=-1) - 0.04 - 0.05


@pytest.fixture(params=["coal", "checker"])
def judge_of(request):
    if request.param == "checker":
        return CheckerJudge
    pytest.importorskip("coal")
    return lambda scene: CoalJudge(compile_scene(scene))


def test_intervals_and_the_least_distance_are_those_of_trigonometry(judge_of):
    """The arm passes through the ball and comes back, in steps it is not seen in."""
    times = np.arange(5.0)
    turn = np.array([-1.0, 0.2, 1.4, 1.5, 0.3])
    fine = np.linspace(0.0, 4.0, 400_001)
    true = gaps(np.interp(fine, times, turn))
    found = judge_of(scene_of(0.02)).judge(times, turn[:, None])
    assert not found.clear and found.least.distance == pytest.approx(-0.09, abs=2e-3)
    assert {found.least.a, found.least.b} == {"arm/link1", "ball"}
    near = np.flatnonzero(np.diff(np.concatenate(([0], true < 0.02, [0]))))
    assert len(found.intervals) == len(near) // 2 == 2
    for one, (start, end) in zip(found.intervals, near.reshape(-1, 2), strict=True):
        # Ends are within a millisecond where a distance is proven, and else in a step.
        assert fine[start] - 2e-3 <= one.start <= fine[start] + 0.51
        assert fine[end - 1] - 0.51 <= one.end <= fine[end - 1] + 2e-3
        touches = fine[np.flatnonzero(true[start:end] < 0.0)[0] + start]
        assert touches - 2e-3 <= one.contact <= touches + 0.51
        assert one.buffer == 0.02 and one.nearest.distance < -0.06


def test_a_motion_that_just_keeps_its_buffer_is_clear(judge_of):
    """The buffer counts, to a hundredth of a millimetre."""
    turn = np.linspace(-1.0, 0.1, 40)
    least = gaps(turn).min()
    times = np.arange(len(turn), dtype=float)
    clear = judge_of(scene_of(least - 2e-5)).judge(times, turn[:, None])
    assert clear.clear
    assert clear.least is None or clear.least.distance == pytest.approx(least, abs=1e-5)
    [near] = judge_of(scene_of(least + 2e-4)).judge(times, turn[:, None]).intervals
    assert near.contact is None and near.nearest.time == pytest.approx(39.0, abs=0.01)


def test_links_with_meshes_are_judged_by_their_hulls():
    """No farther apart than the meshes, which Pinocchio's own world measures."""
    pytest.importorskip("coal")
    from closed_loop.exact_world import ExactWorld

    scene = Scene(mode="path")
    scene.add_robot("panda", name="near", base=Pose(xyz=(-0.4, 0.0, 0.0)))
    scene.add_robot("panda", name="far", base=Pose(xyz=(0.4, 0.0, 0.0)))
    tables = compile_scene(scene)
    judge, meshes = CoalJudge(tables), ExactWorld(scene, tables)
    world, pairs = CoalWorld(tables, exact=True), checked_pairs(tables)
    rng, refined = np.random.default_rng(4), 0
    for _ in range(25):
        q = rng.uniform(tables.lower, tables.upper)
        found = judge.judge(np.array([0.0, 1.0]), np.array([q, q])).least
        true = float(meshes.distances(q).min())
        world.move(q)
        rough = min(world.distance(int(i), int(j)) for i, j in pairs)
        if found is None:
            assert true >= rough >= 0.05
            continue
        assert rough <= found.distance <= max(true, 0.0) + 1e-6
        # Primitives overlap where meshes are apart, and so are their hulls.
        if rough < 0.0 and true > 1e-3:
            assert found.distance > 0.0
            refined += 1
    assert refined == 2
