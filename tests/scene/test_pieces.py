"""Hulls and convex pieces of meshes: every vertex inside, the overreach measured."""

import numpy as np
import pytest
import trimesh

from armguard.errors import MeshError
from armguard.geometry import Hull, PlacedShape, Pose, Sphere, distance
from armguard.scene import Scene, convex_pieces, load_scene, mesh_hull
from armguard.scene.bay import FOLDER
from armguard.scene.meshes import cutting

needs_coacd = pytest.mark.skipif(
    cutting.find_version() is None, reason="coacd is not installed"
)


@pytest.fixture(autouse=True)
def own_cache(tmp_path, monkeypatch):
    """Nothing is taken from an earlier run."""
    monkeypatch.setenv("ARMGUARD_CACHE", str(tmp_path / "cache"))


def angle():
    """Two bars at a right angle, as one closed mesh."""
    outline = [(0, 0), (1, 0), (1, 0.2), (0.2, 0.2), (0.2, 1), (0, 1)]
    vertices = np.array([(x, y, z) for z in (0.0, 0.2) for x, y in outline])
    caps = [(0, 2, 1), (0, 3, 2), (0, 4, 3), (0, 5, 4)]
    faces = [*caps, *((a + 6, c + 6, b + 6) for a, b, c in caps)]
    for k in range(6):
        j = (k + 1) % 6
        faces += [(k, j, j + 6), (k, j + 6, k + 6)]
    return vertices, np.array(faces)


def outside(shapes, points):
    """How far the worst point is from the nearest shape [m]."""
    dot = Sphere(radius=1e-12)
    return max(
        min(distance(dot, Pose(xyz=tuple(p)), s.shape, s.pose).distance for s in shapes)
        for p in points
    )


def test_the_hull_of_a_convex_mesh_has_no_model_error():
    box = trimesh.creation.box((0.2, 0.4, 0.6))
    (placed,) = mesh_hull((box.vertices, box.faces), rounding=0.01)
    assert isinstance(placed.shape, Hull)
    assert len(placed.shape.vertices) == 8
    assert placed.model_error == 0.0
    assert placed.shape.rounding == pytest.approx(0.01, abs=1e-8)


def test_the_hull_of_an_angle_says_what_it_closes():
    vertices, faces = angle()
    (placed,) = mesh_hull((vertices, faces))
    # The middle of the slanted side is 0.4 m from either bar.
    assert 0.4 <= placed.model_error <= 0.42
    assert outside([placed], vertices) <= 0.0


def test_flat_and_inside_out_meshes_have_hulls():
    square = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
    (flat,) = mesh_hull((square, [(0, 1, 2), (0, 2, 3)]))
    assert len(flat.shape.vertices) == 4
    (line,) = mesh_hull((square, [(0, 1, 1)]))
    assert len(line.shape.vertices) == 2
    (point,) = mesh_hull((square, [(0, 0, 0)]))
    assert len(point.shape.vertices) == 1
    vertices, faces = angle()
    (one,), (other,) = (
        mesh_hull((vertices, faces)),
        mesh_hull((vertices, faces[:, ::-1])),
    )
    assert np.array_equal(
        np.unique(one.shape.vertices, axis=0), np.unique(other.shape.vertices, axis=0)
    )


@needs_coacd
@pytest.mark.parametrize("size", [1e-9, 1.0, 1e6])
@pytest.mark.parametrize("inside_out", [False, True])
def test_pieces_hold_every_vertex(size, inside_out):
    vertices, faces = angle()
    vertices = size * vertices
    shapes = convex_pieces((vertices, faces[:, ::-1] if inside_out else faces))
    assert len(shapes) == 2
    assert all(isinstance(s.shape, Hull) for s in shapes)
    assert outside(shapes, vertices) <= 1e-9 * size
    # The angle is cut where it bends: the pieces close next to nothing.
    assert max(s.model_error for s in shapes) < 0.03 * size
    assert max(s.shape.rounding for s in shapes) < 1e-3 * size


@needs_coacd
def test_pieces_are_the_same_every_time_and_kept(tmp_path, monkeypatch):
    ring = trimesh.creation.torus(1.0, 0.3, major_sections=16, minor_sections=8)
    mesh = (ring.vertices, ring.faces)
    reported = []
    first = convex_pieces(mesh, concavity=0.2, progress=lambda *a: reported.append(a))
    assert reported == [("cutting (vertices, faces) into convex pieces", 1, 1)]
    assert outside(first, ring.vertices) <= 1e-9
    reported.clear()
    kept = convex_pieces(mesh, concavity=0.2, progress=lambda *a: reported.append(a))
    assert reported == []
    monkeypatch.setenv("ARMGUARD_CACHE", str(tmp_path / "other"))
    anew = convex_pieces(mesh, concavity=0.2)
    for a, b, c in zip(first, kept, anew, strict=True):
        assert np.array_equal(a.shape.vertices, b.shape.vertices)
        assert np.array_equal(a.shape.vertices, c.shape.vertices)
        assert a.shape.rounding == b.shape.rounding == c.shape.rounding
        assert a.model_error == b.model_error == c.model_error


