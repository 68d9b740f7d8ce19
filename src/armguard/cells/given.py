"""Arguments of maps of cells as numbers."""

from math import inf, isfinite
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armguard.cells.state import NO_SENSOR, SEVERAL
from armguard.errors import CellMapError
from armguard.geometry.pose import Pose, check_transform, transform_of

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]


class Shot(NamedTuple):
    """A depth image with its camera.

    Attributes:
        R: Axes of the camera in the world, by columns, shape (3, 3).
        origin: Its place, world, shape (3,) [m].
        focal: Focal lengths along columns and rows [pixels].
        centre: Column and row of the principal point [pixels].
        reach: Depth up to which space is freed [m].
        hits: Depths that hit, shape (rows, columns) [m].
        freeing: Depths by which space is freed; None for those that hit [m].
        clearing: Depths by which occupied cells are passed; None for none [m].
    """

    R: Floats
    origin: Floats
    focal: tuple[float, float]
    centre: tuple[float, float]
    reach: float
    hits: Singles
    freeing: Singles | None
    clearing: Singles | None


def pair_of(name: str, given: float | tuple[float, float]) -> tuple[float, float]:
    """Numbers along columns and rows, or one for both.

    Raises:
        CellMapError: It is neither.
    """
    try:
        if isinstance(given, int | float):
            return float(given), float(given)
        first, second = given
        return float(first), float(second)
    except (TypeError, ValueError):
        raise CellMapError(f"{name} is {given!r}; it must be two numbers") from None


def camera_of(
    focal: float | tuple[float, float], centre: tuple[float, float]
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Focal lengths and principal point of a camera [pixels].

    Raises:
        CellMapError: A focal length is not positive, or a number is not finite.
    """
    focals, middle = pair_of("focal", focal), pair_of("centre", centre)
    if not all(0.0 < one < inf for one in focals):
        raise CellMapError(f"focal is {focal}; it must be positive [pixels]")
    if not isfinite(sum(middle)):
        raise CellMapError(f"centre is {centre}; it must be two finite numbers")
    return focals, middle


def checked_pose(name: str, pose: Pose | ArrayLike) -> Floats:
    """A finite pose as a transform, shape (4, 4).

    Raises:
        PoseError: It is no rigid transform.
    """
    return transform_of(pose) if isinstance(pose, Pose) else check_transform(name, pose)


def check_size(name: str, value: float, unit: str) -> None:
    """Refuse a number that is negative or not finite.

    Raises:
        CellMapError: It is.
    """
    if not 0.0 <= value < inf:
        raise CellMapError(f"{name} is {value}; it must be at least 0 [{unit}]")


def check_frame(stamp: float, reach: float, error: float) -> None:
    """Refuse numbers of a frame that are out of their range.

    Raises:
        CellMapError: A number is.
    """
    if not isfinite(stamp):
        raise CellMapError(f"stamp is {stamp}; it must be finite [s]")
    if not reach > 0.0:
        raise CellMapError(f"reach is {reach}; it must be positive [m]")
    check_size("error", error, "m")


def rays_of(points: ArrayLike, origin: ArrayLike) -> tuple[Floats, Floats]:
    """Points, shape (n, 3), and where their rays begin, shape (3,) [m].

    Raises:
        CellMapError: They have other shapes, or the origin is not finite.
    """
    rows = np.ascontiguousarray(points, dtype=np.float64)
    start = np.ascontiguousarray(origin, dtype=np.float64)
    if rows.ndim != 2 or rows.shape[1] != 3:
        raise CellMapError(f"points have shape {rows.shape}; it must be (n, 3)")
    if start.shape != (3,) or not np.isfinite(start).all():
        raise CellMapError(f"origin is {origin!r}; it must be three finite numbers")
    return rows, start


def reaches_of(name: str, given: float | ArrayLike, count: int) -> Floats:
    """Reaches of rays, one for each; NaN is none, shape (count,) [m].

    Raises:
        CellMapError: One is negative, or there are more or fewer.
    """
    found = np.asarray(given, dtype=np.float64)
    if found.shape not in ((), (count,)) or (found < 0.0).any():
        raise CellMapError(
            f"{name} has shape {found.shape} for {count} points; it must be one "
            "distance, or one for each, of at least 0 [m]"
        )
    return np.ascontiguousarray(np.broadcast_to(found, (count,)))


def depths_of(image: ArrayLike) -> NDArray[np.float32]:
    """Depths as single floats, by rows [m]: floats are metres, integers millimetres.

    Raises:
        CellMapError: It has no rows and columns of numbers.
    """
    found = np.asarray(image)
    if found.ndim != 2 or found.size == 0 or found.dtype.kind not in "fiu":
        raise CellMapError(
            f"the image has shape {found.shape} of {found.dtype}; it must have rows "
            "and columns of floats [m] or integers [mm]"
        )
    if found.dtype.kind in "iu":
        found = found.astype(np.float32) * np.float32(1e-3)
    with np.errstate(over="ignore"):
        return np.ascontiguousarray(found, dtype=np.float32)


def check_source(source: int) -> None:
    """Refuse what is no number of a sensor.

    Raises:
        CellMapError: It is none.
    """
    if not NO_SENSOR < source < SEVERAL:
        raise CellMapError(f"source is {source}; it must be 1 to {SEVERAL - 1}")
