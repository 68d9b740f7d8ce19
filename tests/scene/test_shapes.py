"""Every shape in scene files and in MoveIt's, as what it is."""

from pathlib import Path

import numpy as np
import pytest

from armguard.errors import SceneError
from armguard.geometry import (
    Box,
    Capsule,
    Cone,
    Cylinder,
    Ellipsoid,
    HalfSpace,
    Hull,
    PlacedShape,
    Pose,
    ShapeKind,
    Sphere,
)
from armguard.scene import Scene, compile_scene, load_scene
from armguard.scene.bay import FOLDER
from armguard.scene.yaml_source import SceneFileError

PUBLIC = Path(__file__).parents[2].parent / "shared" / "motionbench"
needs_public = pytest.mark.skipif(
    not PUBLIC.is_dir(), reason="the public planning scenes are not here"
)

ARM = f"robots:\n  arm: {{urdf: {FOLDER / 'bay_arm.urdf'}, mode: fixed}}\n"

CORNERS = [[0, 0, 0], [0.1, 0, 0], [0, 0.1, 0], [0, 0, 0.1]]

ENTRIES = {
    "sphere: {radius: 0.1, rounding: 0.01}": Sphere(radius=0.1, rounding=0.01),
    "capsule: {length: 0.4, radius: 0.1}": Capsule(
        start=(0, 0, -0.2), end=(0, 0, 0.2), radius=0.1
    ),
    "box: {size: [2, 4, 6], rounding: 0.1}": Box(size=(2, 4, 6), rounding=0.1),
    "cylinder: {radius: 0.2, height: 0.6, rounding: 0.01}": Cylinder(
        radius=0.2, height=0.6, rounding=0.01
    ),
    "cylinder: {radius: 0.2, length: 0.6}": Cylinder(radius=0.2, height=0.6),
    "cone: {radius: 0.2, height: 0.5}": Cone(radius=0.2, height=0.5),
    "cone: {radius: 0.2, height: 0.5, top_radius: 0.1, rounding: 0.02}": Cone(
        radius=0.2, height=0.5, top_radius=0.1, rounding=0.02
    ),
    "ellipsoid: {semi_axes: [0.1, 0.2, 0.3], rounding: 0.01}": Ellipsoid(
        semi_axes=(0.1, 0.2, 0.3), rounding=0.01
    ),
    "half_space: {}": HalfSpace(),
    "plane: {rounding: 0.05}": HalfSpace(rounding=0.05),
    f"hull: {{points: {CORNERS}, rounding: 0.01}}": Hull(points=CORNERS, rounding=0.01),
}


def write(tmp_path, text):
    path = tmp_path / "scene.yaml"
    path.write_text(text)
    return path


@pytest.mark.parametrize("entry", ENTRIES)
def test_an_entry_becomes_the_shape_itself(tmp_path, entry):
    text = f"{ARM}objects:\n  thing: {{{entry}, at: {{xyz: [9, 0, 0]}}}}\n"
    scene = load_scene(write(tmp_path, text))
    item = scene.objects["thing"]
    (placed,) = item.shapes
    assert same(placed.shape, ENTRIES[entry])
    assert (placed.model_error, item.pose.xyz) == (0.0, (9, 0, 0))
    tables = compile_scene(scene)
    assert tables.kinds[-1] == placed.shape.kind
    assert tables.labels[-1] == "thing"
    assert np.isfinite([*tables.cube_centre, tables.cube_edge]).all()


def same(a, b):
    """Whether two shapes are equal; hulls compare by their corners."""
    if isinstance(b, Hull):
        return np.array_equal(a.vertices, b.vertices) and a.rounding == b.rounding
    return a == b


def test_every_shape_may_be_part_of_a_union_and_ride_on_a_link(tmp_path):
    parts = ", ".join(f"{{{e}, at: {{xyz: [0, 0, 0.1]}}}}" for e in ENTRIES)
    text = f"{ARM}objects:\n  tool: {{union: [{parts}], attached_to: arm/link7}}\n"
    scene = load_scene(write(tmp_path, text))
    shapes = [placed.shape for placed in scene.objects["tool"].shapes]
    assert all(map(same, shapes, ENTRIES.values()))
    tables = compile_scene(scene)
    assert tables.moving_count == len(tables.kinds)
    assert np.isfinite(tables.cube_edge)


def test_a_plane_lies_where_its_frame_says(tmp_path):
    text = f"{ARM}objects:\n  wall: {{plane: {{}}, at: {{xyz: [2, 0, 0], rpy: "
    text += "[0, -1.5707963267948966, 0]}}\n"
    row = compile_scene(load_scene(write(tmp_path, text))).local_rows[-1]
    assert row[1:7] == pytest.approx([2, 0, 0, -1, 0, 0])


