"""What arms lose of their desired motion, and why they stop."""

from collections import Counter
from typing import Any

import numpy as np

from armguard.guard import Level
from armguard.guard.near_pair import NearPair
from armguard.guard.verdict import Verdict
from arrays import Floats
from episodes.follower import Follower
from freedom.losses import Losses
from freedom.worlds import PERIOD

# Cycles from one look at the causes of slowing to the next, and share of the desired
# motion from which a loss has a cause [-].
EVERY, LOST = 5, 0.02


class Tally:
    """Losses and stops of a run, by their causes.

    Args:
        plant: The arms.
        losses: Judges losses by cells; None without sensors.
    """

    def __init__(self, plant: Follower, losses: Losses | None) -> None:
        self._plant, self._losses = plant, losses
        self._stopped = dict.fromkeys(plant.own, True)
        self._lost: Counter[str] = Counter()
        self._cells: Counter[str] = Counter()
        self._stops: Counter[str] = Counter()
        self._needless: Counter[str] = Counter()

    def count(self, verdict: Verdict, desired: Floats, kept: Floats) -> None:
        """Count what a cycle costs.

        Args:
            verdict: Its verdict.
            desired: Desired speeds, shape (n,) [rad/s].
            kept: The parts of them that the command does.
        """
        for arm, own in self._plant.own.items():
            missed = float((desired - kept)[own].sum())
            stops = verdict.levels[arm] >= Level.STOP
            begins = stops and not self._stopped[arm]
            self._stopped[arm] = stops
            due = self._plant.cycles % EVERY == 0
            if due and missed > LOST * desired[own].sum():
                way = EVERY * PERIOD * missed
                self._lost[cause_of(verdict, arm)] += way
                if (cells := self._cells_of(verdict, arm)) is not None:
                    self._cells[cells] += way
            if begins:
                self._stops[cause_of(verdict, arm)] += 1
                cells = self._cells_of(verdict, arm)
                if cells is not None and self._losses is not None:
                    needless = self._losses.is_needless(self._plant, arm)
                    self._needless[cells if needless else "needed"] += 1

    def figures(self) -> dict[str, Any]:
        """Ways that were lost and stops by cause, and by class of the cells.

        Returns:
            Ways that were lost by cause, and those that cells cost by their class
            [rad]; stops by cause; stops by cells, the needless ones by their class.
        """
        return {
            "lost": dict(self._lost), "cells": dict(self._cells),
            "stops": dict(self._stops), "needless": dict(self._needless),
        }  # fmt: skip

    def _cells_of(self, verdict: Verdict, arm: str) -> str | None:
        """Class of the cells that slow or stop an arm, None for another cause."""
        pair = nearest_of(verdict, arm)
        if pair is None or pair.sensed is None or self._losses is None:
            return None
        return self._losses.of_point(pair.point_b, not pair.sensed.unseen)


def nearest_of(verdict: Verdict, arm: str) -> NearPair | None:
    """Pair of an arm with the least headroom; None if none is near."""
    if not np.isfinite(verdict.headroom.m):
        return None
    pairs = [p for p in verdict.near if arm in (p.a.split("/")[0], p.b.split("/")[0])]
    return min(pairs, key=lambda pair: pair.headroom, default=None)


def cause_of(verdict: Verdict, arm: str) -> str:
    """What slows or stops an arm: side B of its pair with the least headroom."""
    if not np.isfinite(verdict.headroom.m) or not verdict.near:
        return verdict.causes.get(arm, verdict.reason).name
    nearest = nearest_of(verdict, arm)
    return "no near pair" if nearest is None else side_of(nearest)


def side_of(pair: NearPair) -> str:
    """Kind of side B of a pair."""
    if pair.sensed is not None:
        return "not known free" if pair.sensed.unseen else "occupied"
    return "foreign object" if pair.b.startswith("foreign") else "model"
