"""Modelled objects that are not where the scene has them."""

import numpy as np

from armguard.sense.frames import Frame
from armguard.sense.prediction import Prediction
from armguard.sense.view import View
from armguard.sense.world import World

# Frames in a row that have to look through an object, the least zones of each that it
# has to fill, the share of these that look through it, and the time it takes [s]: a
# sensor that is mounted elsewhere is found before.
FRAMES, ZONES, SHARE, TIME = 5, 4, 0.6, 0.9


class MissingObjects:
    """Objects through which sensors look.

    Attributes:
        since: When each was found [s].

    Args:
        world: The scene.
    """

    def __init__(self, world: World) -> None:
        names = world.object_names
        self._objects = np.unique(names[names != ""])
        self._number = np.searchsorted(self._objects, names)
        self._number[names == ""] = -1
        self._frames = np.zeros(len(self._objects), dtype=np.int64)
        self._first = np.zeros(len(self._objects))
        self.since: dict[str, float] = {}

    def look(
        self, view: View, frame: Frame, prediction: Prediction, stamp: float
    ) -> None:
        """Compare a frame with its prediction.

        Args:
            view: The sensor.
            frame: The frame.
            prediction: What it has to measure.
            stamp: The time [s].
        """
        if not len(self._objects):
            return
        depth = np.where(
            view.predicted(frame.nothing), np.inf, view.predicted(frame.depth)
        )
        within = prediction.far < 0.8 * view.sensor.range[1]
        primitive = prediction.primitive
        number = np.where(primitive >= 0, self._number[primitive], -1)
        chosen = (number >= 0) & within & ~np.isnan(depth)
        if not chosen.any():
            return
        beyond = depth > prediction.far + 2.0 * view.slack(prediction.far)
        count, through = (
            np.bincount(number[some], minlength=len(self._objects))
            for some in (chosen, chosen & beyond)
        )
        seen = count >= ZONES
        gone = seen & (through >= SHARE * count)
        self._first[seen & gone & (self._frames == 0)] = stamp
        self._frames = np.where(gone, self._frames + 1, self._frames)
        self._frames[seen & ~gone] = 0
        enough = (self._frames >= FRAMES) & (stamp - self._first >= TIME)
        for k in np.flatnonzero(seen).tolist():
            name = str(self._objects[k])
            if enough[k]:
                self.since.setdefault(name, stamp)
            elif not gone[k]:
                self.since.pop(name, None)