WRONG = {
    "height and length": (
        "cylinder: {radius: 1, height: 1, length: 1}",
        ":4: objects.b.cylinder: needs `height`, or `length`, its other name, not both",
    ),
    "no height": ("cylinder: {radius: 1}", ":4: objects.b.cylinder: needs `height`"),
    "flat cone": (
        "cone: {radius: 1, height: 0}",
        ":4: objects.b.cone.height: is 0; it must be > 0",
    ),
    "negative top": (
        "cone: {radius: 1, height: 1, top_radius: -1}",
        "objects.b.cone.top_radius: is -1; it must be >= 0",
    ),
    "two axes": (
        "ellipsoid: {semi_axes: [1, 2]}",
        "objects.b.ellipsoid.semi_axes: expected 3 numbers, got 2",
    ),
    "infinite axis": (
        "ellipsoid: {semi_axes: [1, .inf, 1]}",
        "objects.b.ellipsoid.semi_axes[1]: is inf; it must be finite",
    ),
    "sized plane": (
        "plane: {size: 1}",
        "objects.b.plane.size: there is no such key; known names are 'rounding'",
    ),
    "no points": ("hull: {points: []}", "objects.b.hull.points: needs at least 1"),
    "flat point": (
        "hull: {points: [[0, 0, 0], [1, 2]]}",
        "objects.b.hull.points[1]: expected 3 numbers, got 2",
    ),
    "nan point": (
        "hull: {points: [[0, 0, .nan]]}",
        "objects.b.hull.points[0][2]: is nan; it must be finite",
    ),
    "two sources": (
        "hull: {points: [[0, 0, 0]], mesh: a.stl}",
        "objects.b.hull: needs `points` or `mesh`, not both",
    ),
    "scaled points": (
        "hull: {points: [[0, 0, 0]], scale: 2}",
        "objects.b.hull: has `scale`, which is that of a mesh; leave it out",
    ),
    "no file": ("mesh: {}", "objects.b.mesh.file: is missing"),
    "absent file": (
        "mesh: {file: none.stl}",
        ":4: objects.b: mesh 'none.stl' is not there:",
    ),
    "scale of zero": (
        "mesh: {file: a.stl, scale: 0}",
        "objects.b.mesh.scale: is [0.0, 0.0, 0.0]; a mesh cannot be scaled by 0",
    ),
    "unknown form": (
        "mesh: {file: a.stl, as: boxes}",
        "objects.b.mesh.as: is 'boxes'; it must be 'triangles', 'hull' or 'pieces'",
    ),
    "concavity of triangles": (
        "mesh: {file: a.stl, concavity: 0.1}",
        "objects.b.mesh: has `concavity`, which is for `as: pieces`",
    ),
    "concavity too small": (
        "mesh: {file: a.stl, as: pieces, concavity: 0.001}",
        "objects.b.mesh.concavity: is 0.001; it must be >= 0.01",
    ),
    "two shapes": (
        "cone: {radius: 1, height: 1}, plane: {}",
        "objects.b: has cone and plane; give exactly one of sphere, capsule, box, "
        "cylinder, cone, ellipsoid, half_space, plane, hull, mesh, union",
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_a_wrong_entry_is_named_with_line_and_key(tmp_path, case):
    entry, says = WRONG[case]
    with pytest.raises(SceneFileError) as caught:
        load_scene(write(tmp_path, f"{ARM}objects:\n  b: {{{entry}}}\n"))
    assert str(caught.value).startswith("scene.yaml")
    assert says in str(caught.value)


@pytest.mark.parametrize("size", [1e-9, 1e-3, 1.0, 1e6])
def test_any_size_is_legal(size):
    s = size
    corners = s * np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)])
    shapes = [
        Sphere(radius=s, rounding=s),
        Capsule(start=(0, 0, 0), end=(s, s, s), radius=s, rounding=s),
        Box(size=(2 * s, 4 * s, 6 * s), rounding=s),
        Cylinder(radius=s, height=s, rounding=s),
        Cone(radius=s, height=s, top_radius=s / 2, rounding=s),
        Ellipsoid(semi_axes=(s, 2 * s, 3 * s), rounding=s),
        Hull(points=corners, rounding=s),
        HalfSpace(rounding=s),
    ]
    scene = Scene(mode="fixed")
    scene.add_robot(FOLDER / "bay_arm.urdf", name="arm")
    scene.add(shapes, name="all", pose=Pose(xyz=(4 * s, 0, 0)))
    scene.add_mesh((corners, np.array([[0, 1, 2], [0, 1, 3]])), name="mesh")
    scene.add_mesh(
        (corners, np.array([[0, 1, 2], [0, 1, 3]])), name="hull", form="hull"
    )
    tables = compile_scene(scene)
    assert np.isfinite(tables.local_rows).all()
    assert np.isfinite(tables.cube_edge)
    assert tables.cube_edge >= size
    assert set(tables.kinds) == set(ShapeKind) - {ShapeKind.SUPPORT}


@pytest.mark.parametrize("count", [1, 2, 3])
def test_a_hull_of_few_points_is_legal(tmp_path, count):
    text = f"{ARM}objects:\n  b: {{hull: {{points: {CORNERS[:count]}}}}}\n"
    (placed,) = load_scene(write(tmp_path, text)).objects["b"].shapes
    assert len(placed.shape.vertices) == count


