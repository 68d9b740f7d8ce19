"""Objects of a scene: shapes and surfaces with a pose and settings."""

import logging
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, fields
from math import inf

import numpy as np
from numpy.typing import NDArray

from armguard.errors import SceneError
from armguard.geometry.pose import Pose
from armguard.geometry.shapes import HalfSpace, PlacedShape, Shape, Triangle
from armguard.robot.limits import LOOKS_LIKE_MILLIMETRES
from armguard.scene.meshes import Surface
from armguard.scene.meshes.surface import CORNERS
from armguard.scene.schema import BRIEF, TURN
from armguard.scene.settings import ObjectSettings

Floats = NDArray[np.float64]

log = logging.getLogger("armguard")

Part = Shape | PlacedShape | Surface

ORIGIN = Pose()

# Objects of a scene that the log names because they look like millimetres.
NAMED_STRANGE = 10

# Objects are seldom faster than this [m/s].
FAST_OBJECT = 15.0


@dataclass(frozen=True, kw_only=True, repr=False)
class SceneObject(ObjectSettings):
    """An object: a union of primitives.

    Attributes:
        name: Its name.
        shapes: Its shapes, in its own frame.
        surfaces: Its triangles, in its own frame.
        pose: Its frame in the world, or in the link it is attached to.
    """

    name: str
    shapes: tuple[PlacedShape, ...]
    surfaces: tuple[Surface, ...]
    pose: Pose

    def __repr__(self) -> str:
        """Name, shapes and place."""
        return f"<SceneObject {self.name}: {shapes_in_words(self)} at {self.pose}>"

    @property
    def movable(self) -> bool:
        """Whether it may be elsewhere than the scene says; all others are fixtures."""
        moves = self.top_speed > 0.0 or self.graspable is not None
        return moves or not self.present


def scene_object(
    name: str, parts: Sequence[Part], pose: Pose | None, settings: ObjectSettings
) -> SceneObject:
    """An object of its parts.

    Raises:
        SceneError: It has no part, or its parts and settings contradict each other.
    """
    if not parts:
        raise SceneError(f"object '{name}' has no shape")
    for part in parts:
        if not isinstance(part, Part):
            raise SceneError(
                f"object '{name}': {BRIEF.repr(part)} is no shape; give shapes such as "
                "Box(size=(1, 1, 1))"
            )
    made = SceneObject(
        name=name,
        shapes=tuple(
            part if isinstance(part, PlacedShape) else PlacedShape(part, ORIGIN)
            for part in parts
            if not isinstance(part, Surface)
        ),
        surfaces=tuple(part for part in parts if isinstance(part, Surface)),
        pose=checked_pose(f"object '{name}': pose", pose),
        **vars(settings),
    )
    if made.top_speed > FAST_OBJECT:
        log.warning(
            "object '%s': top_speed is %g m/s; if these are millimetres a second, "
            "give %g",
            *(name, made.top_speed, made.top_speed * 1e-3),
        )
    wrong = contradiction(made)
    if wrong is not None:
        raise SceneError(f"object '{name}' {wrong}")
    return made


def checked_pose(what: str, pose: object) -> Pose:
    """The pose, the origin if it is None.

    Args:
        what: What it is, for messages.
        pose: The pose.

    Raises:
        SceneError: It is none.
    """
    if pose is None:
        return ORIGIN
    if not isinstance(pose, Pose):
        raise SceneError(
            f"{what} is {BRIEF.repr(pose)}; give a Pose, such as "
            "Pose(xyz=(0, 0, 0), rpy=(0, 0, 0))"
        )
    if max(map(abs, pose.rpy)) > TURN:
        raise SceneError(
            f"{what}: rpy {list(pose.rpy)} looks like degrees; give radians"
        )
    return pose


def looks_like_millimetres(length: float) -> bool:
    """Whether a length looks like millimetres [m]."""
    return LOOKS_LIKE_MILLIMETRES < length < inf


def warn_of_length(what: str, length: float) -> bool:
    """Write to the log that a length looks like millimetres; whether it does.

    Args:
        what: What is so long or so far away.
        length: The length [m].
    """
    remark = length_remark(what, length)
    if remark:
        log.warning(remark)
    return bool(remark)


