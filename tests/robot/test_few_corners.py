"""Hulls with fewer corners hold the hulls they replace."""

import numpy as np
import pytest
import trimesh
from scipy.spatial import ConvexHull

from armguard.geometry import Box, Hull, PlacedShape, Pose
from armguard.robot.fitting.few_corners import FEW, GROWTH, with_few_corners


def ball():
    return trimesh.creation.icosphere(subdivisions=4, radius=0.05).vertices


def blades():
    """A thin rounded rim and a sharp edge, with noise below the growth."""
    rng = np.random.default_rng(3)
    angle = rng.uniform(0.0, 2.0 * np.pi, 3000)
    rim = np.column_stack([0.1 * np.cos(angle), 0.03 * np.sin(angle), 0.0 * angle])
    rim[:, 2] = rng.choice([-0.002, 0.002], len(rim))
    return np.vstack([rim + rng.normal(0.0, 2e-5, rim.shape), [[0.0, 0.0, 0.09]]])


@pytest.mark.parametrize("points", [ball(), blades()], ids=["ball", "blades"])
def test_the_new_hull_holds_the_old_one(points):
    """By support values: of random directions, and of the faces of both."""
    old = PlacedShape(Hull(points=points, rounding=0.003), Pose(), 0.001)
    new = with_few_corners(old)
    assert len(old.shape.vertices) > FEW
    assert len(new.shape.vertices) < 0.5 * len(old.shape.vertices)
    growth = new.shape.rounding - old.shape.rounding
    assert 0.0 < growth <= GROWTH
    assert new.model_error == old.model_error + growth
    directions = np.random.default_rng(0).normal(size=(20_000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    faces = [ConvexHull(s.shape.vertices).equations[:, :3] for s in (old, new)]
    lacking = []
    for along in (directions, *faces):
        before = (along @ old.shape.vertices.T).max(axis=1)
        after = (along @ new.shape.vertices.T).max(axis=1)
        lacking.append((before - after).max())
    assert max(lacking) <= growth
    # The growth is needed, and is little more than what is needed.
    assert max(lacking) > 0.5 * growth


def test_other_shapes_stay_as_they_are():
    few = PlacedShape(Hull(points=ball()[:FEW]), Pose(), 0.001)
    box = PlacedShape(Box(size=(0.1, 0.1, 0.1)), Pose(), 0.0)
    assert with_few_corners(few) is few
    assert with_few_corners(box) is box
