"""MoveIt planning scenes, read as they are."""

from collections.abc import Mapping
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
from armguard.scene.meshes import Progress, Surface, mesh_parts
from armguard.scene.scene import Scene
from armguard.scene.yaml_source import SceneFileError, YamlSource

Floats = NDArray[np.float64]

# Type numbers of shape_msgs/SolidPrimitive, where a file has them in place of names.
PRIMITIVE_NAMES = {1: "box", 2: "sphere", 3: "cylinder", 4: "cone"}

# How many dimensions each has.
DIMENSIONS = {"box": 3, "sphere": 1, "cylinder": 2, "cone": 2}


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
        progress: Called with what is done, its number and their count, before
            anything that takes long.

    Raises:
        SceneFileError: The file holds something that cannot be guarded as it is.
    """
    values = source.values
    name = str(values.get("robot_model_name") or "robot")
    scene = Scene(mode="fixed")
    try:
        model = scene.add_robot(
            name if robot is None else robot, name=name, progress=progress
        ).model
    except ArmguardError as error:
        raise source.problem(
            source.line(("robot_model_name",)), "robot_model_name", str(error)
        ) from None
    state = (values.get("robot_state") or {}).get("joint_state") or {}
    place_home(scene, name, state)
    world = values.get("world") or {}
    for k, thing in enumerate(world.get("collision_objects") or []):
        keys = ("world", "collision_objects", k)
        try:
            add_object(scene, thing, progress)
        except (KeyError, TypeError, ValueError, ArmguardError) as error:
            what = f"has no {error}" if isinstance(error, KeyError) else str(error)
            raise source.problem(
                source.line(keys), f"world.collision_objects[{k}]", what
            ) from None
    octomap = world.get("octomap") or {}
    if (octomap.get("octomap") or octomap).get("data"):
        raise source.problem(
            source.line(("world", "octomap")),
            "world.octomap",
            "an octomap cannot be guarded; give its occupied boxes as objects",
        )
    allow_matrix(scene, source, name, set(model.links))
    return scene


def place_home(scene: Scene, name: str, state: Mapping[str, Any]) -> None:
    """Take the file's robot state for home, if it is one a robot was in.

    MoveIt writes zeros where no state was set, and many robots cannot be there: such
    a state is left out with a note, and the robot keeps its own home.
    """
    robot = scene.robots[name]
    positions = {
        str(joint): float(value)
        for joint, value in zip(
            state.get("name") or [], state.get("position") or [], strict=False
        )
        if joint in robot.home
    }
    if not any(positions.values()):
        if positions:
            scene.notes.append(
                "the file's robot state is all zeros, as MoveIt writes where nobody "
                "set one; the robot's own home is used"
            )
        return
    outside = [
        f"{joint} at {value:g}"
        for joint, value in positions.items()
        if not robot.model.joints[joint].lower
        <= value
        <= robot.model.joints[joint].upper
    ]
    if outside:
        scene.notes.append(
            "the file's robot state is outside the joint limits ("
            + ", ".join(outside)
            + "); the robot's own home is used"
        )
        return
    scene.set_home(name, {**robot.home, **positions})


def add_object(
    scene: Scene, thing: Mapping[str, Any], progress: Progress | None
) -> None:
    """Add one collision object; nothing of it is dropped.

    Raises:
        SceneError: It has an unknown primitive, or more or fewer poses than
            things to place.
    """
    name = str(thing["id"])
    parts: list[PlacedShape | Surface] = []
    for primitive, T in placed(name, thing, "primitives", "primitive_poses"):
        shape = primitive_shape(name, primitive)
        parts.append(PlacedShape(shape, Pose.from_matrix(T)))
    for plane, T in placed(name, thing, "planes", "plane_poses"):
        shape, inner = half_space(name, plane)
        parts.append(PlacedShape(shape, Pose.from_matrix(T @ inner)))
    for mesh, T in placed(name, thing, "meshes", "mesh_poses"):
        parts += mesh_parts(
            mesh_arrays(name, mesh), pose=Pose.from_matrix(T), progress=progress
        )
    own = thing.get("pose")
    scene.add(
        parts,
        name=name,
        pose=Pose() if own is None else Pose.from_matrix(pose_matrix(own)),
    )


def placed(
    name: str, thing: Mapping[str, Any], what: str, where: str
) -> list[tuple[Any, Floats]]:
    """Things of one list of a collision object with their frames, shape (4, 4)."""
    things, poses = thing.get(what) or [], thing.get(where) or []
    if len(things) != len(poses):
        raise SceneError(
            f"object '{name}' has {len(things)} {what} and {len(poses)} poses"
        )
    return [(t, pose_matrix(p)) for t, p in zip(things, poses, strict=True)]


def allow_matrix(scene: Scene, source: YamlSource, name: str, links: set[str]) -> None:
    """Allowances of the allowed collision matrix.

    Raises:
        SceneFileError: The matrix is not square and symmetric.
    """
    matrix = source.values.get("allowed_collision_matrix") or {}
    entries = [str(entry) for entry in matrix.get("entry_names") or []]
    rows = matrix.get("entry_values") or []
    if len(rows) != len(entries) or any(len(row_of(r)) != len(entries) for r in rows):
        raise problem(
            source, f"has {len(entries)} names, its values are not as many each way"
        )
    foreign = [e for e in entries if e not in links and e not in scene.objects]
    for i, a in enumerate(entries):
        for j in range(i + 1, len(entries)):
            b = entries[j]
            if bool(row_of(rows[i])[j]) != bool(row_of(rows[j])[i]):
                raise problem(source, f"says two things about '{a}' and '{b}'")
            if row_of(rows[i])[j] and a not in foreign and b not in foreign:
                scene.allow(
                    f"{name}/{a}" if a in links else a,
                    f"{name}/{b}" if b in links else b,
                    reason=f"allowed_collision_matrix of {source.path.name}",
                )
    if foreign:
        scene.notes.append(
            "the allowed collision matrix names "
            + ", ".join(f"'{f}'" for f in foreign)
            + ", which nobody has; those rows are left out"
        )


def row_of(row: Any) -> list[Any]:
    """A row of the matrix: a list, or MoveIt's message with `enabled`."""
    return list(row["enabled"]) if isinstance(row, Mapping) else list(row)


