"""Sensed space of a guard between two cycles: cells taken over, claims of objects."""

from collections.abc import Mapping
from math import isfinite
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armguard.cells.deltas import Delta
from armguard.cells.state import (
    ALL,
    NO_SENSOR,
    NONE,
    SEVERAL,
    Claims,
    Motion,
    empty_claims,
)
from armguard.cells.view import CellView
from armguard.errors import CellMapError
from armguard.geometry.shapes import Box, shape_row
from armguard.guard.checkpoint_bounds import FLAG, MOST_COUNTED, Own, Rules, Whole
from armguard.guard.known import KnownFree, known_free
from armguard.guard.sensed import KIND_OF, CellKind, Sensed, empty_sensed
from armguard.guard.sensed_pairs import judge_sensed
from armguard.guard.sensed_words import (
    mark_inside,
    sort_some,
    sort_words,
    take_claims,
)
from armguard.index import BruteForce, Octree
from armguard.index.octree_state import ABSENT
from armguard.record import Records, dtype_of, records
from armguard.scene.sensing import SceneSensing
from armguard.scene.tables import SceneTables
from armguard.separate import link_missing
from armguard.table import Ledger

Words = NDArray[np.uint64]

# Changes that one call takes over at most, at some 50 nanoseconds each.
MOST_DELTAS = 4096

# Rules of a checkpoint for sensed cells.
BOUNDS: Rules = {
    "sensed.occupied": [Whole(0, int(ALL))],
    "sensed.unknown": [Whole(0, int(ALL))],
    "sensed.motion": [FLAG],
    "sensed.source": [Whole(0, SEVERAL)],
    "sensed.about": [
        Own(("outside", "speed", "stale")),
        Whole(0, MOST_COUNTED, ("used", "spent", "limit", "listed")),
    ],
}


