"""Objects that come, go and stand elsewhere between two cycles; their sightings."""

from dataclasses import replace
from math import inf, isfinite
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armguard.errors import PoseError, SceneError
from armguard.geometry.bounds import row_bounds
from armguard.geometry.pose import Pose, check_transform
from armguard.geometry.shapes import Shape
from armguard.geometry.shapes.kind import ShapeKind
from armguard.guard.levels import SENTENCES, Reason
from armguard.index.base import Index
from armguard.index.small_tree import small_tree
from armguard.scene.blocks import WITH_ADDRESS
from armguard.scene.standing import Standing

Floats = NDArray[np.float64]

# Kinds whose row has further points of the shape itself, and where.
ENDS = {ShapeKind.CAPSULE: (4,), ShapeKind.TRIANGLE: (4, 7)}

# Kinds whose origin may be no point of the shape, or any.
WITHOUT_CENTRE = (ShapeKind.HULL, ShapeKind.SUPPORT, ShapeKind.HALF_SPACE)

# What stamps may be rounded by [s], and round-off of a place [m].
STAMP_GRAIN = 1e-6
GRAIN = 1e-9


class SightingError(SceneError):
    """A sighting of an object cannot be true; every cycle is a stop until one is.

    Attributes:
        reason: Name of the `Reason` those cycles have.
    """

    def __init__(self, message: str, reason: str = "") -> None:
        super().__init__(message)
        self.reason = reason


class Sighting(NamedTuple):
    """Where an object was seen.

    Attributes:
        stamp: When [s].
        rows: Rows of its primitives in the world, shape (k, 16).
    """

    stamp: float
    rows: Floats


def transform_of(pose: Pose | ArrayLike) -> Floats:
    """A pose as a transform, shape (4, 4).

    Raises:
        PoseError: It is none.
    """
    return pose.matrix() if isinstance(pose, Pose) else check_transform("pose", pose)


def frame_seen(name: str, pose: Pose | ArrayLike) -> Floats:
    """Where an object was seen, shape (4, 4).

    Raises:
        SightingError: The pose is none.
    """
    try:
        return transform_of(pose)
    except PoseError as error:
        raise refused(name, Reason.OBJECT_NOT_FINITE, str(error)) from None


def velocity_seen(name: str, velocity: ArrayLike | None, top: float) -> Floats:
    """A velocity an object was seen with, shape (3,); 0 if there is none.

    Raises:
        SceneError: It is no velocity.
        SightingError: It is not finite, or faster than the object can be.
    """
    if velocity is None:
        return np.zeros(3)
    found = np.asarray(velocity, dtype=np.float64)
    if found.shape != (3,):
        raise SceneError(f"object '{name}': velocity must be 3 finite numbers [m/s]")
    if not np.isfinite(found).all():
        says = f"velocity is {found}; it must be 3 finite numbers [m/s]"
        raise refused(name, Reason.OBJECT_NOT_FINITE, says)
    speed = float(np.linalg.norm(found))
    if speed > top:
        says = f"it was seen at {speed:.3f} m/s; its top_speed is {top} m/s"
        raise refused(name, Reason.OBJECT_TOO_FAST, says)
    return found


