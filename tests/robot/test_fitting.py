"""Fits: the whole surface is inside, and the overreach is what it says."""

import json
import pickle
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from scipy.spatial import cKDTree

from armguard.errors import MeshError
from armguard.geometry import Box, Capsule, PlacedShape, Pose, Sphere
from armguard.geometry.shapes import Hull
from armguard.geometry.shapes.hull import distinct
from armguard.robot import find_named_robot, load_urdf
from armguard.robot.fitting import (
    enclose_cylinder,
    fit_link,
    fit_robot,
    parallel,
    uncovered,
)
from armguard.robot.fitting.clipping import cut
from armguard.robot.fitting.exact import (
    exact_shapes,
    hull_faces,
    mesh_hull,
    sticks_out,
)
from armguard.robot.fitting.fit import placed_triangles
from armguard.robot.fitting.hull_reach import bound_pieces, hull_reach
from armguard.robot.fitting.overreach import overreaches, surface_samples
from armguard.robot.fitting.proof import inside, quartered
from armguard.robot.fitting.store import as_dict
from armguard.robot.fitting.triangle_tree import triangle_tree
from armguard.robot.meshes import load_triangles
from armguard.robot.model import CollisionElement, Cylinder, Link, MeshFile, RobotModel

ROBOTS = ["panda", "ur5", "xarm7", "kinova", "baxter"]


@pytest.fixture(scope="module")
def models():
    return {name: load_urdf(find_named_robot(name).urdf) for name in ROBOTS}


def soup(link):
    meshes = [e for e in link.collisions if isinstance(e.geometry, MeshFile)]
    return [placed_triangles(e) for e in meshes]


@pytest.mark.parametrize("name", ROBOTS)
def test_every_triangle_of_every_link_is_inside(models, name):
    fits = fit_robot(models[name])
    meshes = 0
    for link in models[name].links.values():
        for triangles in soup(link):
            assert len(uncovered(triangles, fits[link.name].shapes)) == 0, link.name
            meshes += 1
    assert meshes > 0 or name == "baxter"


@pytest.mark.parametrize("name", ROBOTS)
def test_random_points_of_the_surface_are_inside(models, name):
    """A second opinion that knows nothing of triangles in primitives."""
    rng = np.random.default_rng(0)
    fits = fit_robot(models[name])
    for link in models[name].links.values():
        for triangles in soup(link):
            which = rng.integers(len(triangles), size=3000)
            weights = rng.dirichlet(np.ones(3), size=3000)
            points = np.einsum("nk,nkd->nd", weights, triangles[which])
            held = np.zeros(len(points), dtype=bool)
            for placed in fits[link.name].shapes:
                held |= inside(placed, points)
            assert held.all(), link.name


def test_the_proof_has_teeth(models):
    link = models["panda"].links["panda_link3"]
    (triangles,) = soup(link)
    (placed,) = fit_link(link).shapes
    shape = placed.shape
    smaller = Capsule(start=shape.start, end=shape.end, radius=shape.radius - 1e-3)
    assert len(uncovered(triangles, [PlacedShape(smaller, placed.pose)])) > 0


@pytest.mark.parametrize("name", ["panda", "ur5"])
def test_the_overreach_bounds_what_sampling_finds(models, name):
    """Distances to a dense cloud of surface points, by another library."""
    rng = np.random.default_rng(1)
    for link in list(models[name].links.values())[:5]:
        if not soup(link):
            continue
        triangles = np.concatenate(soup(link))
        fit = fit_link(link)
        areas = np.linalg.norm(
            np.cross(
                triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
            ),
            axis=1,
        )
        which = rng.choice(len(triangles), size=60_000, p=areas / areas.sum())
        weights = rng.dirichlet(np.ones(3), size=60_000)
        cloud = cKDTree(np.einsum("nk,nkd->nd", weights, triangles[which]))
        worst = 0.0
        for placed in fit.shapes:
            points = surface_samples(placed, 0.004)
            for other in fit.shapes:
                if other is not placed:
                    points = points[~inside(other, points)]
            if len(points):
                worst = max(worst, float(cloud.query(points)[0].max()))
        # The cloud is a little farther away than the surface it is drawn from.
        assert worst <= fit.overreach + 0.003
        assert worst >= fit.overreach - 0.008