class SensedSpace:
    """Sensed space of a guard.

    Attributes:
        view: The cells as the map claims them; None if the scene has no `sensing`.
        table: Arrays for kernels.
        ledger: Ledger of the table.

    Args:
        tables: Tables of the guard, with slots.
        index: Its index; objects in it claim the cells inside them.
    """

    def __init__(self, tables: SceneTables, index: Octree | BruteForce) -> None:
        self._tables, self._index = tables, index
        sensing = tables.sensing
        self.view: CellView | None = None
        claims: Claims = empty_claims(np.zeros(3), 1.0, 0)
        if sensing is not None:
            region = sensing.region
            self.view = CellView(region.centre, sensing.cell, region.size)
            claims = self.view.claims
        self.table: Sensed = empty_sensed(tables, claims)
        self.ledger = Ledger(self.table)
        self._rows = np.zeros((0, 16))
        self._marks: dict[int, tuple[NDArray[np.int64], Words]] = {}
        if sensing is not None:
            link_missing(judge_sensed)
            self._write_zones(sensing)
            self._rows = np.full((tables.modelled, 16), np.nan)
            self.claim()
            sort_words(self.ledger.lines)

    def update_cells(self, deltas: Records[Delta], stamp: float) -> None:
        """Take over changes of a map of cells.

        Call it between two cycles, each time with a bounded number of changes. The
        stamp says how old the cells are, so a map that is behind makes robots slow.

        Args:
            deltas: Result of `CellMap.take_deltas` of a map of the scene's region, at
                most 4096; none to confirm all cells.
            stamp: Time at which all claims of the map hold, on the clock of `step`: the
                newest frame whose changes have all been taken over [s].

        Raises:
            CellMapError: The scene has no `sensing`, the changes are none of such a
                map or too many, or the stamp is not finite or older than the last one.
                Nothing has changed, and the cells grow old.

        Example:
            >>> import armguard as ag
            >>> scene = ag.bay_scene("path")
            >>> scene.set_sensing(
            ...     region={"centre": (1.4, 0, 1.0)},
            ...     cell=0.04,
            ...     unknown="free",
            ...     reason="a closed cell",
            ...     intruder={"speed": 0.0, "size": 0.05},
            ... )
            >>> guard, cells = ag.Guard(scene), ag.CellMap((1.4, 0, 1.0), 0.04)
            >>> guard.update_cells(cells.take_deltas(), stamp=0.0)
        """
        about: Any = self.table.about
        if self.view is None:
            raise CellMapError("the scene has no `sensing`; declare its region first")
        if not (isinstance(stamp, int | float) and isfinite(stamp)):
            raise CellMapError(f"stamp is {stamp!r}; it must be finite [s]")
        if stamp < about["stamp"]:
            raise CellMapError(
                f"stamp is {stamp:.6f} s, older than the last one, "
                f"{about['stamp']:.6f} s; check the clocks"
            )
        check_deltas(deltas, len(self.table.claims.stamp))
        take_claims(deltas, self.ledger.lines)
        about["stamp"] = stamp
        about["newest"] = max(float(about["newest"]), stamp)

    def forgetting(self) -> tuple[Records[Delta], float]:
        """Changes after which no cell is known free, and the stamp to give them with.

        For a map that begins anew, whose first changes must come after them. Occupied
        cells stay until the new map has looked there.

        Returns:
            Changes for `update_cells`, of any count; and the stamp of the last ones,
            minus infinity before the first [s].
        """
        claims = self.table.claims
        occupied, unknown = claims.occupied.words, claims.unknown.words
        words = np.flatnonzero(occupied | unknown != ALL)
        changes: Any = records(len(words), Delta)
        changes["bits"][:, 0], changes["bits"][:, 1] = occupied[words], ~occupied[words]
        for name in ("stamp", "error", "motion"):
            changes[name] = getattr(claims, name)[words]
        changes["word"] = words
        return changes, float(self.table.about.stamp)

    def knowledge(self, link: str, direction: ArrayLike) -> KnownFree:
        """How far a link can be moved along a direction in space that is known free.

        From where it was in the last cycle, as the cells are now; objects of the scene
        count as free.

        Args:
            link: 'robot/link'.
            direction: Direction in the world, shape (3,).

        Raises:
            CellMapError: The scene has no `sensing`, or the direction is none.
            UnknownNameError: There is no such link, or it has no shape that moves.
        """
        if self.view is None:
            raise CellMapError("the scene has no `sensing`; declare its region first")
        world = self._index.world
        return known_free(link, direction, self._tables, world, self.table)

    def claim(self) -> None:
        """Leave out the cells inside the objects that are present, as they are now."""
        if self.view is None:
            return
        tables, rows = self._tables, self._index.world.rows
        present = self._index.state.residency["status"] != ABSENT
        moving = tables.moving_count
        present[:moving] &= tables.robot_of_primitive < 0
        now = np.where(present[: tables.modelled, None], rows[: tables.modelled], 0.0)
        changed = np.flatnonzero((now != self._rows).any(axis=1))
        if len(changed) == 0:
            return
        self._rows = now
        claims, before = self.table.claims, self.table.claimed.copy()
        for i in changed.tolist():
            self._marks.pop(i, None)
            if present[i]:
                found = np.zeros_like(self.table.claimed)
                kind = int(tables.kinds[i])
                cell = float(claims.lattice.cell)
                mark_inside(kind, rows[i], cell, claims.lattice, found)
                places = np.flatnonzero(found)
                self._marks[i] = places, found[places]
        self.table.claimed[:] = NONE
        for places, bits in self._marks.values():
            self.table.claimed[places] |= bits
        sort_some(np.flatnonzero(self.table.claimed != before), self.ledger.lines)

    def renew(self) -> None:
        """Sort all cells by kind, after the claims were restored."""
        if self.view is not None:
            sort_words(self.ledger.lines)

    def kept(self) -> dict[str, NDArray[Any]]:
        """Arrays for a checkpoint, by name; none without `sensing`."""
        if self.view is None:
            return {}
        claims, about = self.table.claims, self.table.about
        found: Mapping[str, Any] = {
            "occupied": claims.occupied.words,
            "unknown": claims.unknown.words,
            "stamp": claims.stamp,
            "error": claims.error,
            "motion": claims.motion,
            "source": claims.source,
            "about": about,
        }
        return {f"sensed.{name}": array for name, array in found.items()}

    def _write_zones(self, sensing: SceneSensing) -> None:
        """Write as what kind each cell counts that is not known free."""
        kinds = {
            CellKind.UNSEEN: self.table.may_be_unseen,
            CellKind.GROWING: self.table.may_be_growing,
        }
        if sensing.unknown != "free":
            kinds[CellKind(KIND_OF[sensing.unknown])][:] = ALL
        # The first zone counts, so it is written last.
        for zone in reversed(list(sensing.zones.values())):
            inside = np.zeros_like(self.table.claimed)
            row = shape_row(Box(size=zone.box), zone.pose.matrix())
            mark_inside(int(Box.kind), row, 0.0, self.table.claims.lattice, inside)
            for kind, may_be in kinds.items():
                counts = KIND_OF[zone.unknown] == kind
                may_be[:] = may_be | inside if counts else may_be & ~inside


def check_deltas(deltas: Records[Delta], words: int) -> None:
    """Refuse changes that no map of this size makes.

    Args:
        deltas: The changes.
        words: Count of words.

    Raises:
        CellMapError: They are none of such a map, or too many.
    """
    found: Any = deltas
    kind = getattr(found, "dtype", None)
    if kind != dtype_of(Delta) or found.ndim != 1 or not found.flags.c_contiguous:
        raise CellMapError(
            "deltas are no changes of a map; give the result of `take_deltas`"
        )
    if len(found) > MOST_DELTAS:
        raise CellMapError(
            f"there are {len(found)} changes; give at most {MOST_DELTAS} in a call"
        )
    if len(found) == 0:
        return
    if not 0 <= found["word"].min() <= found["word"].max() < words:
        raise CellMapError(
            f"a change is of a word beyond {words}; give the map the scene's region"
        )
    error, motion = found["error"], found["motion"]
    sound = (found["stamp"] < np.inf) & (error >= 0.0) & (error < np.inf)
    sound &= (motion == Motion.STILL) | (motion == Motion.MOVING)
    sound &= (found["source"] >= NO_SENSOR) & (found["source"] <= SEVERAL)
    if not sound.all():
        k = int(np.flatnonzero(~sound)[0])
        raise CellMapError(
            f"change {k} has stamp {found['stamp'][k]}, error {error[k]}, motion "
            f"{motion[k]} and source {found['source'][k]}; stamp and error must be "
            f"finite, motion 0 or 1, source 0 to {SEVERAL}"
        )
