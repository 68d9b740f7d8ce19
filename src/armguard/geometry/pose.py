"""Poses of frames: rigid transforms at the edges, 3×4 rows in kernels.

`T_a_b` takes coordinates in b to coordinates in a: x_a = T_a_b · x_b.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import atan2, cos, isfinite, pi, radians, sin, sqrt
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armguard.errors import PoseError

# Largest deviation of RᵀR from the identity that counts as rounding of a file's
# six printed digits [-].
ORTHOGONAL_TOLERANCE = 1e-5


# More than two turns is no orientation anyone writes in radians [rad].
LOOKS_LIKE_DEGREES = 4 * pi

# Largest deviation of a quaternion's norm from 1 that counts as rounding [-].
UNIT_TOLERANCE = 1e-3


@dataclass(frozen=True, slots=True, init=False)
class Pose:
    """Position and orientation of a frame in its parent.

    Attributes:
        xyz: Position [m].
        rpy: Roll, pitch, yaw about the parent's fixed x, y, z axes, in this order,
            as in URDF [rad].

    Args:
        xyz: Position [m].
        rpy: Orientation as roll, pitch, yaw [rad].
        quat_wxyz: Orientation as a unit quaternion, scalar first.
        quat_xyzw: Orientation as a unit quaternion, scalar last, as in ROS.

    Raises:
        PoseError: There are several orientations; a number is not finite or one is
            missing; `rpy` looks like degrees; a quaternion's norm is not 1.

    Example:
        >>> Pose(xyz=(0, 0.4, 0)).matrix()[:3, 3].tolist()
        [0.0, 0.4, 0.0]
        >>> Pose(quat_xyzw=(0, 0, 1, 0))
        Pose(xyz=(0, 0, 0), rpy=(0, 0, 3.14159))
    """

    xyz: tuple[float, float, float]
    rpy: tuple[float, float, float]
    _rows: NDArray[np.float64] | None = field(init=False, compare=False)

    def __init__(
        self,
        *,
        xyz: Sequence[float] = (0.0, 0.0, 0.0),
        rpy: Sequence[float] | None = None,
        quat_wxyz: Sequence[float] | None = None,
        quat_xyzw: Sequence[float] | None = None,
    ) -> None:
        ways = {"rpy": rpy, "quat_wxyz": quat_wxyz, "quat_xyzw": quat_xyzw}
        given = {key: value for key, value in ways.items() if value is not None}
        if len(given) > 1:
            raise PoseError(f"{' and '.join(given)} are given; give one orientation")
        angles = (0.0, 0.0, 0.0) if rpy is None else finite_numbers("rpy", rpy, 3)
        for k, angle in enumerate(angles):
            if abs(angle) > LOOKS_LIKE_DEGREES:
                raise PoseError(
                    f"rpy[{k}] is {angle:g} rad, which looks like degrees; give "
                    f"radians: {radians(angle):.4f}"
                )
        if quat_wxyz is not None:
            angles = rpy_from_quaternion("quat_wxyz", quat_wxyz, scalar=0)
        if quat_xyzw is not None:
            angles = rpy_from_quaternion("quat_xyzw", quat_xyzw, scalar=3)
        object.__setattr__(self, "xyz", finite_numbers("xyz", xyz, 3))
        object.__setattr__(self, "rpy", angles)
        object.__setattr__(self, "_rows", None)

    def __repr__(self) -> str:
        """Position and orientation, rounded to six digits."""
        parts = (self.xyz, self.rpy)
        xyz, rpy = (", ".join(f"{round(v, 9) + 0.0:.6g}" for v in p) for p in parts)
        return f"Pose(xyz=({xyz}), rpy=({rpy}))"

    def matrix(self) -> NDArray[np.float64]:
        """Homogeneous transform of the frame in its parent, shape (4, 4)."""
        T = np.eye(4)
        T[:3, :3] = rotation_from_rpy(*self.rpy)
        T[:3, 3] = self.xyz
        return T

    def rows(self) -> NDArray[np.float64]:
        """Rows of [R | p], shape (1, 12); computed once, for reading only."""
        rows = self._rows
        if rows is None:
            rows = np.ascontiguousarray(self.matrix()[:3].reshape(1, 12))
            object.__setattr__(self, "_rows", rows)
        return rows

    @classmethod
    def from_matrix(cls, T: ArrayLike) -> Self:
        """Pose of a homogeneous transform, shape (4, 4).

        Raises:
            PoseError: The matrix is no rigid transform.
        """
        T = check_transform("T", T)
        return cls(xyz=T[:3, 3].tolist(), rpy=rpy_from_rotation(T[:3, :3]))


def finite_numbers(name: str, values: Sequence[float], count: int) -> tuple[float, ...]:
    """Finite numbers of a pose as a tuple.

    Raises:
        PoseError: A number is not finite, or their count is another one.
    """
    try:
        numbers = tuple(float(value) for value in values)
    except (TypeError, ValueError):
        raise PoseError(f"{name} is {values!r}; it must be {count} numbers") from None
    if len(numbers) != count or not all(map(isfinite, numbers)):
        raise PoseError(f"{name} is {numbers}; it must be {count} finite numbers")
    return numbers


def rpy_from_quaternion(
    name: str, quaternion: Sequence[float], *, scalar: int
) -> tuple[float, float, float]:
    """Roll, pitch, yaw of a unit quaternion [rad].

    Args:
        name: Its key, for messages.
        quaternion: Its four numbers.
        scalar: Place of the scalar, 0 or 3.

    Raises:
        PoseError: It is no quaternion, or its norm differs from 1 by more than
            `UNIT_TOLERANCE`.
    """
    numbers = list(finite_numbers(name, quaternion, 4))
    w = numbers.pop(scalar)
    x, y, z = numbers
    norm = sqrt(w * w + x * x + y * y + z * z)
    if not abs(norm - 1.0) <= UNIT_TOLERANCE:
        raise PoseError(f"{name} has norm {norm:.4g}; it must be 1")
    w, x, y, z = w / norm, x / norm, y / norm, z / norm
    rotation = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    return rpy_from_rotation(rotation)


def rotation_from_rpy(roll: float, pitch: float, yaw: float) -> NDArray[np.float64]:
    """Rotation R = Rz(yaw) · Ry(pitch) · Rx(roll), shape (3, 3)."""
    cr, sr = cos(roll), sin(roll)
    cp, sp = cos(pitch), sin(pitch)
    cy, sy = cos(yaw), sin(yaw)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def rpy_from_rotation(R: NDArray[np.float64]) -> tuple[float, float, float]:
    """Roll, pitch, yaw of a rotation [rad]; yaw is 0 where pitch is ±90°."""
    horizontal = sqrt(R[0, 0] ** 2 + R[1, 0] ** 2)
    pitch = atan2(-R[2, 0], horizontal)
    yaw = atan2(R[1, 0], R[0, 0]) if horizontal > 1e-12 else 0.0
    if horizontal > 1e-3:
        return atan2(R[2, 1], R[2, 2]), pitch, yaw
    # Near ±90° the roll is that of Rz(-yaw) R: rounding of both must cancel.
    c, s = cos(yaw), sin(yaw)
    roll = atan2(s * R[0, 2] - c * R[1, 2], c * R[1, 1] - s * R[0, 1])
    return roll, pitch, yaw


def check_transform(name: str, T: ArrayLike) -> NDArray[np.float64]:
    """Return `T` as a rigid transform, shape (4, 4), or say what is wrong with it.

    Raises:
        PoseError: Wrong shape, a number not finite, or a rotation part that is not
            orthogonal within `ORTHOGONAL_TOLERANCE` and right-handed.
    """
    matrix = np.array(T, dtype=np.float64)
    if matrix.shape != (4, 4):
        raise PoseError(f"{name} has shape {matrix.shape}; it must be (4, 4)")
    if not np.isfinite(matrix).all():
        raise PoseError(f"{name} has a number that is not finite")
    check_rigid(name, matrix)
    return matrix


def transform_of(pose: Pose | ArrayLike) -> NDArray[np.float64]:
    """A pose as a transform, shape (4, 4).

    Raises:
        PoseError: It is no rigid transform.
    """
    return pose.matrix() if isinstance(pose, Pose) else check_transform("pose", pose)


def check_transforms(name: str, T: ArrayLike) -> NDArray[np.float64]:
    """Return `T` as rigid transforms, shape (n, 4, 4).

    A transform with a number that is not finite becomes NaN altogether.

    Raises:
        PoseError: Wrong shape, or one of the transforms whose numbers are finite is
            not rigid.
    """
    matrices = np.array(T, dtype=np.float64)
    if matrices.ndim != 3 or matrices.shape[1:] != (4, 4):
        raise PoseError(
            f"{name} has shape {matrices.shape}; it must be (4, 4) or (n, 4, 4)"
        )
    lost = ~np.isfinite(matrices).all(axis=(1, 2))
    matrices[lost] = np.eye(4)
    R = matrices[:, :3, :3]
    skew = np.abs(R.transpose(0, 2, 1) @ R - np.eye(3)).max(axis=(1, 2), initial=0.0)
    sound = (skew <= ORTHOGONAL_TOLERANCE) & (np.linalg.det(R) > 0.0)
    sound &= (matrices[:, 3] == (0.0, 0.0, 0.0, 1.0)).all(axis=1)
    for k in np.flatnonzero(~sound):
        check_rigid(f"{name}[{k}]", matrices[k])
    matrices[lost] = np.nan
    return matrices


def check_rigid(name: str, matrix: NDArray[np.float64]) -> None:
    """Refuse a finite matrix of shape (4, 4) that is no rigid transform.

    Raises:
        PoseError: Its rotation part is not orthogonal within `ORTHOGONAL_TOLERANCE`
            and right-handed, or its last row is not 0 0 0 1.
    """
    R = matrix[:3, :3]
    skew = float(np.abs(R.T @ R - np.eye(3)).max())
    if skew > ORTHOGONAL_TOLERANCE or np.linalg.det(R) < 0.0:
        raise PoseError(
            f"{name} is no rigid transform: RᵀR differs from the identity by "
            f"{skew:.3g}, det R is {np.linalg.det(R):.3g}"
        )
    if not np.array_equal(matrix[3], (0.0, 0.0, 0.0, 1.0)):
        raise PoseError(f"{name} ends in row {matrix[3]}; it must be 0 0 0 1")
