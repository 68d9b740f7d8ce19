"""Objects placed, moved and removed between two cycles, and their sightings."""

import logging
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from math import inf, isfinite
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armguard.errors import PoseError, SceneError
from armguard.geometry.bounds import row_bounds
from armguard.geometry.pose import Pose, transform_of
from armguard.geometry.shapes import Shape
from armguard.geometry.shapes.kind import ShapeKind
from armguard.guard.holding import Holding
from armguard.guard.levels import Reason
from armguard.guard.watch import Watch
from armguard.index import BruteForce, Octree
from armguard.index.base import Index
from armguard.index.small_tree import small_tree
from armguard.scene.objects import looks_like_millimetres, placement_remark
from armguard.scene.standing import Standing, object_named
from armguard.scene.tables import SceneTables

Floats = NDArray[np.float64]

log = logging.getLogger("armguard")

# Columns of further points of the shape itself, for kinds whose row has some.
ENDS = {ShapeKind.CAPSULE: (4,), ShapeKind.TRIANGLE: (4, 7)}

# Kinds whose origin need not be a fixed point of the shape.
WITHOUT_CENTRE = (ShapeKind.HULL, ShapeKind.SUPPORT, ShapeKind.HALF_SPACE)

# Rounding of stamps [s], and round-off of a position [m].
STAMP_GRAIN = 1e-6
GRAIN = 1e-9


class SightingError(SceneError):
    """An implausible sighting of an object; cycles stop until a plausible one.

    Attributes:
        reason: Name of the `Reason` of those cycles.
    """

    def __init__(self, message: str, reason: str = "") -> None:
        super().__init__(message)
        self.reason = reason


class Sighting(NamedTuple):
    """Placement of a moving object with its stamp.

    Attributes:
        stamp: Time of the sighting [s].
        rows: Rows of its primitives in the world, shape (k, 16).
    """

    stamp: float
    rows: Floats


@dataclass(slots=True)
class Objects:
    """The objects of a scene that are attached to no link: placing and removing.

    Attributes:
        tables: The scene.
        watch: Watch; sightings are written.
        index: The index, with the world.
        holding: Held objects.
        world_changed: Callback; the loop measures every pair again.
        standing: The objects with their present shapes, by name.
        changed: Names of objects that were placed or removed since the start.
        strange: Names of objects of which the log has named a length that looks like
            millimetres.
    """

    tables: SceneTables
    watch: Watch
    index: Octree | BruteForce
    holding: Holding
    world_changed: Callable[[], None]
    standing: dict[str, Standing]
    changed: set[str] = field(default_factory=set)
    strange: set[str] = field(default_factory=set)

    def __post_init__(self) -> None:
        for item in self.standing.values():
            if not item.present:
                take_out(self.index, item)
                self.watch.seen_at[item.places] = inf

    def place(
        self,
        name: str,
        pose: Pose | ArrayLike,
        stamp: float | None = None,
        *,
        velocity: ArrayLike | None = None,
        shape: Shape | None = None,
    ) -> None:
        """Set the pose of an object, and add it to the world if it was absent.

        Call it between two cycles: it takes microseconds for each primitive of the
        object, and may take longer where the index has to grow.

        Args:
            name: An object of the scene that is attached to no link.
            pose: Its frame in the world, a `Pose` or a transform of shape (4, 4).
            stamp: Time of the sighting, on the clock of `step` [s]; required for an
                object with a `top_speed`, which may have moved since.
            velocity: Measured velocity in the world, shape (3,) [m/s]; evading robots
                use it to predict its path.
            shape: New shape, of the same kind: an unforeseen obstacle can be covered by
                a box that the scene declares as not present. Only for an object that
                is one shape, no hull or mesh, and not graspable.

        Raises:
            UnknownNameError: There is no such object.
            PoseError: The transform is not rigid, or a number is not finite.
            SceneError: The object moves and there is no stamp, or it cannot have that
                shape.
            SightingError: The sighting of an object with a `top_speed` is older than
                the last one, at another pose with the same stamp, farther away than it
                can be, with an impossible velocity, or has an invalid pose. The object
                keeps its last pose, and every cycle is a stop that names it until a
                sighting is accepted.
            GraspError: A gripper holds it.

        Example:
            >>> from armguard import Guard, Pose, Sphere, bay_scene
            >>> scene = bay_scene()
            >>> cart = scene.add(Sphere(radius=0.05), name="cart", present=False)
            >>> guard = Guard(scene)
            >>> guard.place("cart", Pose(xyz=(0.0, 0.0, 1.0)))
            >>> guard.remove("cart")
        """
        item = object_named(name, self.standing)
        if shape is not None:
            item = item.reshaped(name, shape)
        speeds = self.watch.top_speed
        moves = len(speeds) > 0 and speeds[item.first] > 0.0
        if not moves and velocity is not None:
            raise SceneError(f"object '{name}' moves and has no top_speed; give one")
        if moves:
            T = self._take_sighting(name, item, pose, stamp, velocity)
        else:
            T = transform_of(pose)
        remark = placement_remark(name, T, shape)
        if remark and name not in self.strange:
            log.warning(remark)
            self.strange.add(name)
        if item.body >= 0:
            self.holding.check_free(name)
            self.holding.put(name, T)
        stand_at(self.index, item, T)
        self.standing[name] = item
        self.changed.add(name)
        self.world_changed()

    def remove(self, name: str) -> None:
        """Remove an object from the world; `place` brings it back.

        Raises:
            UnknownNameError: There is no such object.
            GraspError: A gripper holds it.
        """
        item = object_named(name, self.standing)
        self.holding.check_free(name)
        take_out(self.index, item)
        self.watch.seen_at[item.places] = inf
        self.watch.doubt[item.places] = Reason.OK
        self.watch.sighted_at[item.places] = -inf
        self.changed.add(name)
        self.world_changed()

    def places_of(self, names: Iterable[str]) -> NDArray[np.int64]:
        """Indices of all moving primitives, and those of some objects, shape (k,)."""
        items = [self.tables.standing[name] for name in names]
        return np.concatenate(
            [
                np.arange(self.tables.moving_count),
                *(np.arange(t.first, t.first + t.count) for t in items if t.body < 0),
            ]
        )

    def _take_sighting(
        self,
        name: str,
        item: Standing,
        pose: Pose | ArrayLike,
        stamp: float | None,
        velocity: ArrayLike | None,
    ) -> Floats:
        """Store a sighting of an object; returns its frame, shape (4, 4).

        Raises:
            SceneError: There is no stamp.
            SightingError: The sighting is implausible; the object is in doubt.
        """
        watch, world = self.watch, self.index.world
        if stamp is None:
            raise SceneError(
                f"object '{name}' moves; give the stamp of its sighting [s]"
            )
        top = float(watch.top_speed[item.first])
        kinds = world.kinds[item.places]
        before = Sighting(float(watch.sighted_at[item.first]), world.rows[item.places])
        try:
            T = frame_seen(name, pose)
            speeds = velocity_seen(name, velocity, top)
            now = Sighting(stamp, item.rows(T))
            check_sighting(name, item, kinds, before, now, top)
        except SightingError as error:
            watch.doubt[item.places] = Reason[error.reason]
            raise
        watch.object_velocity[item.places] = speeds
        watch.sighted_at[item.places] = stamp
        watch.doubt[item.places] = Reason.OK
        # Its position error counts as travel at top speed before the sighting.
        watch.seen_at[item.places] = stamp - item.error / top
        return T