@needs_coacd
def test_a_spoilt_cache_is_made_anew(tmp_path):
    mesh = angle()
    first = convex_pieces(mesh)
    (held,) = (tmp_path / "cache" / "pieces").iterdir()
    held.write_bytes(b"spoilt")
    assert len(convex_pieces(mesh)) == len(first)


@needs_coacd
def test_growth_brings_missed_vertices_in(monkeypatch):
    vertices, faces = angle()
    core = vertices * 0.9
    monkeypatch.setattr(
        "armguard.scene.meshes.pieces.cut_into_pieces", lambda *a: [core[:3], core]
    )
    shapes = convex_pieces((vertices, faces))
    assert outside(shapes, vertices) <= 1e-9
    growth = max(s.shape.rounding for s in shapes)
    assert growth == pytest.approx(
        outside([PlacedShape(Hull(points=core))], vertices), rel=1e-6
    )
    assert max(s.model_error for s in shapes) >= growth


@needs_coacd
def test_scene_files_name_pieces(tmp_path):
    vertices, faces = angle()
    trimesh.Trimesh(vertices, faces).export(tmp_path / "angle.stl")
    (tmp_path / "scene.yaml").write_text(
        f"robots:\n  arm: {{urdf: {FOLDER / 'bay_arm.urdf'}, mode: fixed}}\nobjects:\n"
        "  angle:\n    mesh: {file: angle.stl, as: pieces, concavity: 0.1, "
        "rounding: 0.01}\n    at: {xyz: [3, 0, 0]}\n"
        "  whole:\n    hull: {mesh: angle.stl, scale: 0.5}\n"
        "    at: {xyz: [3, 3, 0]}\n"
        "  held:\n    mesh: {file: angle.stl, as: pieces, scale: 0.1, max_pieces: 4}\n"
        "    attached_to: arm/link7\n"
    )
    items = load_scene(tmp_path / "scene.yaml").objects
    assert len(items["angle"].shapes) == 2
    assert all(s.shape.rounding >= 0.01 for s in items["angle"].shapes)
    (whole,) = items["whole"].shapes
    assert np.ptp(whole.shape.vertices, axis=0) == pytest.approx([0.5, 0.5, 0.1])
    assert len(items["held"].shapes) == 2


def flat_soup():
    points = np.random.default_rng(0).uniform(-1, 1, (30, 2))
    return points @ [[1, 0, 0.5], [0, 1, 0.25]], np.arange(30).reshape(-1, 3)


@needs_coacd
@pytest.mark.parametrize(
    ("mesh", "settings", "says"),
    [
        (
            flat_soup(),
            {},
            "has no volume: it is flat, so there is nothing to cut; give",
        ),
        (([(0, 0, 0)], [(0, 0, 0)]), {}, "has no volume: it is flat"),
        (angle(), {"concavity": 0.0}, "concavity is 0.0; it must be from 0.01 to 1"),
        (angle(), {"concavity": np.nan}, "concavity is nan; it must be from 0.01"),
        (angle(), {"max_pieces": 0}, "max_pieces is 0; it must be at least 1"),
    ],
)
def test_what_cannot_be_cut_is_reported(mesh, settings, says):
    with pytest.raises(MeshError) as caught:
        convex_pieces(mesh, **settings)
    assert says in str(caught.value)


def test_without_coacd_the_remedy_is_named(monkeypatch):
    monkeypatch.setattr(cutting, "find_version", lambda: None)
    with pytest.raises(MeshError) as caught:
        Scene().add_mesh(angle(), name="angle", form="pieces")
    assert str(caught.value) == (
        "cutting a mesh into convex pieces needs coacd; install it with "
        "`pip install 'armguard[fit]'`, or give the mesh as 'hull' or 'triangles'"
    )


@needs_coacd
def test_a_crash_of_coacd_is_an_error_and_no_more(tmp_path, monkeypatch):
    child = tmp_path / "child.py"
    child.write_text("import os, sys\nprint('assertion', file=sys.stderr)\nos.abort()")
    monkeypatch.setattr(cutting, "CHILD", child)
    with pytest.raises(MeshError) as caught:
        convex_pieces(angle())
    assert "coacd could not cut mesh '(vertices, faces)' (exit code -6: assertion)" in (
        str(caught.value)
    )
    assert "give it as 'hull' or 'triangles'" in str(caught.value)
