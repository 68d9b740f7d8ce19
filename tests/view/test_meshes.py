"""What is drawn lies where the check has it: on the surfaces that it measures."""

import numpy as np
import pytest
from trimesh import Trimesh

from armguard.geometry import Box, Capsule, Pose, Sphere, distance
from armguard.geometry.shapes import HalfSpace, Triangle, shape_row
from armguard.geometry.shapes.registry import SHAPES
from armguard.scene.bay import bay_scene
from armguard.view.meshes import link_meshes, primitive_mesh, thinned

SOLID = [kind for kind in SHAPES.values() if kind not in (Triangle, HalfSpace)]

TURNED = Pose(xyz=(0.3, -0.2, 0.1), rpy=(0.4, -0.7, 1.1))


def volume(mesh: Trimesh) -> float:
    """Signed volume; positive where all triangles look outwards."""
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6.0)


@pytest.mark.parametrize("shape_class", SOLID, ids=lambda kind: kind.__name__)
def test_corners_lie_on_the_surface_the_check_measures(shape_class):
    rng = np.random.default_rng(3)
    grown = 0.02
    for _ in range(3):
        shape = shape_class.example(rng, 0.2)
        mesh = primitive_mesh(int(shape.kind), shape_row(shape, TURNED.matrix()), grown)
        assert volume(mesh) > 0.0
        point = Sphere(radius=1e-9)
        for vertex in mesh.vertices[:: max(len(mesh.vertices) // 12, 1)]:
            gap = distance(shape, TURNED, point, Pose(xyz=tuple(vertex))).distance
            # Balls around corners have facets, which cut a little inside.
            assert -0.15 * grown < gap - grown < 1e-6


def test_without_growth_a_box_and_a_capsule_are_themselves():
    shape = Box(size=(0.2, 0.4, 0.6))
    box = primitive_mesh(int(shape.kind), shape_row(shape))
    assert len(box.vertices) == 8
    assert volume(box) == pytest.approx(0.2 * 0.4 * 0.6)
    capsule = Capsule(start=(0, 0, 0), end=(0, 0, 1), radius=0.1)
    drawn = volume(primitive_mesh(int(capsule.kind), shape_row(capsule)))
    true = np.pi * 0.1**2 * (1.0 + 4.0 / 3.0 * 0.1)
    assert 0.97 * true < drawn < true


def test_what_is_flat_is_drawn_all_the_same():
    triangle = Triangle(a=(0, 0, 0), b=(1, 0, 0), c=(0, 1, 0))
    plane = HalfSpace()
    for shape in (triangle, plane):
        mesh = primitive_mesh(int(shape.kind), shape_row(shape))
        assert len(mesh.faces) >= 4
        assert np.isfinite(mesh.vertices).all()


def test_links_are_drawn_by_what_their_file_has():
    robot = bay_scene("path").robots["left"]
    meshes = link_meshes(robot)
    assert set(meshes) == set(robot.fits)
    assert all(volume(mesh) > 0.0 for mesh in meshes.values())


def test_a_fine_mesh_is_thinned_and_stays_where_it_is():
    fine = primitive_mesh(
        int(Sphere(radius=1.0).kind), shape_row(Sphere(radius=0.1)), 0.0
    )
    thin = thinned(fine, 200)
    assert 20 < len(thin.faces) <= 200 < len(fine.faces)
    far = np.abs(np.linalg.norm(thin.vertices, axis=1) - 0.1).max()
    assert far < 0.03
    assert thinned(fine, 10**6) is fine