def frame_seen(name: str, pose: Pose | ArrayLike) -> Floats:
    """Frame of an object in a sighting, shape (4, 4).

    Raises:
        SightingError: The pose is no rigid transform.
    """
    try:
        return transform_of(pose)
    except PoseError as error:
        raise SightingError(
            f"object '{name}': {error}; give a Pose or a transform (4, 4)",
            Reason.OBJECT_NOT_FINITE.name,
        ) from None


def velocity_seen(name: str, velocity: ArrayLike | None, top: float) -> Floats:
    """Velocity of an object in a sighting, shape (3,) [m/s]; 0 if there is none.

    Raises:
        SceneError: It has the wrong shape.
        SightingError: It is not finite, or above the object's top speed.
    """
    if velocity is None:
        return np.zeros(3)
    found = np.asarray(velocity, dtype=np.float64)
    if found.shape != (3,):
        raise SceneError(
            f"object '{name}': velocity has shape {found.shape}; it must be 3 finite "
            "numbers [m/s]"
        )
    if not np.isfinite(found).all():
        says = f"velocity is {found}; it must be 3 finite numbers [m/s]"
        raise refused(name, Reason.OBJECT_NOT_FINITE, says)
    speed = float(np.linalg.norm(found))
    if speed > top:
        says = f"it was seen at {speed:.3f} m/s; its top_speed is {top} m/s"
        if looks_like_millimetres(speed):
            says += f"; that looks like millimetres a second, give m/s: {speed / 1e3:g}"
        raise refused(name, Reason.OBJECT_TOO_FAST, says)
    return found


def check_sighting(
    name: str,
    item: Standing,
    kinds: NDArray[np.int32],
    before: Sighting,
    now: Sighting,
    top: float,
) -> None:
    """Refuse a sighting that contradicts the last accepted one.

    Args:
        name: The object's name.
        item: The object.
        kinds: Kinds of its primitives, shape (k,).
        before: The last accepted sighting; its stamp is -inf if there was none.
        now: The new sighting.
        top: Greatest speed of any of its points [m/s].

    Raises:
        SightingError: The sighting is implausible.
    """
    if not isfinite(now.stamp):
        raise refused(
            name,
            Reason.OBJECT_NOT_FINITE,
            f"its stamp is {now.stamp}; it must be finite [s]",
        )
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
    if not way <= top * (time + STAMP_GRAIN) + 2.0 * item.error + GRAIN:
        says = f"{way:.3f} m in {time:.3f} s; its top_speed is {top} m/s"
        raise refused(name, Reason.OBJECT_JUMPED, says)


def refused(name: str, reason: Reason, says: str) -> SightingError:
    """The error of an implausible sighting."""
    return SightingError(f"object '{name}': {reason.sentence}: {says}", reason.name)


def least_way(kinds: NDArray[np.int32], before: Floats, now: Floats) -> float:
    """Lower bound of the greatest displacement of any point of an object [m].

    By points of its shapes, and by their bounding boxes: where a face of the box moved,
    a point of the shape moved at least as far.

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
    """Load the kernels of `stand_at` and `take_out`, which is too slow for a cycle."""
    tree = small_tree()
    world = tree.world
    row_bounds(int(world.kinds[0]), world.rows[0], 0.0, world.boxes[0])
    tree.remove(0)
    tree.insert(0)


def stand_at(index: Index, item: Standing, T: Floats) -> None:
    """Place the primitives of an object with its frame at T, and index them.

    Args:
        index: The index; its world is written.
        item: The object, present or not.
        T: Its frame in the world, shape (4, 4).
    """
    world = index.world
    rows = item.rows(T)
    take_out(index, item)
    for k in range(item.count):
        i = item.first + k
        world.rows[i] = rows[k]
        row_bounds(int(world.kinds[i]), world.rows[i], 0.0, world.boxes[i])
        index.insert(i)


def take_out(index: Index, item: Standing) -> None:
    """Remove the primitives of an object from the index."""
    for i in range(item.first, item.first + item.count):
        index.remove(i)
