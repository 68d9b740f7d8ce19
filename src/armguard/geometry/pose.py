"""Where a frame stands: rigid transforms at the edges, 3×4 rows in kernels.

`T_a_b` takes coordinates in b to coordinates in a: x_a = T_a_b · x_b.
"""

from dataclasses import dataclass
from math import atan2, cos, isfinite, sin, sqrt
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armguard.errors import PoseError

# Largest deviation of RᵀR from the identity that counts as rounding of a file's
# six printed digits [-].
ORTHOGONAL_TOLERANCE = 1e-5


@dataclass(frozen=True, slots=True, kw_only=True)
class Pose:
    """Position and orientation of a frame in its parent.

    Attributes:
        xyz: Position [m].
        rpy: Roll, pitch, yaw about the parent's fixed x, y, z axes, in this order,
            as in URDF [rad].

    Raises:
        PoseError: A number is not finite or there are not three of them.

    Example:
        >>> Pose(xyz=(0, 0.4, 0)).matrix()[:3, 3].tolist()
        [0.0, 0.4, 0.0]
    """

    xyz: tuple[float, float, float] = (0.0, 0.0, 0.0)
    rpy: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        """Check lengths and finiteness."""
        for name in ("xyz", "rpy"):
            value = tuple(float(x) for x in getattr(self, name))
            if len(value) != 3 or not all(map(isfinite, value)):
                raise PoseError(f"Pose {name} is {value}; it must be 3 finite numbers")
            object.__setattr__(self, name, value)

    def matrix(self) -> NDArray[np.float64]:
        """Homogeneous transform of the frame in its parent, shape (4, 4)."""
        T = np.eye(4)
        T[:3, :3] = rotation_from_rpy(*self.rpy)
        T[:3, 3] = self.xyz
        return T

    @classmethod
    def from_matrix(cls, T: ArrayLike) -> Self:
        """Pose of a homogeneous transform, shape (4, 4).

        Raises:
            PoseError: The matrix is no rigid transform.
        """
        T = check_transform("T", T)
        x, y, z = (float(v) for v in T[:3, 3])
        return cls(xyz=(x, y, z), rpy=rpy_from_rotation(T[:3, :3]))

    @classmethod
    def from_quat_wxyz(
        cls, quat_wxyz: ArrayLike, xyz: tuple[float, float, float] = (0.0, 0.0, 0.0)
    ) -> Self:
        """Pose from a quaternion, scalar first.

        Raises:
            PoseError: The quaternion's norm differs from 1 by more than 1e-3.
        """
        w, x, y, z = (float(v) for v in np.asarray(quat_wxyz, dtype=float))
        norm = sqrt(w * w + x * x + y * y + z * z)
        if not abs(norm - 1.0) <= 1e-3:
            raise PoseError(f"quaternion has norm {norm:g}; it must be 1")
        w, x, y, z = w / norm, x / norm, y / norm, z / norm
        rotation = np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
            ]
        )
        return cls(xyz=xyz, rpy=rpy_from_rotation(rotation))


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
    if horizontal > 1e-9:
        return atan2(R[2, 1], R[2, 2]), pitch, atan2(R[1, 0], R[0, 0])
    return atan2(-R[1, 2], R[1, 1]), pitch, 0.0


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