def problem(source: YamlSource, sentence: str) -> SceneFileError:
    """An error about the matrix."""
    key = "allowed_collision_matrix"
    return source.problem(source.line((key,)), key, sentence)


def pose_matrix(pose: Mapping[str, Any]) -> Floats:
    """A MoveIt pose; its quaternions are x y z w. Shape (4, 4)."""
    x, y, z = map(float, in_order(pose["position"], "xyz"))
    qx, qy, qz, qw = map(float, in_order(pose["orientation"], "xyzw"))
    return Pose.from_quat_wxyz((qw, qx, qy, qz), (x, y, z)).matrix()


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
    kind = PRIMITIVE_NAMES.get(primitive["type"], primitive["type"])
    sizes = [float(v) for v in primitive["dimensions"]]
    if kind not in DIMENSIONS:
        raise SceneError(
            f"object '{name}' has a primitive of type '{kind}'; known types are "
            + ", ".join(DIMENSIONS)
        )
    if len(sizes) != DIMENSIONS[kind]:
        raise SceneError(
            f"object '{name}': a {kind} has {DIMENSIONS[kind]} dimensions, this one "
            f"{len(sizes)}"
        )
    if kind == "box":
        x, y, z = (size / 2 for size in sizes)
        return Box(half_extents=(x, y, z))
    if kind == "sphere":
        return Sphere(radius=sizes[0])
    height, radius = sizes
    if kind == "cylinder":
        return Cylinder(radius=radius, height=height)
    return Cone(radius=radius, height=height)


def half_space(name: str, plane: Mapping[str, Any]) -> tuple[HalfSpace, Floats]:
    """A shape_msgs/Plane, a·x + b·y + c·z + d = 0, as the solid below it.

    MoveIt's plane is thin; what lies on the side its normal points away from counts as
    solid here, which errs only towards "nearer".

    Returns:
        The shape, and its frame in the plane's, shape (4, 4).

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
    z = coefficients[:3] / length
    x = np.cross(np.eye(3)[int(np.argmin(np.abs(z)))], z)
    x /= np.linalg.norm(x)
    T = np.eye(4)
    T[:3, :3] = np.column_stack([x, np.cross(z, x), z])
    T[:3, 3] = -coefficients[3] / length * z
    return HalfSpace(), T


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
