"""Promises about the package as a whole."""

import os
import subprocess
import sys
from pathlib import Path

import armguard

ROOT = Path(__file__).parents[1]

PROBE = """
import numpy as np
from armguard.geometry import ShapeKind
from armguard.geometry.pairs import measure
from worlds import random_pose, random_shape
from armguard.geometry.shapes import shape_row
rng, out = np.random.default_rng(0), np.zeros(10)
numbers = [k for k in ShapeKind if k != ShapeKind.SUPPORT]
for kinds in [(a, b) for a in numbers for b in numbers if a <= b]:
    for _ in range(6):
        shapes = [random_shape(rng, k, 0.4) for k in kinds]
        rows = [shape_row(shape, random_pose(rng)) for shape in shapes]
        measure(int(kinds[0]), rows[0], int(kinds[1]), rows[1], out)
        print(kinds[0].name, kinds[1].name, *(f"{v:.12e}" for v in out))
"""


# Reads a mesh of each format, the COLLADA one with nested nodes, and builds a guard of
# them, in a process that cannot import networkx, which trimesh uses where it is there.
WITHOUT_NETWORKX = """
import sys
sys.modules["networkx"] = None
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory
import collada as c
import trimesh
from collada.source import FloatSource, InputList
from armguard.robot.meshes import FORMATS
import armguard as ag
box = trimesh.creation.box((0.1, 0.1, 0.2))
part = c.Collada()
source = FloatSource("p", box.vertices.ravel(), ("X", "Y", "Z"))
mesh = c.geometry.Geometry(part, "g", "g", [source])
inputs = InputList()
inputs.addInput(0, "VERTEX", "#p")
mesh.primitives.append(mesh.createTriangleSet(box.faces.ravel(), inputs, "m"))
part.geometries.append(mesh)
at = c.scene.GeometryNode(mesh)
node = c.scene.Node("n", [at], [c.scene.TranslateTransform(0, 0, 1)])
outer = c.scene.Node("o", [node, at])
part.scenes.append(c.scene.Scene("s", [outer]))
part.scene = part.scenes[0]
scene = ag.Scene(mode="fixed")
with TemporaryDirectory() as folder:
    for k, kind in enumerate(FORMATS):
        path = Path(folder) / f"part{kind}"
        if kind == ".dae":
            part.write(str(path))
        else:
            box.export(path)
        urdf = Path(folder) / "robot.urdf"
        urdf.write_text(
            f'<robot name="r{k}"><link name="base"/><link name="tip"><collision>'
            f'<geometry><mesh filename="{path}"/></geometry></collision></link>'
            '<joint name="j" type="revolute"><parent link="base"/><child link="tip"/>'
            '<axis xyz="0 0 1"/><limit lower="-1" upper="1" velocity="1" effort="9"/>'
            "</joint></robot>"
        )
        scene.add_robot(urdf, name=kind[1:], base=ag.Pose(xyz=(k, 0, 0)))
    guard = ag.Guard(scene, self_test=False)
print(guard.step(guard.home).level.name, *FORMATS)
"""


def output(program, **environment):
    return subprocess.run(
        [sys.executable, "-c", program],
        check=True,
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONPATH": str(ROOT / "tests"), **environment},
    ).stdout


def test_importing_compiles_and_loads_nothing_heavy():
    loaded = output("import sys, armguard; print(*sys.modules)").split()
    assert not {"numba", "scipy", "trimesh", "pydantic", "typer"} & set(loaded)


def test_meshes_of_all_formats_are_read_without_networkx():
    assert output(WITHOUT_NETWORKX) == "CLEAR .stl .obj .dae .ply\n"


def test_interpreted_kernels_answer_as_compiled_ones():
    compiled = output(PROBE).splitlines()
    interpreted = output(PROBE, NUMBA_DISABLE_JIT="1").splitlines()
    assert len(compiled) == 45 * 6
    for one, two in zip(compiled, interpreted, strict=True):
        for a, b in zip(one.split()[2:], two.split()[2:], strict=True):
            assert a == b or abs(float(a) - float(b)) < 1e-11, (one, two)


def test_public_names_exist():
    for name in armguard.__all__:
        assert getattr(armguard, name) is not None


def test_the_kernel_cache_follows_every_source(tmp_path, monkeypatch):
    import shutil

    from armguard import kernel

    copy = tmp_path / "armguard"
    shutil.copytree(kernel.PACKAGE, copy, ignore=shutil.ignore_patterns("*.pyc"))
    monkeypatch.setattr(kernel, "PACKAGE", copy)
    before = kernel.kernel_digest()
    vec3 = copy / "geometry" / "vec3.py"
    vec3.write_text(vec3.read_text() + "\n# edited\n")
    after = kernel.kernel_digest()
    assert after != before
    # Kernels take constants from files that hold no kernel.
    watch = copy / "guard" / "watch.py"
    assert b"@kernel" not in watch.read_bytes()
    watch.write_text(watch.read_text() + "\n# edited\n")
    assert kernel.kernel_digest() != after
    after = kernel.kernel_digest()
    serve = copy / "cli" / "serve.py"
    serve.write_text(serve.read_text() + "\n# edited\n")
    assert kernel.kernel_digest() == after


def test_no_file_holds_the_marks_of_a_merge():
    marks = ("<" * 7 + " ", ">" * 7 + " ")
    for path in [
        *ROOT.glob("*.md"),
        *ROOT.glob("docs/*.md"),
        *ROOT.rglob("src/**/*.py"),
    ]:
        for line in path.read_text(encoding="utf-8").splitlines():
            assert not line.startswith(marks), path
