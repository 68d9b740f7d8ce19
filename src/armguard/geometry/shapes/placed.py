"""A shape with a place."""

from dataclasses import dataclass, field

from armguard.geometry.pose import Pose
from armguard.geometry.shapes.registry import Shape


@dataclass(frozen=True, slots=True)
class PlacedShape:
    """A shape and the pose of its frame in a link, an object or the world.

    Attributes:
        shape: The shape.
        pose: Its frame in the parent's.
        model_error: Largest distance from the shape's surface to the surface it
            encloses; 0 where it *is* that surface [m].
    """

    shape: Shape
    pose: Pose = field(default_factory=Pose)
    model_error: float = 0.0
