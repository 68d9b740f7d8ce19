"""Static objects, which may be added, removed and moved while a guard runs."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import inf
from typing import Self

import numpy as np
from numpy.typing import NDArray

from armguard.errors import SceneError, UnknownNameError, did_you_mean
from armguard.geometry.shapes import PlacedShape, Shape
from armguard.scene.blocks import WITH_ADDRESS, blocks_of, stacked_rows
from armguard.scene.meshes.surface import Surface
from armguard.scene.objects import SceneObject

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Standing:
    """A static object, and its place in the tables.

    Attributes:
        first: Its first primitive.
        count: How many it has.
        present: Whether it is there from the start.
        shapes: Its shapes, in its own frame.
        surfaces: Its triangles, in its own frame.
        body: Its own body if it may be gripped, else -1.
        error: How far off it may be seen [m].
        stale: Age from which on a sighting of it is refused [s].
    """

    first: int
    count: int
    present: bool
    shapes: tuple[PlacedShape, ...]
    surfaces: tuple[Surface, ...]
    body: int = -1
    error: float = 0.0
    stale: float = inf

    @property
    def places(self) -> slice:
        """Places of its primitives in the tables."""
        return slice(self.first, self.first + self.count)

    def rows(self, T: Floats) -> Floats:
        """Rows of its primitives where its frame is at T, shape (count, 16)."""
        return stacked_rows(list(blocks_of("", self.shapes, self.surfaces, T, -1)))

    def reshaped(self, name: str, shape: Shape) -> Self:
        """A copy with another shape of the same kind.

        Raises:
            SceneError: It is not one shape of that kind, or its shape cannot change.
        """
        said = f"object '{name}' cannot change its shape"
        if len(self.shapes) != 1 or self.surfaces:
            raise SceneError(f"{said}: it is not one shape")
        if self.body >= 0:
            raise SceneError(f"{said}: it may be gripped")
        old = self.shapes[0]
        was, becomes = old.shape.kind, shape.kind
        if was is not becomes or was in WITH_ADDRESS:
            raise SceneError(
                f"{said}: it is a {was.name.lower()}, to become a "
                f"{becomes.name.lower()}"
            )
        return replace(self, shapes=(replace(old, shape=shape),))


def object_named(name: str, known: Mapping[str, Standing]) -> Standing:
    """The object of that name that is attached to no link.

    Raises:
        UnknownNameError: There is no such object.
    """
    if name not in known:
        raise UnknownNameError(
            f"no fixed object is named '{name}'; {did_you_mean(name, known)}"
        )
    return known[name]


def standing_objects(
    objects: Mapping[str, SceneObject],
    places: Mapping[str, tuple[int, int]],
    bodies: Mapping[str, int],
) -> dict[str, Standing]:
    """Objects that are attached to nothing, by name.

    Args:
        objects: All objects of the scene.
        places: First primitive of each, and the one after its last.
        bodies: Bodies of those that may be gripped.
    """
    return {
        name: Standing(
            first=places[name][0],
            count=places[name][1] - places[name][0],
            present=item.present,
            shapes=item.shapes,
            surfaces=item.surfaces,
            body=bodies.get(name, -1),
            error=item.error,
            stale=item.stale,
        )
        for name, item in objects.items()
        if item.attached_to is None
    }
