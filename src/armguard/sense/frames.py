"""Frames of sensors as numbers, each zone or pixel with what its value says."""

from dataclasses import dataclass
from math import inf, nan
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armguard.errors import WithSentence
from armguard.scene.sensors import SceneSensor

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]


# Numbers of a frame of points at most.
MOST_NUMBERS = 1 << 24


def number_of(stamp: object) -> float:
    """A stamp as a number, NaN if it is none [s]."""
    try:
        return float(stamp)  # type: ignore[arg-type]
    except (TypeError, ValueError, OverflowError):
        return nan


class Intake(WithSentence):
    """What became of a frame, or of joint positions.

    Attributes:
        sentence: The meaning in words.
    """

    TAKEN = 0, "it is in the map"
    HITS_ONLY = 1, "it hits, and frees nothing: its sensor is at fault"
    UNKNOWN_SENSOR = 2, "no sensor of the scene has that name"
    WRONG_KIND = 3, "the sensor sends frames of another kind"
    WRONG_TYPE = 4, "it has no numbers"
    WRONG_SIZE = 5, "it has another size than the sensor"
    NO_STAMP = 6, "its stamp is no finite number"
    STAMP_BACK = 7, "its stamp is not after the last one"
    STAMP_AHEAD = 8, "its stamp is after the newest joint positions"
    NO_POSITIONS = 9, "no joint positions of its time are known"
    NO_JOINTS = 10, "these are no joint positions, or their stamp does not rise"


@dataclass(frozen=True, slots=True)
class BadFrameError(Exception):
    """A frame that cannot be used.

    Attributes:
        intake: Why.
    """

    intake: Intake


class Frame(NamedTuple):
    """A frame by zones or pixels, each array of shape (rows, columns).

    Attributes:
        depth: Distances perpendicular to the sensor [m]; NaN where none is measured.
        firm: Which of them may free space.
        nothing: Where nothing is within range.
        impossible: Where the value cannot be: it is negative, or its status says that
            it was measured and it is not finite; with any status, if it is no number.
        surely: Depths up to which nothing is, where they do not follow from `depth`
            [m].
    """

    depth: Floats
    firm: Bools
    nothing: Bools
    impossible: Bools
    surely: Floats | None = None


class Signal(NamedTuple):
    """A signal of an infrared sensor or of a pad.

    Attributes:
        value: The signal [V, or in units of the gain].
    """

    value: float


class Points(NamedTuple):
    """Measured points of a frame, in the sensor.

    Attributes:
        xyz: The points that count, shape (n, 3) [m].
        beyond: Which of them are beyond the range: nothing is within it, shape (n,).
        given: How many points the frame had.
    """

    xyz: Floats
    beyond: Bools
    given: int


def numbers(
    values: ArrayLike, kinds: str, shape: tuple[int, int]
) -> NDArray[np.generic]:
    """An array of a shape, also from a flat one.

    Args:
        values: The values.
        kinds: Kinds of numbers that are allowed, as in `dtype.kind`.
        shape: Rows and columns.

    Raises:
        BadFrameError: They are no such numbers, or more or fewer.
    """
    try:
        found = np.asarray(values)
    except (TypeError, ValueError, OverflowError):
        raise BadFrameError(Intake.WRONG_TYPE) from None
    if found.dtype.kind not in kinds:
        raise BadFrameError(Intake.WRONG_TYPE)
    rows, columns = shape
    if found.shape not in (shape, (rows * columns,)):
        raise BadFrameError(Intake.WRONG_SIZE)
    return found.reshape(shape)


