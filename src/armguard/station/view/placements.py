"""Where objects stand, as far as frames tell: what was placed and what was removed."""

import itertools
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.shapes import Shape
from armguard.scene.scene import Scene
from armguard.scene.standing import Standing
from armguard.station.shape_words import shape_of

Floats = NDArray[np.float64]

FRESH = itertools.count()


class Placements:
    """Where each object that may come and go stands; by its name.

    Attributes:
        changes: Another number after every change, so that a drawing knows when to
            look.

    Args:
        scene: The scene, whose objects stand where it says until they are placed.
    """

    def __init__(self, scene: Scene) -> None:
        self.changes = next(FRESH)
        self._poses: dict[str, Floats | None] = {
            name: thing.pose.matrix() if thing.present else None
            for name, thing in scene.objects.items()
            if thing.attached_to is None
        }
        self._shapes: dict[str, Shape] = {}

    @property
    def poses(self) -> Mapping[str, Floats | None]:
        """Frame of each object, shape (4, 4); None of one that is not there."""
        return self._poses

    @property
    def shapes(self) -> Mapping[str, Shape]:
        """Shapes of the objects that were given another one when they were placed."""
        return self._shapes

    def standing(self, name: str, thing: Standing) -> Standing:
        """An object of the tables, with the shape that it has now."""
        shape = self._shapes.get(name)
        if shape is None:
            return thing
        return replace(thing, shapes=(replace(thing.shapes[0], shape=shape),))

    def begin_with(self, objects: Mapping[str, Mapping[str, Any] | None]) -> None:
        """Take over where things are already, as a service lists them."""
        for name, put in objects.items():
            call = "remove" if put is None else "place"
            self.take({"call": call, "name": name, **(put or {})})

    def take(self, event: Mapping[str, Any]) -> None:
        """Take an event's frame's text; of other calls nothing is kept."""
        name = event.get("name")
        if not isinstance(name, str) or name not in self._poses:
            return
        if event.get("call") == "place":
            self._poses[name] = np.array(event["pose"], dtype=np.float64)
            if event.get("shape") is not None:
                self._shapes[name] = shape_of(event["shape"])
        elif event.get("call") == "remove":
            self._poses[name] = None
        else:
            return
        self.changes = next(FRESH)
