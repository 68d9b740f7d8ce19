"""Objects come, go and stand elsewhere while the guard runs."""

import subprocess
import sys

import numpy as np
import pytest

from armguard.errors import (
    HomeContactError,
    PoseError,
    SceneError,
    UnknownNameError,
)
from armguard.geometry import Box, Capsule, Cone, Hull, Pose, Sphere
from armguard.guard import Level
from armguard.index import Octree
from armguard.respond import Guard
from armguard.scene import Scene
from armguard.scene.settings import IndexSettings
from arms import simple_arm

TETRAHEDRON = [(0, 0, 0), (0.2, 0, 0), (0, 0.2, 0), (0, 0, 0.2)]
MESH = ([(0, 0, 0), (0.3, 0, 0), (0, 0.3, 0), (0.3, 0.3, 0.1)], [(0, 1, 2), (1, 3, 2)])


def workshop(kind="octree", poses=None):
    """An arm and six objects; those without a pose are not present."""
    scene = Scene(mode="fixed", index=IndexSettings(kind=kind))
    scene.add_robot(simple_arm(joints=3), name="arm")
    for name, shapes in {
        "ball": Sphere(radius=0.1),
        "crate": Box(size=(0.2, 0.4, 0.2), rounding=0.02),
        "rod": Capsule(start=(0, 0, -0.2), end=(0, 0, 0.2), radius=0.03),
        "horn": Cone(radius=0.1, height=0.2),
        "wedge": Hull(points=TETRAHEDRON),
    }.items():
        add(scene.add, shapes, name, poses)
    add(scene.add_mesh, MESH, "sheet", poses)
    return scene


def add(how, what, name, poses):
    pose = None if poses is None else poses.get(name)
    how(what, name=name, pose=pose, present=pose is not None)


def random_pose(rng):
    x, y, z = rng.uniform((-0.5, -0.5, 0.1), (0.7, 0.5, 0.7))
    return Pose(xyz=(x, y, z), rpy=tuple(rng.uniform(-3, 3, 3)))


@pytest.mark.parametrize("kind", ["octree", "joint_table", "brute_force"])
def test_whatever_came_and_went_the_verdict_is_that_of_a_fresh_guard(kind):
    rng = np.random.default_rng(2)
    guard = Guard(workshop(kind))
    poses, near = {}, 0
    for step in range(120):
        for _ in range(rng.integers(1, 4)):
            name = rng.choice(list(guard.tables.standing))
            if name in poses and rng.random() < 0.4:
                guard.remove(name)
                del poses[name]
            else:
                poses[name] = random_pose(rng)
                guard.place(name, poses[name])
        q = rng.uniform(guard.tables.lower, guard.tables.upper)
        for row in (q, q + 1e-3, q + 1e-3):
            verdict = guard.step(row)
        near += len(verdict.near)
        if step % 10 == 0:
            guard.index.check()
            fresh = unchecked_home(workshop(kind, poses))
            assert fresh.step(row).tobytes() == verdict.tobytes()
    assert near > 100


def unchecked_home(scene):
    """A guard of a scene whose objects may overlap the arm at home."""
    everyone = {name: item.present for name, item in scene.objects.items()}
    poses = {name: item.pose for name, item in scene.objects.items()}
    guard = Guard(workshop(scene.index.kind))
    for name, present in everyone.items():
        if present:
            guard.place(name, poses[name])
    return guard


def test_a_fresh_guard_with_the_objects_from_the_start_says_the_same():
    poses = {"ball": Pose(xyz=(0.1, 0.35, 0.2)), "sheet": Pose(xyz=(0.2, 0.4, 0.55))}
    one, two = Guard(workshop(poses=poses)), unchecked_home(workshop(poses=poses))
    rng = np.random.default_rng(4)
    stops = 0
    for _ in range(300):
        q = rng.uniform(one.tables.lower, one.tables.upper)
        verdict = one.step(q)
        stops += verdict.level is Level.STOP
        assert verdict.tobytes() == two.step(q).tobytes()
    assert stops > 10


def test_far_outside_the_cube_and_back():
    guard = Guard(workshop())
    clear = guard.step(guard.home).tobytes()
    guard.place("ball", Pose(xyz=(0, 0, 0.2)))
    assert guard.step(guard.home).level is Level.STOP
    for away in (10.0, 1e3, 1e6):
        guard.place("ball", Pose(xyz=(0, 0, away)))
        guard.index.check()
        assert guard.step(guard.home).tobytes() == clear
    guard.place("ball", Pose(xyz=(0, 0, 0.2)))
    assert guard.step(guard.home).level is Level.STOP
    guard.remove("ball")
    guard.remove("ball")
    assert guard.step(guard.home).tobytes() == clear


