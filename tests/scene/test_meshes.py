"""Meshes in a scene: any soup, any number of triangles, every fault reported."""

import os
import tracemalloc

import numpy as np
import pytest
import trimesh

from armguard.errors import MeshError, SceneError
from armguard.geometry import Pose, ShapeKind, Triangle
from armguard.geometry.shapes import ROW_WIDTH, shape_row
from armguard.respond import Guard
from armguard.scene import Scene, compile_scene, load_scene
from armguard.scene.bay import FOLDER
from armguard.scene.meshes.source import RECORD

VERTICES = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0.5)]
FACES = [(0, 1, 2), (1, 3, 2)]

POSE = Pose(xyz=(2, 0.5, -1), rpy=(0.3, -0.2, 1.0))


def arm_scene():
    scene = Scene(mode="fixed")
    scene.add_robot(FOLDER / "bay_arm.urdf", name="arm")
    return scene


def write_stl(path, corners):
    """A binary STL of corners, shape (n, 3, 3)."""
    records = np.zeros(len(corners), RECORD)
    records["corners"] = corners
    path.write_bytes(
        b"solid binary, whatever the first word says".ljust(80)
        + len(corners).to_bytes(4, "little")
        + records.tobytes()
    )
    return path


def test_a_surface_is_its_triangles():
    scene = arm_scene()
    item = scene.add_mesh((VERTICES, FACES), name="ramp", pose=POSE, rounding=0.01)
    assert item.shapes == ()
    tables = compile_scene(scene)
    corners = np.array(VERTICES)[np.array(FACES)]
    expected = [
        shape_row(Triangle(a=a, b=b, c=c, rounding=0.01), POSE.matrix())
        for a, b, c in corners
    ]
    assert tables.kinds[-2:].tolist() == [ShapeKind.TRIANGLE] * 2
    assert tables.local_rows[-2:] == pytest.approx(np.array(expected), abs=1e-15)
    assert tables.model_errors[-2:].tolist() == [0.0, 0.0]
    assert tables.bodies[-2:].tolist() == [-1, -1]


def test_names_of_triangles_are_made_when_read():
    scene = arm_scene()
    scene.add_mesh((VERTICES, FACES), name="ramp", pose=POSE)
    scene.add_mesh((VERTICES, FACES[:1]), name="flap", pose=POSE)
    tables = compile_scene(scene)
    assert tables.labels[-3:] == ("ramp[0]", "ramp[1]", "flap")
    assert tables.body_names[-3:] == ("ramp", "ramp", "flap")
    assert len(tables.labels) == len(list(tables.labels)) == len(tables.kinds)
    assert tables.labels.index("ramp[1]") == len(tables.kinds) - 2
    with pytest.raises(IndexError):
        tables.labels[len(tables.kinds)]


def test_each_triangle_is_an_owner_of_its_own():
    scene = arm_scene()
    scene.add_mesh((VERTICES, FACES), name="ramp", pose=POSE)
    scene.add([Triangle(a=a, b=a, c=a) for a in VERTICES], name="dots", pose=POSE)
    tables = compile_scene(scene)
    ramp, dots = tables.owners[-6:-4], tables.owners[-4:]
    assert len({*ramp.tolist()}) == 2
    assert len({*dots.tolist()}) == 1
    assert len({*tables.owners.tolist()}) == tables.owners.max() + 1
    moving = tables.bodies >= 0
    assert len({*tables.owners[moving].tolist()}) == len(
        {*tables.bodies[moving].tolist()}
    )


def test_a_mesh_may_be_part_of_a_union(tmp_path):
    write_stl(tmp_path / "ramp.stl", np.array(VERTICES)[np.array(FACES)])
    (tmp_path / "scene.yaml").write_text(
        f"robots:\n  arm: {{urdf: {FOLDER / 'bay_arm.urdf'}, mode: fixed}}\n"
        "objects:\n  both:\n    at: {xyz: [3, 0, 0]}\n    union:\n"
        "      - {sphere: {radius: 0.1}}\n"
        "      - {mesh: {file: ramp.stl, scale: 0.5}, at: {xyz: [0, 0, 1]}}\n"
    )
    tables = compile_scene(load_scene(tmp_path / "scene.yaml"))
    assert tables.labels[-3:] == ("both[0]", "both[1]", "both[2]")
    assert tables.local_rows[-1, 1:10] == pytest.approx(
        [3.5, 0, 1, 3.5, 0.5, 1.25, 3, 0.5, 1]
    )


def test_any_soup_is_legal():
    vertices = [*VERTICES, (5, 5, 5)]
    faces = [(0, 2, 1), (0, 1, 2), (0, 0, 1), (3, 3, 3), (0, 1, 2), (4, 4, 0)]
    scene = arm_scene()
    item = scene.add_mesh((vertices, faces), name="soup", pose=POSE)
    assert item.surfaces[0].triangles == pytest.approx(
        np.array(vertices, float)[np.array(faces)]
    )
    assert len(compile_scene(scene).kinds) == len(arm_kinds()) + len(faces)