def check_sighting(
    name: str,
    thing: Standing,
    kinds: NDArray[np.int32],
    before: Sighting,
    now: Sighting,
    top: float,
) -> None:
    """Refuse a sighting that cannot be true beside the last believed one.

    Args:
        name: The object's name.
        thing: The object.
        kinds: Kinds of its primitives, shape (k,).
        before: The last believed sighting; its stamp is -inf if there was none.
        now: The new one.
        top: Greatest speed of any of its points [m/s].

    Raises:
        SightingError: It cannot.
    """
    if not isfinite(now.stamp):
        raise refused(name, Reason.OBJECT_NOT_FINITE, f"its stamp is {now.stamp}")
    if before.stamp == -inf:
        return
    time = now.stamp - before.stamp
    if time < 0.0:
        says = f"its stamp is {now.stamp:.6f} s, the last one {before.stamp:.6f} s"
        raise refused(name, Reason.OBJECT_BACKWARDS, says)
    way = least_way(kinds, before.rows, now.rows)
    if time == 0.0 and way > GRAIN:
        says = f"both at {now.stamp:.6f} s, {way:.3f} m apart"
        raise refused(name, Reason.OBJECT_REPEATED, says)
    if not way <= top * (time + STAMP_GRAIN) + 2.0 * thing.error + GRAIN:
        says = f"{way:.3f} m in {time:.3f} s; its top_speed is {top} m/s"
        raise refused(name, Reason.OBJECT_JUMPED, says)


def refused(name: str, reason: Reason, says: str) -> SightingError:
    """The error of a sighting that cannot be true."""
    return SightingError(f"object '{name}': {SENTENCES[reason]}: {says}", reason.name)


def least_way(kinds: NDArray[np.int32], before: Floats, now: Floats) -> float:
    """The farthest some point of an object surely moved [m].

    By points of its shapes, and by the boxes around them: where a face of the box
    moved, a point of the shape moved at least as far.

    Args:
        kinds: Kinds of its primitives, shape (k,).
        before: Their rows before, shape (k, 16).
        now: Their rows now, shape (k, 16).
    """
    farthest = 0.0
    boxes = np.zeros((2, 6))
    for kind, old, new in zip(kinds.tolist(), before, now, strict=True):
        points = () if kind in WITHOUT_CENTRE else (1, *ENDS.get(ShapeKind(kind), ()))
        for k in points:
            way = float(np.linalg.norm(new[k : k + 3] - old[k : k + 3]))
            farthest = max(farthest, way)
        row_bounds(kind, old, 0.0, boxes[0])
        row_bounds(kind, new, 0.0, boxes[1])
        faces = np.abs(boxes[1] - boxes[0])
        farthest = max(
            farthest, float(faces.max(where=np.isfinite(faces), initial=0.0))
        )
    return farthest


def load_kernels() -> None:
    """Load what `stand_at` and `take_out` call, which takes longer than a cycle may."""
    tree = small_tree()
    world = tree.world
    row_bounds(int(world.kinds[0]), world.rows[0], 0.0, world.boxes[0])
    tree.remove(0)
    tree.insert(0)


def stand_at(index: Index, thing: Standing, T: Floats) -> None:
    """Put the primitives of an object where its frame stands at T.

    Args:
        index: The index; its world is written.
        thing: The object, in it or not.
        T: Its frame in the world, shape (4, 4).
    """
    world = index.world
    rows = thing.rows(T)
    take_out(index, thing)
    for k in range(thing.count):
        i = thing.first + k
        world.rows[i] = rows[k]
        row_bounds(int(world.kinds[i]), world.rows[i], 0.0, world.boxes[i])
        index.insert(i)


def take_out(index: Index, thing: Standing) -> None:
    """Leave the primitives of an object out of the index."""
    for i in range(thing.first, thing.first + thing.count):
        index.remove(i)


def reshaped(name: str, thing: Standing, shape: Shape) -> Standing:
    """The object with another shape of its kind.

    Raises:
        SceneError: It is not one shape of that kind, or has one that cannot change.
    """
    said = f"object '{name}' cannot change its shape"
    if len(thing.shapes) != 1 or thing.surfaces:
        raise SceneError(f"{said}: it is not one shape")
    if thing.body >= 0:
        raise SceneError(f"{said}: it may be gripped")
    old = thing.shapes[0]
    was, becomes = old.shape.kind, shape.kind
    if was is not becomes or was in WITH_ADDRESS:
        raise SceneError(
            f"{said}: it is a {was.name.lower()}, to become a {becomes.name.lower()}"
        )
    return replace(thing, shapes=(replace(old, shape=shape),))