def test_coming_and_going_leaks_nothing():
    guard = Guard(workshop())
    rng = np.random.default_rng(0)
    names = list(guard.tables.standing)
    for _ in range(200):
        guard.place(rng.choice(names), random_pose(rng))
    before = guard.index.nbytes
    for _ in range(3000):
        name = rng.choice(names)
        guard.place(name, random_pose(rng))
        guard.remove(rng.choice(names))
    guard.index.check()
    assert guard.index.nbytes == before


def test_what_cannot_be_placed_is_refused():
    guard = Guard(workshop())
    with pytest.raises(UnknownNameError, match="did you mean 'ball'"):
        guard.place("bal", Pose())
    with pytest.raises(UnknownNameError, match="no fixed object"):
        guard.remove("arm/link1")
    with pytest.raises(PoseError, match="not finite"):
        guard.place("ball", np.full((4, 4), np.nan))
    with pytest.raises(PoseError, match="no rigid transform"):
        guard.place("ball", np.diag([2.0, 1.0, 1.0, 1.0]))
    scene = workshop()
    with pytest.raises(SceneError, match="only a stationary object can be added later"):
        scene.add(
            Sphere(radius=0.1), name="tool", attached_to="arm/link1", present=False
        )


def test_the_file_knows_objects_that_come_later(tmp_path):
    from armguard.scene import load_scene

    path = tmp_path / "scene.yaml"
    path.write_text(
        "mode: fixed\nrobots: {arm: {urdf: panda}}\n"
        "objects: {cup: {sphere: {radius: 0.05}, present: false}}\n"
    )
    scene = load_scene(path)
    assert not scene.objects["cup"].present
    guard = Guard(scene)
    assert guard.step(guard.home).level is Level.CLEAR


@pytest.mark.parametrize("kind", ["octree", "joint_table", "brute_force"])
def test_an_object_takes_another_shape_of_its_kind(kind):
    rng = np.random.default_rng(4)
    guard = Guard(workshop(kind))
    shapes = {"ball": None, "crate": None, "rod": None}
    poses, near = {}, 0
    for _ in range(100):
        name = str(rng.choice(list(shapes)))
        size = rng.uniform(0.02, 0.2, 3)
        shapes[name] = {
            "ball": Sphere(radius=size[0]),
            "crate": Box(size=tuple(2.0 * size), rounding=0.01),
            "rod": Capsule(start=(0, 0, -size[0]), end=(0, 0, size[1]), radius=0.04),
        }[name]
        poses[name] = random_pose(rng)
        guard.place(name, poses[name], shape=shapes[name])
        fresh = Scene(mode="fixed", index=IndexSettings(kind=kind))
        fresh.add_robot(simple_arm(joints=3), name="arm")
        for other, pose in poses.items():
            fresh.add(shapes[other], name=other, pose=pose)
        q = rng.uniform(guard.tables.lower, guard.tables.upper)
        found = {(p.a, p.b): p.distance for p in guard.step(q).near}
        try:
            expected = {(p.a, p.b): p.distance for p in Guard(fresh).step(q).near}
        except HomeContactError:
            continue
        assert found == expected
        near += len(found)
    assert near > 20
    if isinstance(guard.index, Octree):
        guard.index.check()


def test_a_shape_that_cannot_change_is_refused():
    guard = Guard(workshop())
    for name, shape in {
        "wedge": Hull(points=TETRAHEDRON),
        "ball": Box(size=(0.2, 0.2, 0.2)),
        "sheet": Sphere(radius=0.1),
    }.items():
        with pytest.raises(SceneError, match=f"'{name}' cannot change its shape"):
            guard.place(name, Pose(), shape=shape)
        assert name not in {p.b for p in guard.step(guard.home).near}


# Prints the kernels that are compiled or loaded by the first changes of a guard.
FIRST_CHANGES = """
import gc
from numba.core.registry import CPUDispatcher
from armguard import Guard, Pose, Sphere, bay_scene

def loaded():
    return {
        (d.py_func.__module__, d.py_func.__name__, str(s))
        for d in gc.get_objects() if isinstance(d, CPUDispatcher) for s in d.overloads
    }

scene = bay_scene()
scene.add(Sphere(radius=0.05), name="cart", present=False, top_speed=0.5)
guard = Guard(scene)
before = loaded()
guard.place("cart", Pose(xyz=(0.0, 0.0, 1.0)), 0.0)
guard.remove("cart")
print(*(loaded() - before), sep="\\n")
"""


def test_no_kernel_is_loaded_when_an_object_first_comes_or_goes():
    run = subprocess.run(
        [sys.executable, "-c", FIRST_CHANGES],
        capture_output=True,
        check=True,
        text=True,
    )
    assert not run.stdout.strip()