def test_tables_keep_what_their_rows_lead_to():
    scene = Scene(mode="fixed")
    scene.add_robot(FOLDER / "bay_arm.urdf", name="arm")
    hull = Hull(points=CORNERS)
    scene.add([hull, Sphere(radius=1)], name="thing", pose=Pose(xyz=(5, 0, 0)))
    assert compile_scene(scene).shapes == (hull,)


MOVEIT = """robot_model_name: panda
world:
  collision_objects:
    - id: thing
      {0}
      pose: {position: [0, 0, 1], orientation: [0, 0, 0, 1]}
"""

AT = "{position: [1, 2, 3], orientation: [0, 0, 0, 1]}"

SQUARE = "{vertices: [{x: 0, y: 0, z: 0}, {x: 1, y: 0, z: 0}, [0, 1, 0]], "
SQUARE += "triangles: [{vertex_indices: [0, 1, 2]}, [0, 2, 1]]}"


def moveit(tmp_path, inner):
    path = tmp_path / "s.yaml"
    path.write_text(MOVEIT.replace("{0}", inner))
    return load_scene(path).objects["thing"]


def test_moveit_cylinders_and_cones_are_true(tmp_path):
    inner = (
        "primitives: [{type: cylinder, dimensions: [0.4, 0.1]}, "
        "{type: 4, dimensions: [0.5, 0.2]}]\n"
        f"      primitive_poses: [{AT}, {AT}]"
    )
    cylinder, cone = moveit(tmp_path, inner).shapes
    pose = Pose(xyz=(1, 2, 3))
    assert cylinder == PlacedShape(Cylinder(radius=0.1, height=0.4), pose)
    assert cone == PlacedShape(Cone(radius=0.2, height=0.5), pose)


def test_moveit_planes_are_solid_below(tmp_path):
    inner = f"planes: [{{coef: [0, 3, 4, -10]}}]\n      plane_poses: [{AT}]"
    (placed,) = moveit(tmp_path, inner).shapes
    assert placed.shape == HalfSpace()
    T = placed.pose.matrix()
    assert T[:3, 2] == pytest.approx([0, 0.6, 0.8])
    assert T[:3, 2] @ (T[:3, 3] - (1, 2, 3)) == pytest.approx(2.0)


def test_moveit_meshes_are_their_triangles(tmp_path):
    inner = f"meshes: [{SQUARE}]\n      mesh_poses: [{AT}]"
    item = moveit(tmp_path, inner)
    (surface,) = item.surfaces
    assert surface.triangles[0] == pytest.approx(
        np.array([[1, 2, 3], [2, 2, 3], [1, 3, 3]])
    )
    assert (len(surface), item.shapes, item.pose.xyz) == (2, (), (0, 0, 1))


@pytest.mark.parametrize(
    ("inner", "says"),
    [
        ("meshes: [{}]", "object 'thing' has 1 meshes and 0 poses"),
        (f"mesh_poses: [{AT}]", "object 'thing' has 0 meshes and 1 poses"),
        (f"meshes: [{{}}]\n      mesh_poses: [{AT}]", "has a mesh that is not `tri"),
        (
            f"meshes: [{{vertices: [], triangles: []}}]\n      mesh_poses: [{AT}]",
            "has no triangle",
        ),
        (
            f"planes: [{{coef: [0, 0, 0, 1]}}]\n      plane_poses: [{AT}]",
            "plane with coef [0.0, 0.0, 0.0, 1.0]; it must be a, b, c, d",
        ),
        (
            "primitives: [{type: cylinder, dimensions: [1]}]\n"
            f"      primitive_poses: [{AT}]",
            "object 'thing': a cylinder has 2 dimensions, this one 1",
        ),
        (
            "primitives: [{type: cone, dimensions: [1, -1]}]\n"
            f"      primitive_poses: [{AT}]",
            "Cone radius is -1.0 m; it must be finite and > 0",
        ),
    ],
)
def test_what_moveit_cannot_mean_is_reported(tmp_path, inner, says):
    with pytest.raises(SceneError) as caught:
        moveit(tmp_path, inner)
    assert "s.yaml:4: world.collision_objects[0]: " in str(caught.value)
    assert says in str(caught.value)


@needs_public
def test_all_cylinders_of_the_public_scenes_are_true():
    files = sorted(PUBLIC.glob("*_*/scene*.yaml"))
    assert len(files) == 30
    written, true, boxes = 0, 0, 0
    for path in files:
        written += path.read_text().count("type: cylinder")
        for item in load_scene(path).objects.values():
            for placed in item.shapes:
                assert isinstance(placed.shape, Box | Cylinder)
                assert (placed.model_error, placed.shape.rounding) == (0.0, 0.0)
                true += isinstance(placed.shape, Cylinder)
                boxes += isinstance(placed.shape, Box)
    assert (true, boxes) == (140, 200)
    assert written == true
