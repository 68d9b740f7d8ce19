"""Clearance of the nearest pair over the last seconds."""

import numpy as np
import viser
from viser import uplot

from armguard.guard.verdict import Verdict
from armguard.station.palette import BLUE, VERMILLION, hexadecimal

# What is shown, and how often it is added to [s].
SPAN, STEP = 20.0, 0.1

# Points are sent this often [s].
REDRAW = 0.3


class ClearancePlot:
    """The plot; where nothing is near it is at its upper edge.

    Args:
        server: The page.
        margin: Clearance from which on nothing is reported [m].
    """

    def __init__(self, server: viser.ViserServer, margin: float) -> None:
        count = round(SPAN / STEP)
        self._top = margin * 1e3
        self._times = np.linspace(-SPAN, 0.0, count)
        self._values = np.full(count, self._top)
        self._least = self._top
        self._added = self._sent = -np.inf
        self._plot = server.gui.add_uplot(
            (self._times, self._values, np.zeros(count)),
            (
                uplot.Series(label="s"),
                uplot.Series(label="clearance [mm]", stroke=hexadecimal(BLUE), width=2),
                uplot.Series(
                    label="stop", stroke=hexadecimal(VERMILLION), width=2, dash=[6, 4]
                ),
            ),
            title="nearest pair: clearance [mm], last 20 s",
            scales={
                "x": uplot.Scale(time=False, range=(-SPAN, 0.0)),
                "y": uplot.Scale(range=(-0.3 * self._top, 1.05 * self._top)),
            },
            legend=uplot.Legend(show=False),
            height=150,
        )

    def add(self, verdict: Verdict, now: float) -> None:
        """Take a verdict in; of those within a step the least counts.

        Args:
            verdict: The verdict.
            now: The present on any clock that rises [s].
        """
        nearest = verdict.nearest
        clearance = self._top if nearest is None else nearest.clearance * 1e3
        self._least = min(self._least, clearance)
        if now - self._added < STEP:
            return
        # Time in which nothing came is a gap of nothing new: the last value stays.
        steps = 1 if not np.isfinite(self._added) else round((now - self._added) / STEP)
        self._added = now
        steps = min(max(steps, 1), len(self._values))
        self._values = np.append(
            self._values[steps:], np.full(steps, min(self._least, self._top))
        )
        self._least = self._top
        if now - self._sent >= REDRAW:
            self._sent = now
            self._plot.data = (
                self._times,
                np.maximum(self._values, -0.3 * self._top),
                np.zeros(len(self._times)),
            )
