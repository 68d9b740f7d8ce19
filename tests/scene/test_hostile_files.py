"""Files of strangers: what is outside, too large or no file at all is refused."""

import os
import tracemalloc
import zipfile

import numpy as np
import pytest

from armguard.errors import ArmguardError, MeshError, TrajectoryError
from armguard.robot.meshes import load_triangles
from armguard.robot.model import MeshFile
from armguard.scene import Scene, load_scene
from armguard.scene.archive import ArchiveError, scene_of
from armguard.scene.trajectory_file import load_trajectory
from armguard.scene.yaml_source import SceneFileError

ARM = """<robot name="r">
<link name="a"><collision><geometry>{shape}</geometry></collision></link>
<link name="b"/><joint name="j" type="revolute"><parent link="a"/><child link="b"/>
<limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>"""
OBJ = "v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nv 0 0 0.1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
SCENE = "mode: fixed\nrobots: {arm: {urdf: r.urdf%s}}\n%s"


@pytest.fixture
def place(tmp_path):
    """A scene's folder, with a mesh inside and one outside."""
    own = tmp_path / "scene"
    own.mkdir()
    (own / "m.obj").write_text(OBJ)
    outside = tmp_path / "outside"
    outside.mkdir()
    (outside / "m.obj").write_text(OBJ)
    (own / "link.obj").symlink_to(outside / "m.obj")
    (own / "inner.obj").symlink_to(own / "m.obj")
    return own


def scene(place, shape='<sphere radius="0.1"/>', robot="", objects=""):
    (place / "r.urdf").write_text(ARM.format(shape=shape))
    path = place / "scene.yaml"
    path.write_text(SCENE % (robot, objects))
    return load_scene(path)


OUTSIDE = {
    "up": "../outside/m.obj",
    "link": "link.obj",
    "package": "package://scene/../outside/m.obj",
    "package above": "package://outside/m.obj",
    "dots as package": "package://../outside/m.obj",
}


def absolute(place, how):
    mesh = place.parent / "outside" / "m.obj"
    return {"absolute": str(mesh), "url": f"file://{mesh}"}.get(how)


@pytest.mark.parametrize("how", [*OUTSIDE, "absolute", "url"])
def test_a_mesh_outside_is_refused_with_the_remedy(place, how):
    name = OUTSIDE.get(how) or absolute(place, how)
    shape = f'<mesh filename="{name}"/>'
    with pytest.raises(SceneFileError, match="packages"):
        scene(place, shape)
    if "://" not in name:
        with pytest.raises(SceneFileError, match=r"packages: \{NAME: FOLDER\}"):
            scene(place, objects=f"objects: {{m: {{mesh: {{file: '{name}'}}}}}}")


@pytest.mark.parametrize("name", ["%2e%2e/outside/m.obj", "\\0", "a" * 3000])
def test_a_name_of_no_file_is_refused(place, name):
    with pytest.raises(SceneFileError):
        scene(place, objects=f'objects: {{m: {{mesh: {{file: "{name}"}}}}}}')


@pytest.mark.parametrize("name", ["m.obj", "inner.obj", "../scene/m.obj"])
def test_a_mesh_inside_is_read(place, name):
    objects = f"objects: {{m: {{mesh: {{file: '{name}'}}}}}}"
    made = scene(place, f'<mesh filename="{name}"/>', objects=objects)
    assert len(made.objects["m"].surfaces[0]) == 4


def test_a_declared_package_may_be_anywhere(place):
    name = "package://p/m.obj"
    made = scene(
        place,
        f'<mesh filename="{name}"/>',
        robot=", packages: {p: ../outside}",
        objects="packages: {p: ../outside}\n"
        f"objects: {{m: {{mesh: {{file: '{name}'}}}}}}",
    )
    assert len(made.objects["m"].surfaces[0]) == 4


def test_a_robot_beside_its_meshes_is_read_by_python_too(place):
    (place / "r.urdf").write_text(ARM.format(shape='<mesh filename="m.obj"/>'))
    assert Scene(mode="fixed").add_robot(place / "r.urdf", name="a").fits


