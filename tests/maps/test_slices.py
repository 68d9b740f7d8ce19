"""Slices of a robot's configurations, against samples of Coal."""

import numpy as np
import pytest

import armguard as ag
from armguard.maps.cell_plan import CoordinationError
from armguard.maps.slices import configuration_slice
from armguard.prove.tile_search import FREE, TOUCHING, UNKNOWN
from arms import simple_arm
from crossing import cell_of
from verifying.plans import World

JOINTS = ("left/joint1", "left/joint2")


@pytest.fixture(scope="module")
def world():
    scene = cell_of()
    ball = ag.Sphere(radius=0.2)
    scene.add(ball, name="ball", pose=ag.Pose(xyz=(0.3, 0.9, 0.2)))
    return World.of(scene)


def headrooms(world, rows):
    """Least distance above its buffer of any pair of the left arm, shape (k,) [m]."""
    oracle = world.oracle
    own = ["left/" in a + b for a, b in oracle.pairs]
    buffers = np.array([oracle.buffer(*pair) for pair in oracle.pairs])
    return (oracle.distances(rows) - buffers)[:, own].min(axis=1)


def labels_at(found, q):
    """Labels at positions of both joints, shape (k, 2)."""
    cells = ((q - found.lower) / found.step).astype(int)
    return found.labels[*cells.T]


def test_a_slice_is_what_samples_say_of_it(world):
    found = configuration_slice(world.scene, JOINTS)
    assert found.share(FREE) + found.share(TOUCHING) + found.share(UNKNOWN) == 1.0
    rng = np.random.default_rng(0)
    q = rng.uniform(found.lower, found.upper, (4000, 2))
    rows = np.tile(world.scene.home, (len(q), 1))
    rows[:, :2] = q
    gaps, labels = headrooms(world, rows), labels_at(found, q)
    assert (gaps[labels == FREE] >= -1e-7).all()
    # A cell at the edge of a forbidden tile has that label as well.
    assert (gaps[labels == TOUCHING] <= 0.02).all()
    assert (gaps[labels == TOUCHING] < 0.0).mean() > 0.95
    assert min((labels == FREE).sum(), (labels == TOUCHING).sum()) > 400
    assert (labels == UNKNOWN).mean() < 0.1


def test_what_is_free_with_a_joint_anywhere_is_free_for_all_its_positions():
    scene = ag.Scene(mode="fixed", buffer=0.01)
    scene.add_robot(simple_arm(), name="left")
    ball = ag.Sphere(radius=0.15)
    scene.add(ball, name="ball", pose=ag.Pose(xyz=(0.6, 0.5, 0.4)))
    world = World.of(scene)
    home = configuration_slice(scene, JOINTS)
    found = configuration_slice(scene, JOINTS, ["left/joint3"])
    assert 0.1 < found.share(FREE) < home.share(FREE) - 0.02
    assert found.share(TOUCHING) >= home.share(TOUCHING) - 0.01
    rng = np.random.default_rng(1)
    q = rng.uniform(found.lower, found.upper, (2000, 2))
    last = rng.uniform(-np.pi, np.pi, (len(q), 1)).clip(*limits_of(scene, "joint3"))
    labels = labels_at(found, q)
    gaps = headrooms(world, np.hstack((q, last)))
    assert (gaps[labels == FREE] >= -1e-7).all()
    assert "joint3 anywhere, the others at home" in found.sentence
    assert found.units == ("rad", "rad")


def limits_of(scene, joint):
    """Limits of a joint of the left arm [rad]."""
    limits = scene.robots["left"].model.joints[joint]
    return limits.lower, limits.upper


@pytest.mark.parametrize(
    ("joints", "anywhere", "words"),
    [
        (("left/joint1", "right/joint1"), [], "'right/joint1' is no joint of 'left'"),
        (JOINTS, ["left/joint2"], "'left/joint2' is named twice"),
        (("left/joint1", "left/joint7"), [], "'left/joint7' is no joint of 'left'"),
    ],
)
def test_joints_that_make_no_slice_are_refused(world, joints, anywhere, words):
    with pytest.raises(CoordinationError, match=words):
        configuration_slice(world.scene, joints, anywhere)


def test_no_more_than_two_joints_may_be_anywhere():
    others = [f"left/joint{k}" for k in (3, 4, 5)]
    with pytest.raises(CoordinationError, match="3 joints may be anywhere; give 2"):
        configuration_slice(ag.bay_scene(), JOINTS, others)