def arm_kinds():
    return compile_scene(arm_scene()).kinds


@pytest.mark.parametrize("suffix", ["stl", "obj", "ply", "text.stl"])
def test_files_are_read(tmp_path, suffix):
    box = trimesh.creation.box((0.5, 1, 2))
    path = tmp_path / f"box.{suffix}"
    if suffix == "text.stl":
        path.write_text(trimesh.exchange.stl.export_stl_ascii(box))
    else:
        box.export(path)
    scene = Scene(mode="fixed")
    item = scene.add_mesh(path, name="box", scale=(2, 1, -1))
    (surface,) = item.surfaces
    assert len(surface) == 12
    corners = surface.triangles.reshape(-1, 3)
    assert np.abs(corners) == pytest.approx(np.tile([0.5, 0.5, 1.0], (36, 1)))


def test_a_mesh_keeps_its_distance_like_the_solid_it_bounds():
    box = trimesh.creation.box((0.4, 0.6, 0.8))
    at = Pose(xyz=(0.95, 0.0, 0.5), rpy=(0.1, 0.2, 0.3))
    nearest = []
    for form in ("triangles", "hull"):
        scene = Scene(mode="fixed", margin=1.0)
        scene.add_robot(FOLDER / "bay_arm.urdf", name="arm")
        scene.add_mesh((box.vertices, box.faces), name="box", form=form, pose=at)
        verdict = Guard(scene).home_verdict
        near = [p for p in verdict.near if "box" in (p.a, p.b)]
        nearest.append(min(p.distance for p in near))
    assert nearest[0] > 0.0
    assert nearest[0] == pytest.approx(nearest[1], abs=1e-9)


def test_two_hundred_thousand_triangles_stay_one_array(tmp_path):
    count = 200_000
    rng = np.random.default_rng(0)
    corners = rng.uniform(1, 3, (count, 3, 3)).astype(np.float32)
    path = write_stl(tmp_path / "much.stl", corners)
    scene = arm_scene()
    compile_scene(scene)
    tracemalloc.start()
    item = scene.add_mesh(path, name="much")
    _, reading = tracemalloc.get_traced_memory()
    tables = compile_scene(scene)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    rows = count * ROW_WIDTH * 8
    assert reading < 2.5 * rows
    assert peak < 3.0 * rows
    assert np.array_equal(item.surfaces[0].triangles, corners.astype(np.float64))
    assert np.array_equal(tables.local_rows[-count:, 1:10], corners.reshape(-1, 9))
    assert len(np.unique(tables.owners)) == count + len(
        np.unique(tables.owners[:-count])
    )
    assert tables.labels[-1] == f"much[{count - 1}]"


def test_progress_is_reported_for_large_files(tmp_path, monkeypatch):
    monkeypatch.setattr("armguard.scene.meshes.source.BLOCK", 100)
    path = write_stl(tmp_path / "long.stl", np.ones((250, 3, 3)))
    reported = []
    item = Scene().add_mesh(path, name="long", progress=lambda *a: reported.append(a))
    assert reported == [("reading long.stl", k, 3) for k in (1, 2, 3)]
    assert len(item.surfaces[0]) == 250


def test_the_limit_is_judged_by_the_header_alone(tmp_path):
    path = tmp_path / "huge.stl"
    count = 10_000_001
    with path.open("wb") as file:
        file.write(bytes(80) + count.to_bytes(4, "little"))
    os.truncate(path, 84 + 50 * count)
    tracemalloc.start()
    with pytest.raises(MeshError) as caught:
        Scene().add_mesh(path, name="huge")
    assert tracemalloc.get_traced_memory()[1] < 1e6
    tracemalloc.stop()
    assert str(caught.value) == (
        "mesh 'huge.stl' has 10,000,001 triangles; the limit is 10,000,000: raise "
        "`max_triangles`, at about half a kilobyte of memory each, or make the mesh "
        "coarser"
    )


def test_the_limit_is_a_setting(tmp_path):
    path = write_stl(tmp_path / "a.stl", np.ones((3, 3, 3)))
    Scene().add_mesh(path, name="a", max_triangles=3)
    with pytest.raises(MeshError, match="has 3 triangles; the limit is 2: raise"):
        Scene().add_mesh(path, name="a", max_triangles=2)


def cut_off(tmp_path):
    path = write_stl(tmp_path / "cut.stl", np.ones((10, 3, 3)))
    path.write_bytes(bytes(80) + path.read_bytes()[80:300])
    return path


def named(name, content):
    def make(tmp_path):
        path = tmp_path / name
        path.write_bytes(content)
        return path

    return make


def with_nan(tmp_path):
    corners = np.ones((5, 3, 3))
    corners[3, 1, 2] = np.nan
    return write_stl(tmp_path / "nan.stl", corners)


