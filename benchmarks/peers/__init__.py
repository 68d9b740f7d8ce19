"""Collision checkers of other projects, on the same tables in the same process."""

from collections.abc import Iterator
from importlib import import_module
from typing import Protocol

from armguard.scene import SceneTables
from arrays import Floats

Pairs = set[tuple[int, int]]


# How to get a peer that is not there.
NOT_INSTALLED = "not installed; pip install 'armguard[bench]'"


class Peer(Protocol):
    """A checker that was given the scene's primitives and checked pairs.

    Attributes:
        name: Its name in the results.
    """

    name: str

    def positions(self, q: Floats) -> Floats:
        """Configurations as `step` takes them, of rows of `q`, shape (k, n)."""

    def step(self, q: Floats) -> object:
        """Judge one configuration; this is what is timed."""

    def near_pairs(self, q: Floats) -> Pairs:
        """Primitives (i < j) it finds within the margin."""


# Packages to install, and the module of the peers that need them.
MODULES = {"pin coal": "pinocchio_coal", "mujoco": "mujoco_margin"}


def available_peers(tables: SceneTables) -> Iterator[Peer | str]:
    """Every peer that is installed; for the others a sentence that says how."""
    for packages, module in MODULES.items():
        try:
            kinds = import_module(f"peers.{module}").PEERS
        except ImportError:
            yield f"{packages}: {NOT_INSTALLED}"
        else:
            yield from (kind(tables) for kind in kinds)


def checked_pairs(tables: SceneTables) -> list[tuple[int, int]]:
    """Pairs of primitives the scene checks, in order."""
    return [
        (i, j)
        for i in range(tables.moving_count)
        for j in range(i + 1, len(tables.kinds))
        if tables.checked[tables.groups[i], tables.groups[j]]
    ]
