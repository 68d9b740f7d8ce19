"""Signed distance of two shapes, for people: the kernels of the cycle, one call."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armguard.address import array_at, stack
from armguard.errors import PoseError
from armguard.geometry.pairs import measure
from armguard.geometry.place import place_row
from armguard.geometry.pose import Pose, check_transforms
from armguard.geometry.shapes import Shape, shape_row
from armguard.geometry.shapes.row import ROW_WIDTH
from armguard.geometry.witness import WITNESS_WIDTH
from armguard.kernel import kernel

Floats = NDArray[np.float64]

# Shapes with their rows, by identity: the shape is kept, so no other has its id.
ROWS: dict[int, tuple[Shape, Floats]] = {}
MOST_ROWS = 1024


@dataclass(frozen=True, slots=True)
class Proximity:
    """How two shapes stand to each other: point_b - point_a = distance · normal.

    Attributes:
        distance: Signed distance; negative is minus the length of the shortest
            translation that separates the shapes [m].
        point_a: Witness point on A, world, shape (3,) [m].
        point_b: Witness point on B, world, shape (3,) [m].
        normal: Unit vector from A to B, world, shape (3,).
    """

    distance: float
    point_a: Floats
    point_b: Floats
    normal: Floats


@dataclass(frozen=True, slots=True)
class Proximities:
    """How two shapes stand to each other in n pairs of poses.

    Attributes:
        distance: Signed distances, shape (n,) [m].
        point_a: Witness points on A, world, shape (n, 3) [m].
        point_b: Witness points on B, world, shape (n, 3) [m].
        normal: Unit vectors from A to B, world, shape (n, 3).
    """

    distance: Floats
    point_a: Floats
    point_b: Floats
    normal: Floats

    def __len__(self) -> int:
        """How many pairs of poses there are."""
        return len(self.distance)

    def __getitem__(self, k: int) -> Proximity:
        """The k-th."""
        return Proximity(
            float(self.distance[k]), self.point_a[k], self.point_b[k], self.normal[k]
        )

    def __iter__(self) -> Iterator[Proximity]:
        """One after the other."""
        return (self[k] for k in range(len(self)))


def distance(
    shape_a: Shape,
    pose_a: Pose | ArrayLike,
    shape_b: Shape,
    pose_b: Pose | ArrayLike,
) -> Proximity:
    """Signed distance of two shapes, with witness points and normal.

    Args:
        shape_a: Shape A.
        pose_a: Its frame in the world, a `Pose` or a transform of shape (4, 4); a
            number that is not finite gives NaN.
        shape_b: Shape B.
        pose_b: Its frame in the world.

    Raises:
        PoseError: A transform is not rigid.

    Example:
        >>> from armguard import Box, Pose, Sphere, distance
        >>> ball, block = Sphere(radius=0.1), Box(size=(1, 1, 1))
        >>> near = distance(ball, Pose(xyz=(0.8, 0, 0)), block, Pose())
        >>> round(near.distance, 9), near.normal.tolist()
        (0.2, [-1.0, 0.0, 0.0])
    """
    T_a, T_b = transforms("pose_a", pose_a), transforms("pose_b", pose_b)
    if not len(T_a) == len(T_b) == 1:
        count = max(len(T_a), len(T_b))
        raise PoseError(f"there are {count} poses; `distances` takes them all")
    out = np.zeros((1, WITNESS_WIDTH))
    row_a, row_b = local_row(shape_a), local_row(shape_b)
    measure_all(int(shape_a.kind), row_a, T_a, int(shape_b.kind), row_b, T_b, out)
    found = out[0]
    return Proximity(float(found[0]), found[1:4], found[4:7], found[7:10])


def distances(
    shape_a: Shape,
    poses_a: Pose | ArrayLike,
    shape_b: Shape,
    poses_b: Pose | ArrayLike,
) -> Proximities:
    """The same for many poses at once, each answer with the same bits as alone.

    Args:
        shape_a: Shape A.
        poses_a: Its frames in the world, transforms of shape (n, 4, 4); or one, a
            `Pose` or of shape (4, 4), for all of B's.
        shape_b: Shape B.
        poses_b: Its frames in the world, as many or one.

    Raises:
        PoseError: A transform is not rigid, or there are n of one and m of the other.

    Example:
        >>> import numpy as np
        >>> from armguard import Pose, Sphere, distances
        >>> ball = Sphere(radius=0.5)
        >>> away = np.stack([Pose(xyz=(x, 0, 0)).matrix() for x in (1, 2, 3)])
        >>> distances(ball, Pose(), ball, away).distance.tolist()
        [0.0, 1.0, 2.0]
    """
    T_a, T_b = transforms("poses_a", poses_a), transforms("poses_b", poses_b)
    count = max(len(T_a), len(T_b)) if len(T_a) and len(T_b) else 0
    if not {len(T_a), len(T_b)} <= {1, count}:
        raise PoseError(
            f"there are {len(T_a)} poses of A and {len(T_b)} of B; give as many, or one"
        )
    out = np.zeros((count, WITNESS_WIDTH))
    row_a, row_b = local_row(shape_a), local_row(shape_b)
    measure_all(int(shape_a.kind), row_a, T_a, int(shape_b.kind), row_b, T_b, out)
    return Proximities(out[:, 0], out[:, 1:4], out[:, 4:7], out[:, 7:10])


@kernel(inline=False, entry=True)
def measure_all(
    kind_a: int,
    local_a: Floats,
    T_a: Floats,
    kind_b: int,
    local_b: Floats,
    T_b: Floats,
    out: Floats,
) -> None:
    """Witness rows of two shapes at many poses.

    Args:
        kind_a: ShapeKind of A.
        local_a: Its row in its own frame, shape (16,).
        T_a: Its frames in the world, shape (n, 12) or (1, 12).
        kind_b: ShapeKind of B.
        local_b: Its row in its own frame, shape (16,).
        T_b: Its frames in the world, shape (n, 12) or (1, 12).
        out: Witness rows, overwritten, shape (n, 10).
    """
    rows = array_at(stack(32), (2, ROW_WIDTH), np.float64)
    a, b = rows[0], rows[1]
    for k in range(out.shape[0]):
        place_row(kind_a, local_a, T_a[min(k, T_a.shape[0] - 1)], a)
        place_row(kind_b, local_b, T_b[min(k, T_b.shape[0] - 1)], b)
        measure(kind_a, a, kind_b, b, out[k])


def local_row(shape: Shape) -> Floats:
    """Table row of a shape in its own frame, shape (16,); prepared once a shape."""
    known = ROWS.get(id(shape))
    if known is not None:
        return known[1]
    if len(ROWS) == MOST_ROWS:
        ROWS.clear()
    row = shape_row(shape)
    ROWS[id(shape)] = shape, row
    return row


def transforms(name: str, poses: Pose | ArrayLike) -> Floats:
    """Poses as the kernels read them, the rows of [R | p], shape (n, 12)."""
    if isinstance(poses, Pose):
        return poses.rows()
    matrices = np.asarray(poses, dtype=np.float64)
    if matrices.ndim == 2:
        matrices = matrices[None]
    return np.ascontiguousarray(check_transforms(name, matrices)[:, :3].reshape(-1, 12))
