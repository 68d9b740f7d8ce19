"""What is near: lines between witness points, and the distance each pair needs."""

from typing import Any

import numpy as np
import viser

from armguard.guard.answer import NearPair
from armguard.guard.levels import Level
from armguard.guard.verdict import Verdict
from armguard.guard.watch import SLOW_TIME_DEFAULT
from armguard.scene.tables import SceneTables
from armguard.station.palette import GREEN, LEVEL_COLOURS, LEVEL_WORDS, Rgb
from armguard.station.view.drawing.bodies import add_mesh
from armguard.station.view.surfaces import mesh_of

# Pairs with a line; with a label; with shells. The nearest ones.
LINES, LABELS, SHELLS = 64, 3, 4

# A shell follows what its pair needs in steps of this [m].
STEP = 0.005


class NearPairs:
    """Lines, labels and shells of the nearest pairs.

    Args:
        server: The page's scene.
        tables: The scene.
    """

    def __init__(self, server: viser.ViserServer, tables: SceneTables) -> None:
        self._server, self._tables = server, tables
        self._index = {label: i for i, label in enumerate(tables.labels)}
        self._lines: Any | None = None
        self._labels = [
            server.scene.add_label(
                f"/near/label_{k}", "", visible=False, anchor="bottom-center"
            )
            for k in range(LABELS)
        ]
        self._texts = [""] * LABELS
        self._shells: dict[int, tuple[Any, int, Rgb]] = {}
        self.shells_shown = True

    def draw(self, verdict: Verdict) -> None:
        """Draw the near pairs of a verdict, and nothing of an earlier one."""
        pairs = sorted(verdict.near, key=lambda pair: pair.clearance)
        self._draw_lines(pairs[:LINES])
        self._draw_labels(pairs[:LABELS])
        self._draw_shells(pairs[:SHELLS] if self.shells_shown else [])

    def _draw_lines(self, pairs: list[NearPair]) -> None:
        if not pairs:
            if self._lines is not None:
                self._lines.visible = False
            return
        points = np.array([[pair.point_a, pair.point_b] for pair in pairs])
        colours = np.array([[pair_colour(pair)] * 2 for pair in pairs], dtype=np.uint8)
        if self._lines is None:
            self._lines = self._server.scene.add_line_segments(
                "/near/lines", points, colours, thickness=0.008
            )
            return
        self._lines.points, self._lines.colors = points.astype(np.float32), colours
        if not self._lines.visible:
            self._lines.visible = True

    def _draw_labels(self, pairs: list[NearPair]) -> None:
        for k, label in enumerate(self._labels):
            if k >= len(pairs):
                if label.visible:
                    label.visible = False
                continue
            pair = pairs[k]
            label.position = (pair.point_a + pair.point_b) / 2.0
            text = f"{pair_word(pair)} {pair.distance * 1e3:.0f} mm"
            if text != self._texts[k]:
                label.text = self._texts[k] = text
            if not label.visible:
                label.visible = True

    def _draw_shells(self, pairs: list[NearPair]) -> None:
        wanted: dict[int, tuple[float, Rgb]] = {}
        for pair in pairs:
            for i, need in self._needs(pair):
                if need > wanted.get(i, (0.0,))[0]:
                    wanted[i] = need, pair_colour(pair)
        for i in [i for i in self._shells if i not in wanted]:
            self._shells.pop(i)[0].remove()
        for i, (need, colour) in wanted.items():
            steps = round(need / STEP)
            known = self._shells.get(i)
            if known is not None and known[1] == steps:
                if known[2] != colour:
                    known[0].color = colour
                    self._shells[i] = (known[0], steps, colour)
                continue
            self._shells[i] = (self._shell(i, steps * STEP, colour), steps, colour)

    def _needs(self, pair: NearPair) -> list[tuple[int, float]]:
        """Moving primitives of a pair, and each one's share of what the pair needs.

        Where both sides move each has half of it, so that shells meet just when the
        pair has nothing left.
        """
        i, j = self._index[pair.primitive_a], self._index[pair.primitive_b]
        need = max(pair.needed, STEP)
        moving = [k for k in (i, j) if k < self._tables.moving_count]
        return [(k, need / len(moving)) for k in moving]

    def _shell(self, i: int, grown: float, colour: Rgb) -> Any:
        body = int(self._tables.bodies[i])
        mesh = mesh_of(self._tables.kinds[i], self._tables.local_rows[i], grown)
        path = f"/bodies/{body}/shell_{i}"
        return add_mesh(self._server, path, mesh, colour, opacity=0.22)


def pair_level(pair: NearPair) -> Level:
    """What a pair alone would ask for."""
    if not pair.clearance >= 0.0:
        return Level.STOP
    return Level.SLOW if pair.time_left < SLOW_TIME_DEFAULT else Level.CAUTION


def pair_colour(pair: NearPair) -> Rgb:
    """Colour of a pair: of its level, or of contact that is allowed."""
    return GREEN if pair.contract else LEVEL_COLOURS[pair_level(pair)]


def pair_word(pair: NearPair) -> str:
    """The word that goes with the colour."""
    return "allowed" if pair.contract else LEVEL_WORDS[pair_level(pair)]