def bomb(sign):
    first = "a0: &a0 {k: 1}\n" if sign else "a0: &a0 [x]\n"
    rows = [", ".join([f"*a{k}"] * 9) for k in range(8)]
    form = "a{0}: &a{0} {{<<: [{1}]}}\n" if sign else "a{0}: &a{0} [{1}]\n"
    return first + "".join(form.format(k + 1, row) for k, row in enumerate(rows))


YAML = {
    "merge keys": (bomb(True), "more than 100,000 keys and values"),
    "aliases": (bomb(False), "more than 100,000 keys and values"),
    "itself": ("robots: &a [*a]\n", "an anchor that holds itself"),
    "brackets": ("[" * 100_000, "nests more than 40 lists and mappings"),
    "braces": ("{a: " * 3000, "nests more than 40 lists and mappings"),
    "a long value": (f"robots: {'9' * 5000}\n", "5,000 characters in one value"),
    "a comment": ("#" * 20_000_000, "it has 20.0 MB; the limit is 8 MB"),
    "a date": ("robots: 2001-99-99\n", "is not YAML"),
}


@pytest.mark.parametrize("what", YAML)
@pytest.mark.parametrize("kind", ["scene", "motion"])
def test_a_bomb_of_yaml_is_one_sentence(tmp_path, what, kind):
    text, sentence = YAML[what]
    path = tmp_path / "bomb.yaml"
    path.write_text(text)
    load = load_scene if kind == "scene" else load_trajectory
    tracemalloc.start()
    with pytest.raises(ArmguardError) as caught:
        load(path)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    said = str(caught.value)
    assert sentence in said or (kind == "motion" and what == "a date")
    assert len(said) < 500
    assert peak < 100e6


def test_merge_keys_still_work(place):
    objects = (
        "objects:\n  a: &a {box: [1, 1, 1], at: {xyz: [0, 0, 3]}}\n  b: {<<: *a}\n"
    )
    assert scene(place, objects=objects).objects.keys() == {"a", "b"}


@pytest.mark.parametrize("what", ["device", "pipe", "folder"])
@pytest.mark.parametrize("name", ["x.yaml", "x.csv", "x.npz"])
def test_what_is_no_regular_file_is_not_read(tmp_path, what, name):
    path = tmp_path / name
    if what == "device":
        path.symlink_to("/dev/zero")
    elif what == "pipe":
        os.mkfifo(path)
    else:
        path.mkdir()
    load = load_scene if name == "x.yaml" else load_trajectory
    with pytest.raises(ArmguardError, match="it is no regular file"):
        load(path)


def test_a_file_that_is_no_scene_is_not_quoted(tmp_path):
    secret = tmp_path / "secret"
    secret.write_text("password hunter2\n" * 50)
    (tmp_path / "scene.yaml").symlink_to(secret)
    with pytest.raises(SceneFileError) as caught:
        load_scene(tmp_path / "scene.yaml")
    assert "hunter2" not in str(caught.value)


def test_no_more_problems_are_listed_than_a_user_reads(place):
    objects = "".join(f"  o{k}: {{box: [1]}}\n" for k in range(500))
    with pytest.raises(SceneFileError) as caught:
        scene(place, objects=f"objects:\n{objects}")
    assert len(caught.value.problems) == 20


def npz(path, members):
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
        for name, content in members.items():
            file.writestr(name, content)


def test_an_npz_is_refused_before_it_is_unpacked(tmp_path):
    npz(tmp_path / "x.npz", {"q.npy": bytes(300_000_000)})
    tracemalloc.start()
    with pytest.raises(TrajectoryError, match="unpacks to 300 MB; the limit is 256"):
        load_trajectory(tmp_path / "x.npz")
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 10e6


@pytest.mark.parametrize("shape", ["(10**12,)", "(99999999999, 9)", "(-1,)", "()"])
def test_an_npz_whose_header_lies_is_refused(tmp_path, shape):
    head = f"{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}}}".ljust(117)
    array = b"\x93NUMPY\x01\x00\x76\x00" + head.encode() + b"\n" + bytes(16)
    npz(tmp_path / "x.npz", {"q.npy": array})
    with pytest.raises(TrajectoryError, match="is no NPZ file"):
        load_trajectory(tmp_path / "x.npz")