def test_samples_lie_on_the_surface_and_leave_no_gap():
    spacing = 0.01
    rng = np.random.default_rng(2)
    shapes = [
        PlacedShape(Sphere(radius=0.1)),
        PlacedShape(Capsule(start=(0, 0, -0.1), end=(0.1, 0, 0.2), radius=0.05)),
        PlacedShape(Box(size=(0.2, 0.1, 0.4))),
        PlacedShape(
            Box(size=(0.2, 0.04, 0.3), rounding=0.04),
            Pose(xyz=(0.3, 0, 0), rpy=(0.3, 0.4, 0.5)),
        ),
    ]
    for placed in shapes:
        samples = surface_samples(placed, spacing)
        grown = type(placed.shape)(
            **{
                k: getattr(placed.shape, k)
                for k in placed.shape.__slots__
                if k != "rounding"
            },
            rounding=placed.shape.rounding + 1e-9,
        )
        assert inside(PlacedShape(grown, placed.pose), samples).all()
        # Walk in from far away to the surface; the next sample is close by.
        T = placed.pose.matrix()
        tree = cKDTree(samples)
        centre = (
            T[:3, :3]
            @ np.array(
                np.add(placed.shape.start, placed.shape.end) / 2
                if isinstance(placed.shape, Capsule)
                else np.zeros(3)
            )
            + T[:3, 3]
        )
        rays = rng.normal(size=(500, 3))
        rays /= np.linalg.norm(rays, axis=1)[:, None]
        low, high = np.zeros(500), np.ones(500)
        for _ in range(50):
            middle = (low + high) / 2
            hit = inside(placed, centre + middle[:, None] * rays)
            low, high = np.where(hit, middle, low), np.where(hit, high, middle)
        assert tree.query(centre + low[:, None] * rays)[0].max() <= spacing


@pytest.mark.parametrize(
    ("radius", "length", "target"),
    [(0.03, 0.14, 0.03), (0.05, 0.5, 0.03), (0.2, 0.1, 0.03), (0.2, 1.0, 0.03)],
)
def test_a_cylinder_is_enclosed_and_its_overreach_bounds_the_truth(
    radius, length, target
):
    shapes = enclose_cylinder(radius, length, target)
    rng = np.random.default_rng(3)
    angle = rng.uniform(0, 2 * np.pi, 20_000)
    rim = np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])
    side = np.column_stack([rim, rng.uniform(-length / 2, length / 2, 20_000)])
    discs = np.column_stack(
        [rim * np.sqrt(rng.random(20_000))[:, None], rng.choice([-1, 1], 20_000)]
    )
    discs[:, 2] *= length / 2
    edges = np.column_stack([rim, rng.choice([-1, 1], 20_000) * length / 2])
    points = np.concatenate([side, discs, edges])
    held = np.zeros(len(points), dtype=bool)
    for placed in shapes:
        held |= inside(placed, points)
    assert held.all()
    for placed in shapes:
        samples = surface_samples(placed, 0.005)
        for other in shapes:
            if other is not placed:
                samples = samples[~inside(other, samples)]
        r = np.hypot(samples[:, 0], samples[:, 1])
        out = np.hypot(
            np.maximum(r - radius, 0), np.maximum(np.abs(samples[:, 2]) - length / 2, 0)
        )
        if len(out):
            assert out.max() <= placed.model_error + 1e-6


def test_exact_shapes_stay_as_they_are():
    T = Pose(xyz=(0.1, 0, 0)).matrix()
    box = Box(size=(0.2, 0.4, 0.6))
    element = CollisionElement(geometry=box, T_link_geometry=T)
    fit = fit_link(Link(name="l", collisions=(element,)))
    assert fit.overreach == 0.0
    assert fit.shapes[0].shape == box
    assert fit.shapes[0].pose.xyz == (0.1, 0.0, 0.0)


def test_more_primitives_overreach_less(models):
    link = models["ur5"].links["upper_arm_link"]
    one = fit_link(link, max_primitives=1)
    many = fit_link(link, max_primitives=8)
    assert len(one.shapes) == 1 < len(many.shapes)
    assert many.overreach < 0.8 * one.overreach


