"""MoveIt planning scenes, read as they are."""

from collections.abc import Callable, Mapping
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armguard.errors import ArmguardError, SceneError
from armguard.geometry.pose import Pose
from armguard.geometry.shapes import (
    Box,
    Cone,
    Cylinder,
    HalfSpace,
    PlacedShape,
    Shape,
    Sphere,
)
from armguard.robot.fitting.overreach import frame_along
from armguard.scene.meshes import Progress, Surface, mesh_parts
from armguard.scene.scene import Scene
from armguard.scene.yaml_source import YamlSource

Floats = NDArray[np.float64]

# Solids by their name: how many dimensions each has, and its shape.
SOLIDS: dict[str, tuple[int, Callable[..., Shape]]] = {
    "box": (3, lambda x, y, z: Box(size=(x, y, z))),
    "sphere": (1, lambda radius: Sphere(radius=radius)),
    "cylinder": (2, lambda height, radius: Cylinder(radius=radius, height=height)),
    "cone": (2, lambda height, radius: Cone(radius=radius, height=height)),
}

# Lists of shapes of a collision object, and of their poses.
LISTS = (
    ("primitives", "primitive_poses"),
    ("planes", "plane_poses"),
    ("meshes", "mesh_poses"),
)

# Their numbers in shape_msgs/SolidPrimitive, where a file has these in place of names.
NUMBERED = dict(enumerate(SOLIDS, start=1))


def is_moveit_scene(values: Any) -> bool:
    """Whether a YAML file is a MoveIt planning scene."""
    return isinstance(values, Mapping) and (
        "robot_model_name" in values
        or (isinstance(values.get("world"), Mapping) and "robots" not in values)
    )


def build_moveit_scene(
    source: YamlSource,
    *,
    robot: str | Path | None = None,
    progress: Progress | None = None,
) -> Scene:
    """A scene of one robot, named as the file names its model.

    The allowed collision matrix becomes allowances with the file as their reason. The
    mode is "fixed": the file says nothing of how its robot stops.

    Args:
        source: The file.
        robot: The URDF; by default the robot of the model's name.
        progress: Called with the step, its number and their count, before
            anything that takes long.

    Raises:
        SceneFileError: The file holds something that cannot be guarded as it is.
    """
    values = source.values
    name = str(values.get("robot_model_name") or "robot")
    scene = Scene(mode="fixed")
    try:
        scene.add_robot(robot or name, name=name, progress=progress)
    except ArmguardError as error:
        raise source.problem(("robot_model_name",), str(error)) from None
    state = (values.get("robot_state") or {}).get("joint_state") or {}
    place_home(scene, name, state)
    world = values.get("world") or {}
    for k, entry in enumerate(world.get("collision_objects") or []):
        try:
            add_object(scene, entry, progress)
        except (KeyError, TypeError, ValueError, ArmguardError) as error:
            what = f"has no {error}" if isinstance(error, KeyError) else str(error)
            raise source.problem(("world", "collision_objects", k), what) from None
    octomap = world.get("octomap") or {}
    if (octomap.get("octomap") or octomap).get("data"):
        raise source.problem(
            ("world", "octomap"),
            "an octomap cannot be guarded; give its occupied boxes as objects",
        )
    allow_matrix(scene, source, name)
    return scene


def place_home(scene: Scene, name: str, state: Mapping[str, Any]) -> None:
    """Take the file's robot state for home, if it is one a robot was in.

    MoveIt writes zeros where no state was set, and many robots cannot be there: such
    a state is left out with a note, and the robot keeps its own home.
    """
    robot = scene.robots[name]
    given = zip(state.get("name") or [], state.get("position") or [], strict=False)
    positions = {str(j): float(value) for j, value in given if j in robot.home}
    if not any(positions.values()):
        if positions:
            scene.notes.append(
                "the file's robot state is all zeros, as MoveIt writes where none "
                "was set; the robot's own home is used"
            )
        return
    joints = robot.model.joints
    outside = [
        f"{name} at {value:g}"
        for name, value in positions.items()
        if not joints[name].lower <= value <= joints[name].upper
    ]
    if outside:
        scene.notes.append(
            f"the file's robot state is outside the joint limits ({', '.join(outside)})"
            "; the robot's own home is used"
        )
        return
    scene.set_home(name, {**robot.home, **positions})


def add_object(
    scene: Scene, entry: Mapping[str, Any], progress: Progress | None
) -> None:
    """Add one collision object; nothing of it is dropped.

    Raises:
        SceneError: It has an unknown primitive, or more or fewer poses than
            shapes to place.
    """
    name = str(entry["id"])
    parts: list[PlacedShape | Surface] = []
    for what, where in LISTS:
        shapes, poses = entry.get(what) or [], entry.get(where) or []
        if len(shapes) != len(poses):
            raise SceneError(
                f"object '{name}' has {len(shapes)} {what} and {len(poses)} poses"
            )
        for shape, pose in zip(shapes, poses, strict=True):
            T = pose_matrix(pose)
            if what == "meshes":
                mesh, place = mesh_arrays(name, shape), Pose.from_matrix(T)
                parts += mesh_parts(mesh, pose=place, progress=progress)
            elif what == "planes":
                parts.append(half_space(name, shape, T))
            else:
                solid = primitive_shape(name, shape)
                parts.append(PlacedShape(solid, Pose.from_matrix(T)))
    own = entry.get("pose")
    pose = None if own is None else Pose.from_matrix(pose_matrix(own))
    scene.add(parts, name=name, pose=pose)