@pytest.mark.parametrize(
    "text", ["a\n" + "1\n" * 600_000, "1," * 20_000, 'a,b\n"' + "1" * 200_000 + '",2\n']
)
def test_a_bomb_of_csv_is_one_sentence(tmp_path, text):
    (tmp_path / "x.csv").write_text(text)
    with pytest.raises(TrajectoryError, match=r"x\.csv"):
        load_trajectory(tmp_path / "x.csv")


def test_a_mesh_without_an_area_is_no_geometry(tmp_path):
    path = tmp_path / "m.obj"
    path.write_text("v 1 1 1\n" * 3 + "f 1 2 3\n" * 100)
    with pytest.raises(MeshError, match="has no area: all of its 100 triangles"):
        load_triangles(MeshFile(path))


def test_a_mesh_of_absurd_size_is_refused(tmp_path):
    path = tmp_path / "m.obj"
    path.write_text("v 0 0 0\nv 1e30 0 0\nv 0 1e30 0\nf 1 2 3\n")
    with pytest.raises(MeshError, match=r"a corner at 1e\+30 m"):
        load_triangles(MeshFile(path))


def test_vertices_of_one_number_are_refused(tmp_path):
    path = tmp_path / "m.obj"
    path.write_text("v 0\nv 1\nv 2\nf 1 2 3\n")
    with pytest.raises(MeshError):
        load_triangles(MeshFile(path))


def test_too_many_triangles_of_a_link_are_refused(tmp_path):
    path = tmp_path / "m.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\n" + "f 1 2 3\n" * 300_001)
    with pytest.raises(MeshError, match="has 300,001 triangles; the limit is 300,000"):
        load_triangles(MeshFile(path))


def test_a_mesh_has_no_other_file_read(tmp_path, monkeypatch):
    """A material file may be a pipe, a device or a secret."""
    os.mkfifo(tmp_path / "x.mtl")
    path = tmp_path / "m.obj"
    path.write_text(f"mtllib x.mtl\nusemtl a\n{OBJ}")
    assert len(load_triangles(MeshFile(path))) == 4


def test_too_many_links_are_refused(place):
    from armguard.robot import load_urdf

    links = "".join(f'<link name="l{k}"/>' for k in range(501))
    (place / "r.urdf").write_text(f'<robot name="r">{links}</robot>')
    with pytest.raises(ArmguardError, match="has 501 <link>; the limit is 500"):
        load_urdf(place / "r.urdf")


def test_an_entity_in_another_encoding_is_refused(place):
    from armguard.robot import load_urdf

    text = (
        '<?xml version="1.0" encoding="UTF-16"?><!DOCTYPE r [<!ENTITY a "b">]><robot/>'
    )
    (place / "r.urdf").write_bytes(text.encode("utf-16"))
    with pytest.raises(ArmguardError, match="has a DTD or entities"):
        load_urdf(place / "r.urdf")


def test_an_archive_is_refused_before_it_is_unpacked(monkeypatch):
    import zlib

    monkeypatch.setattr("armguard.scene.archive.MOST_UNPACKED", 10 << 20)
    bomb = zlib.compress(bytes(50_000_000))
    with pytest.raises(ArchiveError, match="unpacks to more than 10 MiB"):
        scene_of(bomb)
    with pytest.raises(ArchiveError):
        scene_of(zlib.compress(b"[" * 200_000))


def test_random_bytes_are_one_sentence(tmp_path):
    rng = np.random.default_rng(0)
    for k, suffix in enumerate([".yaml", ".csv", ".npz"] * 20):
        path = tmp_path / f"{k}{suffix}"
        path.write_bytes(rng.bytes(int(rng.integers(0, 400))))
        load = load_scene if suffix == ".yaml" else load_trajectory
        with pytest.raises(ArmguardError):
            load(path)
