"""Objects of a scene: shapes and surfaces with a pose and settings."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf

from armguard.errors import SceneError
from armguard.geometry.pose import Pose
from armguard.geometry.shapes import HalfSpace, PlacedShape, Shape, Triangle
from armguard.scene.meshes import Surface
from armguard.scene.schema import part_of
from armguard.scene.settings import ObjectSettings

Part = Shape | PlacedShape | Surface


@dataclass(frozen=True, kw_only=True)
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
    made = SceneObject(
        name=name,
        shapes=tuple(
            part if isinstance(part, PlacedShape) else PlacedShape(part)
            for part in parts
            if not isinstance(part, Surface)
        ),
        surfaces=tuple(part for part in parts if isinstance(part, Surface)),
        pose=Pose() if pose is None else pose,
        **part_of(settings, ObjectSettings),
    )
    if made.attached_to is not None:
        check_attached(made, made.attached_to)
    if made.top_speed == 0.0 and (made.error > 0.0 or made.stale < inf):
        raise SceneError(
            f"object '{name}' has error or stale and no top_speed; only what moves has "
            "sightings"
        )
    if made.graspable is not None:
        check_carried(made)
    elif made.rests_on is not None:
        raise SceneError(
            f"object '{name}' has rests_on and is not graspable; leave it out"
        )
    return made


def check_attached(thing: SceneObject, link: str) -> None:
    """Refuse what cannot ride on a link.

    Raises:
        SceneError: It has triangles, is not present, or moves by itself.
    """
    if thing.surfaces:
        raise SceneError(riding_surface(thing.name, link))
    if not thing.present:
        raise SceneError(
            f"object '{thing.name}' rides on '{link}' and is not present; only what "
            "stands still can come later"
        )
    if thing.top_speed != 0.0 or thing.person:
        raise SceneError(
            f"object '{thing.name}' rides on '{link}' and has a top_speed or is a "
            "person; it moves as its link does, leave them out"
        )


def riding_surface(name: str, link: str) -> str:
    """Why triangles cannot be attached, and what can."""
    return (
        f"object '{name}' is a mesh of triangles, which stand still; to ride on "
        f"'{link}' give the mesh as 'hull' or as 'pieces'"
    )


def check_carried(thing: SceneObject) -> None:
    """Refuse what is graspable and cannot be carried.

    Raises:
        SceneError: It moves otherwise, or has a shape that no gripper carries.
    """
    if thing.attached_to is not None or thing.top_speed != 0.0 or thing.person:
        raise SceneError(
            f"object '{thing.name}' is graspable and is attached, has a top_speed or "
            "is a person; leave one of them out"
        )
    shapes = [placed.shape for placed in thing.shapes]
    if thing.surfaces or any(isinstance(s, HalfSpace | Triangle) for s in shapes):
        raise SceneError(
            f"object '{thing.name}' is graspable and has triangles or a half-space, "
            "which no gripper carries; give a mesh as 'hull' or as 'pieces'"
        )
