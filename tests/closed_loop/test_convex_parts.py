"""Convex parts of meshes leave their dents free, and cover all of their surface."""

import numpy as np
import pytest
import trimesh
from scipy.spatial import ConvexHull

from closed_loop.judge_model import convex_parts


def table():
    """A plate on a column on a plate: what its hull fills is mostly air."""
    parts = [
        trimesh.creation.box((1.0, 0.8, 0.1)),
        trimesh.creation.box((0.2, 0.2, 0.9)),
        trimesh.creation.box((0.9, 0.9, 0.05)),
    ]
    for part, z in zip(parts, (0.05, 0.5, 0.95), strict=True):
        part.apply_translation((0.0, 0.0, z))
    return np.concatenate([part.triangles for part in parts])


def is_inside(points, vertices, room=1e-6):
    """Whether points are in the convex hull of vertices, or that near it."""
    faces = ConvexHull(vertices).equations
    return np.all(points @ faces[:, :3].T + faces[:, 3] <= room, axis=1)


def test_every_triangle_lies_in_one_part():
    triangles = table()
    parts = list(convex_parts(triangles))
    covered = np.zeros(len(triangles), dtype=bool)
    for part in parts:
        inside = is_inside(triangles.reshape(-1, 3), part)
        covered |= inside.reshape(-1, 3).all(axis=1)
    assert covered.all()


def test_what_is_beside_the_column_is_in_no_part():
    beside = np.array([[0.35, 0.3, 0.4], [-0.35, 0.0, 0.6], [0.0, 0.3, 0.5]])
    triangles = table()
    assert is_inside(beside, triangles.reshape(-1, 3)).all()
    for part in convex_parts(triangles):
        assert not is_inside(beside, part).any()


def test_a_convex_mesh_stays_whole():
    sphere = trimesh.creation.icosphere(subdivisions=2).triangles
    (part,) = convex_parts(sphere)
    assert len(part) == len(np.unique(sphere.reshape(-1, 3), axis=0))


def test_a_flat_mesh_becomes_a_thin_solid():
    corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]
    (part,) = convex_parts(np.array([corners]))
    assert ConvexHull(part).volume == pytest.approx(0.0, abs=1e-5)
    assert is_inside(np.array(corners), part).all()