def allow_matrix(scene: Scene, source: YamlSource, name: str) -> None:
    """Allowances of the allowed collision matrix, of the robot of that name.

    Raises:
        SceneFileError: The matrix is not square and symmetric.
    """
    key = "allowed_collision_matrix"
    matrix = source.values.get(key) or {}
    entries = [str(entry) for entry in matrix.get("entry_names") or []]
    # A row is a list, or MoveIt's message with `enabled`.
    rows = [
        list(row["enabled"] if isinstance(row, Mapping) else row)
        for row in matrix.get("entry_values") or []
    ]
    if len(rows) != len(entries) or any(len(row) != len(entries) for row in rows):
        raise source.problem(
            (key,), f"has {len(entries)} names, its values are not as many each way"
        )
    body = {entry: entry for entry in scene.objects}
    body |= {link: f"{name}/{link}" for link in scene.robots[name].model.links}
    for (i, a), (j, b) in combinations(enumerate(entries), 2):
        if bool(rows[i][j]) != bool(rows[j][i]):
            raise source.problem((key,), f"has two values for '{a}' and '{b}'")
        if rows[i][j] and a in body and b in body:
            reason = f"{key} of {source.path.name}"
            scene.allow(body[a], body[b], reason=reason)
    foreign = [f"'{entry}'" for entry in entries if entry not in body]
    if foreign:
        scene.notes.append(
            f"the allowed collision matrix names {', '.join(foreign)}, which are no "
            "body of the scene; those rows are left out"
        )


def pose_matrix(pose: Mapping[str, Any]) -> Floats:
    """A MoveIt pose; its quaternions are x y z w. Shape (4, 4)."""
    x, y, z = map(float, in_order(pose["position"], "xyz"))
    quaternion = [*map(float, in_order(pose["orientation"], "xyzw"))]
    return Pose(xyz=(x, y, z), quat_xyzw=quaternion).matrix()


def in_order(values: Any, keys: str) -> list[Any]:
    """Numbers that stand in a list, or in a mapping by letter."""
    return [values[k] for k in keys] if isinstance(values, Mapping) else list(values)


def primitive_shape(name: str, primitive: Mapping[str, Any]) -> Shape:
    """Our shape for a shape_msgs/SolidPrimitive of an object.

    Cylinders and cones are `height, radius` along z about the middle of their height;
    the tip of a cone is at the upper end.

    Raises:
        SceneError: The type is unknown, or the dimensions do not belong to it.
        ShapeError: A size is negative, zero or not finite.
    """
    kind = NUMBERED.get(primitive["type"], primitive["type"])
    sizes = [float(v) for v in primitive["dimensions"]]
    if kind not in SOLIDS:
        raise SceneError(
            f"object '{name}' has a primitive of type '{kind}'; known types are "
            + ", ".join(SOLIDS)
        )
    count, made = SOLIDS[kind]
    if len(sizes) != count:
        raise SceneError(
            f"object '{name}': a {kind} has {count} dimensions, this one {len(sizes)}"
        )
    return made(*sizes)


def half_space(name: str, plane: Mapping[str, Any], T_plane: Floats) -> PlacedShape:
    """A shape_msgs/Plane, a·x + b·y + c·z + d = 0, as the solid below it.

    MoveIt's plane is thin; what lies on the side its normal points away from counts as
    solid here, which errs only towards "nearer".

    Args:
        name: The object's name, for messages.
        plane: The plane.
        T_plane: Its frame in the object's, shape (4, 4).

    Raises:
        SceneError: The coefficients are not four finite numbers with a normal.
    """
    coefficients = np.array([float(v) for v in plane["coef"]])
    length = float(np.linalg.norm(coefficients[:3]))
    if len(coefficients) != 4 or not np.isfinite(coefficients).all() or length == 0.0:
        raise SceneError(
            f"object '{name}' has a plane with coef {coefficients.tolist()}; it must "
            "be a, b, c, d of a·x + b·y + c·z + d = 0 with a normal that is not 0"
        )
    T = np.eye(4)
    T[:3, :3] = frame_along(coefficients[:3])
    T[:3, 3] = -coefficients[3] / length * T[:3, 2]
    return PlacedShape(HalfSpace(), Pose.from_matrix(T_plane @ T))


def mesh_arrays(name: str, mesh: Mapping[str, Any]) -> tuple[Floats, NDArray[np.int64]]:
    """Vertices, shape (v, 3) [m], and faces, shape (n, 3), of a shape_msgs/Mesh.

    Raises:
        SceneError: It is no list of triangles and vertices.
    """
    try:
        vertices = [in_order(v, "xyz") for v in mesh["vertices"]]
        faces = [
            list(t["vertex_indices"] if isinstance(t, Mapping) else t)
            for t in mesh["triangles"]
        ]
        return (
            np.array(vertices, dtype=np.float64).reshape(-1, 3),
            np.array(faces, dtype=np.int64).reshape(-1, 3),
        )
    except (KeyError, TypeError, ValueError):
        raise SceneError(
            f"object '{name}' has a mesh that is not `triangles` of three "
            "`vertex_indices` and `vertices` of x, y, z"
        ) from None
