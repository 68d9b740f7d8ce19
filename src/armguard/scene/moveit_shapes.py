"""Shapes of MoveIt's messages: solid primitives, planes, meshes, poses."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armguard.errors import SceneError
from armguard.geometry.pose import Pose
from armguard.geometry.shapes import (
    Box,
    Cone,
    Cylinder,
    HalfSpace,
    Shape,
    Sphere,
)

Floats = NDArray[np.float64]

# Type numbers of shape_msgs/SolidPrimitive, where a file has them in place of names.
PRIMITIVE_NAMES = {1: "box", 2: "sphere", 3: "cylinder", 4: "cone"}

# How many dimensions each has.
DIMENSIONS = {"box": 3, "sphere": 1, "cylinder": 2, "cone": 2}


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