def length_remark(what: str, length: float) -> str:
    """Sentence that a length looks like millimetres; "" if it does not."""
    if not looks_like_millimetres(length):
        return ""
    metres = f"give metres: {length * 1e-3:g}"
    return f"{what}: {length:g} m look like millimetres; {metres}"


def placement_remark(name: str, T: Floats, shape: Shape | None) -> str:
    """Sentence that a pose or a new shape looks like millimetres, else "".

    Args:
        name: Name of the object that is placed.
        T: Its frame in the world, shape (4, 4).
        shape: Its new shape, None if it keeps the one that it has.
    """
    size = 0.0 if shape is None else longest_number(shape)
    far = float(np.abs(T[:3, 3]).max())
    return length_remark(f"object '{name}'", size) or length_remark(
        f"object '{name}': pose", far
    )


def strange_lengths(item: SceneObject) -> dict[str, float]:
    """Size and distance of an object that look like millimetres, by their names [m]."""
    sizes = [longest_number(placed.shape) for placed in item.shapes]
    sizes += [longest_side(surface) for surface in item.surfaces]
    lengths = {"": max(sizes), ": pose": max(map(abs, item.pose.xyz))}
    return {
        f"object '{item.name}'{what}": length
        for what, length in lengths.items()
        if looks_like_millimetres(length)
    }


def longest_number(shape: Shape) -> float:
    """Greatest of the sizes of a shape [m]."""
    sizes = [getattr(shape, part.name) for part in fields(shape) if part.init]
    return float(max(np.abs(size).max(initial=0.0) for size in sizes))


def farthest_point(placed: PlacedShape) -> float:
    """Greatest size of a placed shape, or distance of its frame from the origin [m]."""
    return max(longest_number(placed.shape), *map(abs, placed.pose.xyz))


def longest_side(surface: Surface) -> float:
    """Greatest side of the bounding box of a surface [m]."""
    corners = surface.rows[:, CORNERS]
    low, high = corners.min(axis=0), corners.max(axis=0)
    sides = high.reshape(3, 3).max(axis=0) - low.reshape(3, 3).min(axis=0)
    return float(sides.max())


def shapes_in_words(item: SceneObject) -> str:
    """Kinds of the parts of an object with their counts, as in "2 Box, 12 Triangle"."""
    counts = Counter(type(placed.shape).__name__ for placed in item.shapes)
    if item.surfaces:
        counts["Triangle"] += sum(map(len, item.surfaces))
    return ", ".join(f"{count} {kind}" for kind, count in counts.items())


def contradiction(item: SceneObject) -> str | None:
    """What in an object's shapes and settings cannot be together; None if all can."""
    link, grasped = item.attached_to, item.graspable is not None
    moves = item.top_speed != 0.0 or item.person
    if link is not None and item.surfaces:
        return riding_surface(link)
    if link is not None and not item.present:
        return (
            f"rides on '{link}' and is not present; only a stationary object "
            "can be added later"
        )
    if link is not None and moves:
        return (
            f"rides on '{link}' and has a top_speed or is a person; it moves as its "
            "link does, leave them out"
        )
    if item.top_speed == 0.0 and (item.error > 0.0 or item.stale < inf):
        return "has error or stale and no top_speed; only what moves has sightings"
    if grasped and (link is not None or moves):
        return (
            "is graspable and is attached, has a top_speed or is a person; leave one "
            "of them out"
        )
    endless = (isinstance(p.shape, HalfSpace | Triangle) for p in item.shapes)
    if grasped and (item.surfaces or any(endless)):
        return (
            "is graspable and has triangles or a half-space, which no gripper carries; "
            "give a mesh as 'hull' or as 'pieces'"
        )
    if not grasped and item.rests_on is not None:
        return "has rests_on and is not graspable; leave it out"
    return None


def riding_surface(link: str) -> str:
    """Why triangles cannot be attached, and what can."""
    return (
        f"is a mesh of triangles, which stand still; to ride on '{link}' give the mesh "
        "as 'hull' or as 'pieces'"
    )