BAD = {
    "absent": (lambda p: p / "no.stl", "mesh 'no.stl' is not there: "),
    "a folder": (lambda p: p, "is not there: "),
    "another ending": (
        named("a.step", b"x"),
        "mesh 'a.step' is no .stl, .obj, .dae, .ply; convert it to one of these",
    ),
    "no mesh": (named("a.ply", b"nonsense"), "mesh 'a.ply' cannot be read: "),
    "too short": (named("a.stl", b"x"), "is 1 bytes long, too short for an STL"),
    "cut off": (
        cut_off,
        "mesh 'cut.stl' announces 10 triangles and has room for 4; it is cut off or no "
        "STL; write it again",
    ),
    "empty stl": (named("a.stl", bytes(84)), "mesh 'a.stl' has no triangle"),
    "empty obj": (named("a.obj", b"v 0 0 0\n"), "mesh 'a.obj' "),
    "not finite": (
        with_nan,
        "mesh 'nan.stl' has a corner that is not finite, in triangle 3; fix the mesh",
    ),
    "nan vertex": (
        lambda p: ([(0, 0, np.nan)], [(0, 0, 0)]),
        "mesh '(vertices, faces)' has a corner that is not finite, in triangle 0",
    ),
    "no faces": (lambda p: (VERTICES, []), "mesh '(vertices, faces)' has no triangle"),
    "flat vertices": (
        lambda p: ([(0, 0)], [(0, 0, 0)]),
        "mesh vertices have shape (1, 2); it must be (v, 3)",
    ),
    "quads": (
        lambda p: (VERTICES, [(0, 1, 2, 3)]),
        "of shape (1, 4); they must be whole numbers of shape (n, 3)",
    ),
    "broken faces": (
        lambda p: (VERTICES, [(0.0, 1.0, 2.0)]),
        "mesh faces are float64 of shape (1, 3); they must be whole numbers",
    ),
    "face too far": (
        lambda p: (VERTICES, [(0, 1, 4)]),
        "mesh faces name vertex 4; there are 4, from 0 on",
    ),
    "negative face": (
        lambda p: (VERTICES, [(0, 1, -1)]),
        "mesh faces name vertex -1; there are 4, from 0 on",
    ),
}


@pytest.mark.parametrize("form", ["triangles", "hull", "pieces"])
@pytest.mark.parametrize("case", BAD)
def test_a_bad_mesh_is_reported(tmp_path, case, form):
    make, says = BAD[case]
    with pytest.raises(MeshError) as caught:
        Scene().add_mesh(make(tmp_path), name="thing", form=form)
    assert says in str(caught.value)


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        ({"scale": 0.0}, "mesh scale is 0.0; it must be a number other than 0, or"),
        ({"scale": (1.0, 2.0)}, "mesh scale is (1.0, 2.0); it must be"),
        ({"scale": float("inf")}, "mesh scale is inf; it must be"),
        ({"rounding": -0.1}, "rounding is -0.1 m; it must be finite and >= 0"),
        ({"rounding": float("nan")}, "rounding is nan m; it must be finite"),
        (
            {"form": "boxes"},
            "a mesh cannot be 'boxes'; it can be 'triangles', 'hull' or 'pieces'",
        ),
    ],
)
def test_bad_settings_are_reported(settings, says):
    with pytest.raises(MeshError) as caught:
        Scene().add_mesh((VERTICES, FACES), name="thing", **settings)
    assert says in str(caught.value)


def test_triangles_do_not_ride_on_links(tmp_path):
    scene = arm_scene()
    says = (
        "object 'tool' is a mesh of triangles, which stand still; to ride on "
        "'arm/link7' give the mesh as 'hull' or as 'pieces'"
    )
    mesh = (VERTICES, FACES)
    with pytest.raises(SceneError) as caught:
        scene.add_mesh(mesh, name="tool", attached_to="arm/link7")
    assert str(caught.value) == says
    surface = scene.add_mesh(mesh, name="still").surfaces[0]
    with pytest.raises(SceneError) as caught:
        scene.add(surface, name="tool", attached_to="arm/link7")
    assert str(caught.value) == says
    item = scene.add_mesh(mesh, name="tool", form="hull", attached_to="arm/link7")
    assert item.attached_to == "arm/link7"
    write_stl(tmp_path / "tool.stl", np.ones((1, 3, 3)))
    (tmp_path / "scene.yaml").write_text(
        f"robots:\n  arm: {{urdf: {FOLDER / 'bay_arm.urdf'}, mode: fixed}}\nobjects:\n"
        "  tool: {mesh: {file: tool.stl}, attached_to: arm/link7}\n"
    )
    with pytest.raises(SceneError) as caught:
        load_scene(tmp_path / "scene.yaml")
    assert str(caught.value) == f"scene.yaml:4: objects.tool: {says}"
