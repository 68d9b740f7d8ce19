"""Arguments of maps of cells as numbers."""

from math import inf, isfinite

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armguard.cells.state import NO_SENSOR, SEVERAL
from armguard.errors import CellMapError
from armguard.geometry.pose import Pose, check_transform, transform_of

Floats = NDArray[np.float64]


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


def checked_pose(name: str, pose: Pose | ArrayLike) -> Floats:
    """A finite pose as a transform, shape (4, 4).

    Raises:
        PoseError: It is no rigid transform.
    """
    return transform_of(pose) if isinstance(pose, Pose) else check_transform(name, pose)


def check_frame(
    stamp: float, reach: float, error: float, least_reach: float | None = None
) -> None:
    """Refuse numbers of a frame that are out of their range.

    Raises:
        CellMapError: A number is.
    """
    if not isfinite(stamp):
        raise CellMapError(f"stamp is {stamp}; it must be finite [s]")
    if not (reach > 0.0 or reach == least_reach):
        raise CellMapError(f"reach is {reach}; it must be positive [m]")
    if not 0.0 <= error < inf:
        raise CellMapError(f"error is {error}; it must be at least 0 [m]")


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