def test_a_cut_keeps_the_whole_surface():
    rng = np.random.default_rng(4)
    triangles = rng.normal(size=(200, 3, 3))
    lower, upper = cut(triangles, np.array([0.0, 0.6, 0.8]), 0.1)

    def area(t):
        sides = np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0])
        return np.linalg.norm(sides, axis=1).sum() / 2

    assert area(lower) + area(upper) == pytest.approx(area(triangles))
    assert (lower @ [0.0, 0.6, 0.8]).max() <= 0.1 + 1e-12
    assert (upper @ [0.0, 0.6, 0.8]).min() >= 0.1 - 1e-12


def test_fits_are_kept_on_disk_bit_for_bit(tmp_path, monkeypatch):
    monkeypatch.setenv("ARMGUARD_CACHE", str(tmp_path))
    element = CollisionElement(geometry=Cylinder(0.2, 0.6), T_link_geometry=np.eye(4))
    model = RobotModel(
        name="r",
        path=None,
        links={"l": Link(name="l", collisions=(element,))},
        joints={},
        root="l",
    )
    asked = []
    first = fit_robot(model, progress=lambda *a: asked.append(a))
    again = fit_robot(model, progress=lambda *a: asked.append(a))
    assert first == again
    assert asked == [("l", 1, 1)]
    (kept,) = (tmp_path / "fits").glob("*.json")
    kept.write_text("broken")
    assert fit_robot(model) == first
    assert json.loads(kept.read_text())["source"] == "cylinder"


@pytest.mark.parametrize(
    ("name", "text", "says"),
    [
        ("m.stl", "", "cannot be read|no triangle"),
        ("m.obj", "v 0 0 0\nv 1 0 0\nv nan 1 0\nf 1 2 3\n", "not finite"),
        ("m.xyz", "x", r"is no \.stl"),
    ],
)
def test_meshes_that_are_none_are_refused(tmp_path, name, text, says):
    path = tmp_path / name
    path.write_text(text)
    with pytest.raises(MeshError, match=says):
        load_triangles(MeshFile(path))


def test_a_shape_far_off_has_its_overreach():
    triangle = np.array([[[0.0, 0, 0], [0.1, 0, 0], [0, 0.1, 0]]])
    ball = PlacedShape(Sphere(radius=0.3))
    (reach,) = overreaches(triangle_tree(triangle), [ball], 0.001)
    assert reach == pytest.approx(0.3, abs=0.002)


def dented(count, depth=0.02):
    """A dense ball with a dent at its top, shape (n, 3, 3)."""
    ball = trimesh.creation.uv_sphere(radius=0.1, count=[count, count])
    points = ball.vertices.copy()
    points[:, 2] -= depth * np.clip(points[:, 2] / 0.1, 0.0, 1.0) ** 8
    return points[ball.faces]


def true_distances(points, triangles):
    """Distances of points to the nearest of all triangles, by trimesh [m]."""
    corners = np.arange(3 * len(triangles)).reshape(-1, 3)
    mesh = trimesh.Trimesh(triangles.reshape(-1, 3), corners, process=False)
    return trimesh.proximity.closest_point_naive(mesh, points)[1]


def test_the_dents_of_a_dense_mesh_are_bounded():
    """No tighter than the distances of points of the hull, and no looser than 4 %."""
    triangles = dented(40)
    faces = hull_faces(Hull(points=triangles.reshape(-1, 3)))
    found = hull_reach(faces, triangles)
    points = quartered(quartered(faces[faces[:, :, 2].max(axis=1) > 0.05]))
    points = np.unique(points.reshape(-1, 3).round(6), axis=0)
    points = points[np.argsort(-points[:, 2])[:400]]
    true = float(true_distances(points, triangles).max())
    assert 0.001 < true <= found <= 1.04 * true + 2e-4


@pytest.mark.parametrize("count", [1, 2, 4, 5, 63, 200])
def test_a_tree_has_the_distance_of_the_nearest_triangle(count):
    rng = np.random.default_rng(count)
    middle = rng.uniform(-1.0, 1.0, (count, 1, 3))
    triangles = middle + rng.uniform(-0.1, 0.1, (count, 3, 3))
    points = rng.uniform(-1.5, 1.5, (50, 3))
    bounds = np.zeros((len(points), 2))
    pieces = np.repeat(points[:, None], 3, axis=1)
    bound_pieces(pieces, *triangle_tree(triangles), bounds)
    true = true_distances(points, triangles)
    assert bounds == pytest.approx(np.column_stack([true, true]), abs=1e-12)


