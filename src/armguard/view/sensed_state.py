"""Sensed space of a service, by the frames of its ring."""

from collections.abc import Mapping
from typing import Any

from armguard.cells.view import CellView
from armguard.errors import CellMapError
from armguard.recording.calls import UpdateCells
from armguard.scene.scene import Scene


class SensedState:
    """Cells and health of sensors, by the events and notes of frames.

    Attributes:
        view: The cells; None without sensed space.
        health: State of each sensor in words, by name.
        revision: Another number after every change of cells.

    Args:
        scene: The scene.
    """

    def __init__(self, scene: Scene) -> None:
        self.health: dict[str, str] = {}
        self.revision = 0
        self.view: CellView | None = None
        if scene.sensing is not None:
            region = scene.sensing.region
            self.view = CellView(region.centre, scene.sensing.cell, region.size)

    def apply(self, event: Mapping[str, Any]) -> None:
        """Apply the text of an event's frame; calls of other kinds change nothing."""
        if self.view is None or event.get("call") != UpdateCells.call:
            return
        words = {key: value for key, value in event.items() if key != "call"}
        try:
            self.view.apply(UpdateCells.model_validate(words).deltas)
        except (ValueError, CellMapError):
            # A recording with other bytes in it.
            return
        self.revision += 1

    def note(self, text: Mapping[str, Any]) -> None:
        """Take over the text of a note about sensors."""
        found = text["sensors"].items()
        self.health.update({name: str(one["says"]) for name, one in found})
