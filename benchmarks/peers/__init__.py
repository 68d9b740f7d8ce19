"""Collision checkers of other projects, on the same tables in the same process."""

from collections.abc import Callable, Iterator
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from armguard.scene import SceneTables

Floats = NDArray[np.float64]
Pairs = set[tuple[int, int]]


# How to get a peer that is not there.
NOT_INSTALLED = "not installed; pip install 'armguard[bench]'"


class Peer(Protocol):
    """A checker that was given the scene's primitives and checked pairs.

    Attributes:
        name: Its name in the results.
    """

    name: str

    def step(self, q: Floats) -> object:
        """Judge one configuration; this is what is timed."""

    def near_pairs(self, q: Floats) -> Pairs:
        """Primitives (i < j) it finds within the margin."""


def available_peers(tables: SceneTables) -> Iterator[Peer | str]:
    """Every peer that is installed; for the others a sentence that says how."""
    yield from attempt(lambda: pinocchio_peers(tables), "pin coal")
    yield from attempt(lambda: mujoco_peers(tables), "mujoco")


def attempt(make: Callable[[], list[Peer]], packages: str) -> Iterator[Peer | str]:
    """The peers a maker makes, or how to install what it needs."""
    try:
        yield from make()
    except ImportError:
        yield f"{packages}: {NOT_INSTALLED}"


def pinocchio_peers(tables: SceneTables) -> list[Peer]:
    """Pinocchio with Coal, three ways."""
    from peers.pinocchio_coal import AllDistances, BroadPhase, MarginCollisions

    return [AllDistances(tables), MarginCollisions(tables), BroadPhase(tables)]


def mujoco_peers(tables: SceneTables) -> list[Peer]:
    """MuJoCo's kinematics and collision."""
    from peers.mujoco_margin import MujocoMargin

    return [MujocoMargin(tables)]


def checked_pairs(tables: SceneTables) -> list[tuple[int, int]]:
    """Pairs of primitives the scene checks, in order."""
    return [
        (i, j)
        for i in range(tables.moving_count)
        for j in range(i + 1, len(tables.kinds))
        if tables.checked[tables.groups[i], tables.groups[j]]
    ]