def test_distinct_points_are_those_of_numpy():
    rng = np.random.default_rng(0)
    points = rng.integers(-2, 3, (300, 3)).astype(np.float64)
    found, first = distinct(points)
    expected, index = np.unique(points, axis=0, return_index=True)
    assert (found == expected).all()
    assert (first == index).all()


def test_a_hull_that_sticks_out_is_found_before_the_proof():
    faces = hull_faces(Hull(points=dented(30, 0.0).reshape(-1, 3)))
    assert not sticks_out(faces, [PlacedShape(Sphere(radius=0.101))])
    assert sticks_out(faces, [PlacedShape(Sphere(radius=0.0995))])


def meshed_links(tmp_path, count=3):
    names = [f"l{k}" for k in range(count)]
    for k, name in enumerate(names):
        corners = dented(8, 0.001 * k).reshape(-1, 3)
        lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in corners.tolist()]
        lines += [f"f {i} {i + 1} {i + 2}" for i in range(1, len(corners), 3)]
        (tmp_path / f"{name}.obj").write_text("\n".join(lines))
    return [
        Link(
            name=name,
            collisions=(
                CollisionElement(
                    geometry=MeshFile(tmp_path / f"{name}.obj"),
                    T_link_geometry=np.eye(4),
                ),
            ),
        )
        for name in names
    ]


@pytest.mark.parametrize("executable", ["python", "", "/no/such", "/bin/false"])
def test_workers_fit_as_this_process_does(tmp_path, monkeypatch, executable):
    """Where there is no worker, or one that ends, the fits are the same."""
    links, started, finished = meshed_links(tmp_path), [], []
    settings = {"target": 0.030, "max_primitives": 1}
    alone = {link.name: fit_link(link, **settings) for link in links}
    monkeypatch.setattr(parallel, "WORTH", 0)
    monkeypatch.setattr(parallel, "core_count", lambda: 3)
    if executable != "python":
        monkeypatch.setattr("sys.executable", executable)
    found = parallel.fit_links(
        fit_link, links, settings, started.append, lambda fit: finished.append(fit.link)
    )
    assert {n: [as_dict(s) for s in f.shapes] for n, f in found.items()} == {
        n: [as_dict(s) for s in f.shapes] for n, f in alone.items()
    }
    assert set(started) == set(finished) == set(alone)


def test_a_worker_fits_without_the_main_module(tmp_path):
    (link,) = meshed_links(tmp_path, 1)
    process = parallel.start()
    parallel.send(process.stdin, (fit_link, link, {}))
    answer = pickle.load(process.stdout)
    given = Path(f"/proc/{process.pid}/environ").read_bytes().split(b"\0")
    parallel.end(process)
    assert process.wait(30) == 0
    assert b"OPENBLAS_NUM_THREADS=1" in given
    assert as_dict(answer.shapes[0]) == as_dict(fit_link(link).shapes[0])


def test_a_link_that_cannot_be_fitted_ends_the_others(tmp_path, monkeypatch):
    links = meshed_links(tmp_path)
    (tmp_path / "l2.obj").write_text("f 1 2 3")
    monkeypatch.setattr(parallel, "WORTH", 0)
    with pytest.raises(MeshError, match=r"l2\.obj"):
        parallel.fit_links(fit_link, links, {}, print, print)


def test_links_that_share_a_mesh_share_its_hull(tmp_path):
    first, second = meshed_links(tmp_path, 2)
    (element,) = second.collisions
    mesh = first.collisions[0].geometry
    at = np.eye(4)
    at[:3, 3] = 0.1, 0.2, 0.3
    other = replace(element, geometry=mesh, T_link_geometry=at)
    mesh_hull.cache_clear()
    (own,), (again,) = (
        exact_shapes(link) for link in (first, replace(second, collisions=(other,)))
    )
    assert mesh_hull.cache_info().misses == 1
    assert again.shape is own.shape and again.model_error == own.model_error
    assert again.pose.xyz == (0.1, 0.2, 0.3) and own.pose.xyz == (0.0, 0.0, 0.0)
    exact_shapes(
        replace(second, collisions=(replace(other, geometry=element.geometry),))
    )
    assert mesh_hull.cache_info().misses == 2
