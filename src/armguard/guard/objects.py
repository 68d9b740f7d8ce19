"""Objects that come, go and stand elsewhere between two cycles."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from armguard.errors import SceneError
from armguard.geometry.bounds import row_bounds
from armguard.geometry.shapes import Shape
from armguard.index.base import Index
from armguard.scene.blocks import WITH_ADDRESS
from armguard.scene.standing import Standing

Floats = NDArray[np.float64]


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
