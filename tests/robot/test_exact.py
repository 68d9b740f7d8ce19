"""The exact stage of links: hulls that hold their meshes, and how far they reach."""

import numpy as np
import pytest
import trimesh

from armguard.robot import find_named_robot, load_urdf
from armguard.robot.fitting import fit_robot
from armguard.robot.fitting.exact import hull_faces
from armguard.robot.fitting.hull_reach import hull_reach
from armguard.robot.meshes import load_triangles
from armguard.robot.model import MeshFile


def links(name):
    model = load_urdf(find_named_robot(name).urdf)
    fits = fit_robot(model)
    for link in model.links.values():
        meshes = [e for e in link.collisions if isinstance(e.geometry, MeshFile)]
        if len(meshes) == 1:
            (hull,) = fits[link.name].exact
            yield load_triangles(meshes[0].geometry), hull


@pytest.mark.parametrize("name", ["panda", "ur5"])
def test_the_reach_of_a_hull_is_a_bound_and_a_tight_one(name):
    """Against points of the hull and their distance to the mesh, by trimesh."""
    checked = 0
    for triangles, hull in links(name):
        faces = hull_faces(hull.shape)
        corners = np.arange(3 * len(faces)).reshape(-1, 3)
        surface = trimesh.Trimesh(faces.reshape(-1, 3), corners, process=False)
        points = surface.sample(800, seed=1)
        corners = np.arange(3 * len(triangles)).reshape(-1, 3)
        mesh = trimesh.Trimesh(triangles.reshape(-1, 3), corners, process=False)
        _, apart, _ = trimesh.proximity.closest_point_naive(mesh, points)
        assert apart.max() <= hull.model_error
        # What is left open, and what lies between the points.
        assert hull.model_error <= 1.1 * apart.max() + 0.5e-3 + 2e-4
        checked += 1
    assert checked >= 7


def test_a_dent_is_found():
    """A cube without its lid and its inside: the middle of the lid is 0.5 m away."""
    box = trimesh.creation.box((1.0, 1.0, 1.0))
    open_ = box.triangles[box.face_normals[:, 2] < 0.5]
    reach = hull_reach(box.triangles, open_)
    assert 0.5 <= reach <= 0.5 * 1.03


def test_a_convex_mesh_has_no_dents():
    ball = trimesh.creation.icosphere(subdivisions=2)
    assert hull_reach(ball.triangles, ball.triangles) == 0.0