def frame_of(
    sensor: SceneSensor, slopes: Floats, distance: ArrayLike, status: ArrayLike | None
) -> Frame:
    """A frame of a sensor.

    Args:
        sensor: The sensor.
        slopes: Length of the ray of each zone at depth 1, shape (rows, columns).
        distance: Distances: floats [m] or integers [mm].
        status: What they are, by the codes of the sensor; None for all measured.

    Raises:
        BadFrameError: It cannot be used.
    """
    shape = slopes.shape
    found = numbers(distance, "fiu", shape)
    with np.errstate(over="ignore", invalid="ignore"):
        depth = found.astype(np.float64)
        if found.dtype.kind in "iu":
            depth *= 1e-3
        if sensor.along == "ray":
            depth /= slopes
    measured = firm = np.ones(shape, dtype=np.bool_)
    nothing = np.zeros(shape, dtype=np.bool_)
    if status is not None:
        codes = numbers(status, "iu", shape)
        firm = among(codes, sensor.codes.valid)
        measured = firm | among(codes, sensor.codes.doubtful)
        nothing = among(codes, sensor.codes.nothing)
    impossible = measured & (depth < 0.0)
    # Pixels of images without a measurement are NaN, infinite or 0.
    if not sensor.image and status is not None:
        impossible |= measured & (~np.isfinite(depth) | (depth == 0.0))
        # Drivers send numbers for all zones.
        impossible |= np.isnan(depth)
    usable = measured & (depth > 0.0) & (depth <= sensor.range[1])
    depth[~usable] = np.nan
    return Frame(depth, firm & usable, nothing, impossible)


def among(codes: NDArray[np.generic], chosen: tuple[int, ...]) -> Bools:
    """Which codes are among a few; `np.isin` takes ten times as long for these."""
    found = np.zeros(codes.shape, dtype=np.bool_)
    for code in chosen:
        found |= codes == code
    return found


def points_of(sensor: SceneSensor, values: ArrayLike) -> Points:
    """Points of a sensor; those that are not finite or too near are left out.

    Args:
        sensor: The sensor.
        values: The points in its frame, shape (..., 3) [m].

    Raises:
        BadFrameError: They are no such points.
    """
    try:
        found = np.asarray(values)
    except (TypeError, ValueError, OverflowError):
        raise BadFrameError(Intake.WRONG_TYPE) from None
    if found.dtype.kind != "f":
        raise BadFrameError(Intake.WRONG_TYPE)
    if found.ndim < 2 or found.shape[-1] != 3 or found.size > MOST_NUMBERS:
        raise BadFrameError(Intake.WRONG_SIZE)
    xyz = found.reshape(-1, 3).astype(np.float64)
    with np.errstate(over="ignore", invalid="ignore"):
        way = np.linalg.norm(xyz, axis=1)
    counts = np.isfinite(way) & (way >= sensor.range[0])
    return Points(xyz[counts], way[counts] > sensor.range[1], len(xyz))


def signal_of(value: ArrayLike) -> Signal:
    """A signal.

    Raises:
        BadFrameError: It is no finite number.
    """
    found = numbers(np.atleast_1d(np.asarray(value)), "fiu", (1, 1))
    if not np.isfinite(found.astype(np.float64)).all():
        raise BadFrameError(Intake.WRONG_TYPE)
    return Signal(float(found[0, 0]))


def beam_of(
    sensor: SceneSensor, slopes: Floats, cone: Bools, value: ArrayLike
) -> Frame:
    """The frame of one distance: it is valid for the whole arc within the cone.

    Less than the range, and minus infinity, are a body that is too near: the arc at the
    least distance is hit, and nothing is freed.

    Args:
        sensor: The sensor.
        slopes: Length of the ray of each part at depth 1, shape (rows, columns).
        cone: Which parts are in the cone, of that shape.
        value: The distance: a float [m], plus infinity if nothing is within range, or
            an integer [mm].

    Raises:
        BadFrameError: It is no number.
    """
    found = numbers(np.atleast_1d(np.asarray(value)), "fiu", (1, 1))
    scale = 1e-3 if found.dtype.kind in "iu" else 1.0
    distance = float(found[0, 0]) * scale
    least, greatest = sensor.range
    near = distance == -inf or 0.0 <= distance < least
    measured = near or least <= distance <= greatest
    depth = np.where(cone & measured, max(distance, least) / slopes, np.nan)
    return Frame(
        depth, cone & measured & (not near), cone & (distance == inf),
        cone & (-inf < distance < 0.0),
    )  # fmt: skip
