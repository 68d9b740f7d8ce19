"""Fits that the package brings: found by geometry, and used only if they hold it."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import coal
import numpy as np
import pytest
import trimesh

from armguard.geometry.shapes import Hull
from armguard.robot import find_named_robot, load_urdf
from armguard.robot.fitting import fit_link, fit_robot
from armguard.robot.fitting.ready import FOLDER, proven_fit, ready_file, ready_fit
from armguard.robot.fitting.store import as_dict, as_shape, fit_key
from armguard.robot.known_arms import known_data
from armguard.robot.meshes import load_triangles
from armguard.robot.model import CollisionElement, Link, MeshFile

FILES = sorted(FOLDER.glob("*.json"))
SETTINGS = (0.030, 8)

URDF = """<robot name="mine"><!-- another text -->
  <link name="part"><collision name="c"><origin rpy="0.0 -0 0" xyz="0 0 -0.0"/>
    <geometry><mesh scale="1 1 1" filename="meshes/{mesh}"/></geometry>
  </collision></link>
</robot>"""


def mesh_of(name: str, link: str) -> Path:
    """The mesh of a link of a robot by name, whose pose in the link is the identity."""
    (element,) = load_urdf(find_named_robot(name).urdf).links[link].collisions
    assert np.array_equal(element.T_link_geometry, np.eye(4))
    assert isinstance(element.geometry, MeshFile)
    return element.geometry.path


def link_of(path: Path) -> Link:
    element = CollisionElement(geometry=MeshFile(path), T_link_geometry=np.eye(4))
    return Link(name="part", collisions=(element,))


def row_of(key: str) -> dict[str, object]:
    (row,) = (f["fits"][key] for f in map(ready_file, FILES) if key in f["fits"])
    return row


@pytest.fixture
def moved(tmp_path):
    """Writes a mesh of the Panda with its farthest corner moved outwards [m]."""

    def write(by: float) -> tuple[Link, Link]:
        own = link_of(mesh_of("panda", "panda_link5"))
        corners = load_triangles(own.collisions[0].geometry).reshape(-1, 3)
        middle = corners.mean(axis=0)
        out = corners - middle
        far = np.linalg.norm(out, axis=1)
        same = (corners == corners[far.argmax()]).all(axis=1)
        corners[same] += by * out[far.argmax()] / far.max()
        path = tmp_path / "moved.stl"
        faces = np.arange(len(corners)).reshape(-1, 3)
        trimesh.Trimesh(corners, faces, process=False).export(path)
        return own, link_of(path)

    return write


def test_a_file_with_the_same_meshes_takes_the_shipped_fit(tmp_path, monkeypatch):
    monkeypatch.setenv("ARMGUARD_CACHE", str(tmp_path / "cache"))
    mesh = mesh_of("panda", "panda_link5")
    (tmp_path / "meshes").mkdir()
    shutil.copy(mesh, tmp_path / "meshes" / f"other{mesh.suffix}")
    urdf = tmp_path / "mine.urdf"
    urdf.write_text(URDF.format(mesh=f"other{mesh.suffix}"))
    fitted: list[object] = []
    model = load_urdf(urdf)
    fit = fit_robot(model, progress=lambda *at: fitted.append(at))["part"]
    again = fit_robot(model, progress=lambda *at: fitted.append(at))["part"]
    assert fitted == []
    row = row_of(fit_key(model.links["part"], SETTINGS))
    for one in fit, again:
        assert [as_dict(s) for s in one.shapes] == list(
            map(as_dict, map(as_shape, row["shapes"]))
        )
    assert len(list((tmp_path / "cache" / "fits").iterdir())) == 1


def test_a_changed_mesh_or_another_setting_has_no_shipped_fit(tmp_path, moved):
    own, other = moved(1e-6)
    assert ready_fit(fit_key(own, SETTINGS), own) is not None
    assert ready_fit(fit_key(other, SETTINGS), other) is None
    assert ready_fit(fit_key(own, (0.030, 9)), own) is None
    (element,) = own.collisions
    at = np.eye(4)
    at[0, 3] = 2e-9
    shifted = replace(own, collisions=(replace(element, T_link_geometry=at),))
    assert ready_fit(fit_key(shifted, SETTINGS), shifted) is None


@pytest.mark.parametrize(("by", "held"), [(2e-6, True), (2e-3, False)])
def test_a_fit_is_refused_if_it_does_not_hold_the_mesh(moved, by, held):
    """As if two meshes had one key; primitives are grown by 50 µm."""
    own, other = moved(by)
    row = row_of(fit_key(own, SETTINGS))
    assert (proven_fit(row, other) is not None) is held


def test_primitives_or_hulls_that_hold_less_are_refused():
    link = link_of(mesh_of("panda", "panda_link5"))
    row = row_of(fit_key(link, SETTINGS))
    assert proven_fit(row, link) is not None
    assert proven_fit({**row, "shapes": row["shapes"][:-1]}, link) is None
    (hull,) = row["hulls"]
    less = {**hull, "corners": hull["corners"][:-1]}
    assert proven_fit({**row, "hulls": [less]}, link) is None
    # Farther than it is from the others.
    grown = {**less, "rounding": 0.05}
    assert proven_fit({**row, "hulls": [grown]}, link) is not None


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_every_shipped_fit_is_of_a_known_arm_and_can_be_read(path):
    file = json.loads(path.read_text())
    everywhere = {key for other in FILES for key in ready_file(other)["fits"]}
    for robot in file["robots"].values():
        assert robot["arms"] and set(robot["arms"]) <= set(known_data()["arms"])
        assert robot["links"] and set(robot["links"].values()) <= everywhere
    used = {k for robot in file["robots"].values() for k in robot["links"].values()}
    assert set(file["fits"]) <= used
    for row in file["fits"].values():
        shapes = [as_shape(shape) for shape in row["shapes"]]
        assert 1 <= len(shapes) <= SETTINGS[1]
        assert all(0.0 <= shape.model_error < 0.3 for shape in shapes)
        assert row["hulls"] and all(len(h["corners"]) >= 4 for h in row["hulls"])


@pytest.mark.parametrize("name", ["panda", "ur5", "xarm7"])
def test_shipped_hulls_hold_their_meshes_by_coal(name):
    """Coal's distance of each corner of the mesh to the hull, less its rounding."""
    for link in load_urdf(find_named_robot(name).urdf).links.values():
        fit = ready_fit(fit_key(link, SETTINGS), link)
        if fit is None:
            continue
        for element, placed in zip(link.collisions, fit.exact, strict=True):
            assert isinstance(placed.shape, Hull)
            points = coal.StdVec_Vec3s()
            points.extend(list(placed.shape.vertices))
            hull = coal.Convex.convexHull(points, False, "Qt")
            corners = np.unique(load_triangles(element.geometry).reshape(-1, 3), axis=0)
            for corner in corners[:: max(1, len(corners) // 300)]:
                at = coal.Transform3s(np.eye(3), corner)
                apart = coal.distance(
                    *(hull, coal.Transform3s(), coal.Sphere(1e-6), at),
                    *(coal.DistanceRequest(), coal.DistanceResult()),
                )
                assert apart <= placed.shape.rounding + 1e-6


@pytest.mark.parametrize("link", ["panda_link5", "panda_hand"])
def test_the_code_makes_the_shipped_fits(link):
    """Searches differ in their last bits between processors, not in what they find."""
    one = load_urdf(find_named_robot("panda").urdf).links[link]
    shipped, made = ready_fit(fit_key(one, SETTINGS), one), fit_link(one)
    assert shipped is not None
    assert shipped.overreach == pytest.approx(made.overreach, abs=1e-4)
    assert len(shipped.shapes) == len(made.shapes)
    assert shipped.contained == made.contained
    assert [len(s.shape.vertices) for s in shipped.exact] == [
        len(s.shape.vertices) for s in made.exact
    ]
