"""Remembered planes save work and change no answer."""

import numpy as np
import pytest

from armguard.geometry import Cone, Cylinder, Ellipsoid, Hull, Pose
from armguard.geometry.shapes.row import shape_row
from armguard.guard.planes import PLANE_COUNT, is_apart, remember_plane
from armguard.kernel import kernel
from armguard.respond import Guard
from armguard.scene import Scene
from armguard.scene.trajectory import densify
from arms import simple_arm
from records import record


@kernel(entry=True)
def proves(look, w, witness):
    remember_plane(0, 1, w, witness)
    return is_apart(0, 1, look, w)


@pytest.mark.parametrize("far", [0.0, 1e3, 1e6])
def test_a_plane_proves_nothing_that_round_off_might_have_made(far):
    """Two cylinders 2 m apart, each of them so far from the origin."""
    shape, radius = Cylinder(radius=0.05, height=0.2), 0.05
    for a, b in ((-1.0 - far, 1.0 - far), (-1.0 - far, 1.0 + far)):
        rows = [shape_row(shape, Pose(xyz=(x, 0.0, 0.0)).matrix()) for x in (a, b)]
        w = record(
            world=record(kinds=np.full(2, int(shape.kind)), rows=np.array(rows)),
            planes=np.zeros(PLANE_COUNT, dtype=np.int64),
            normals=np.zeros((PLANE_COUNT, 3)),
        )
        witness = np.zeros(10)
        witness[7] = 1.0
        gap = b - a - 2.0 * radius
        # As a share of all the numbers it is made of.
        doubt = 1e-13 * (gap + abs(a) + abs(b))
        assert not proves(gap - 0.8 * doubt, w, witness)
        assert proves(gap - 1.2 * doubt, w, witness)


def crowded_scene():
    """An arm among forty shapes that only the convex solver can measure."""
    rng = np.random.default_rng(3)
    scene = Scene(mode="fixed", margin=0.04)
    scene.add_robot(simple_arm(joints=3), name="arm")
    corners = rng.uniform(-0.08, 0.08, (12, 3))
    shapes = (
        Cylinder(radius=0.05, height=0.2),
        Cone(radius=0.08, height=0.15),
        Ellipsoid(semi_axes=(0.1, 0.05, 0.03)),
        Hull(points=corners),
    )
    for k in range(40):
        turn = tuple(rng.uniform(-3, 3, 3))
        angle, reach = rng.uniform(0.3, 6.0), rng.uniform(0.3, 1.2)
        at = (reach * np.cos(angle), reach * np.sin(angle), rng.uniform(0.1, 0.7))
        shape = shapes[k % 4]
        scene.add(shape, name=f"thing{k}", pose=Pose(xyz=at, rpy=turn))
    return scene


def test_what_is_remembered_saves_measuring_and_changes_no_bit():
    scene = crowded_scene()
    guard, forgetful = Guard(scene), Guard(scene)
    rng = np.random.default_rng(1)
    goals = rng.uniform(guard.tables.lower, guard.tables.upper, (12, 3))
    saved = measured = anew = near = 0
    for q in densify(np.vstack([guard.home, goals]), 2e-3):
        verdict = guard.step(q)
        forgetful._workspace.planes[:] = 0
        plain = forgetful.step(q)
        assert verdict.tobytes() == plain.tobytes()
        assert plain.counts.pairs_apart == 0
        saved += verdict.counts.pairs_apart
        measured += verdict.counts.pairs_tested
        anew += plain.counts.pairs_tested
        near += len(verdict.near)
    assert measured + saved == anew
    assert near > 1000
    assert saved > 3 * (measured - near)
